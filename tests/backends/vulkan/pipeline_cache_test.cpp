// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/pipeline_cache.h"

#include <cstring>
#include <fstream>

#include "core/file.h"
#include "tests/backends/vulkan/vulkan_device.h"
#include "tests/core/temporary_folder.h"

namespace nacre::vulkan::test {
namespace {

namespace fs = std::filesystem;

class PipelineCacheTest : public testing::Test {
  protected:
    void SetUp() override {
        auto library = Library::open();
        if (!library) GTEST_SKIP() << library.error().message();
        auto instance = Instance::create(*library, {});
        if (!instance && instance.error().code == ErrorCode::not_found) GTEST_SKIP() << instance.error().message();
        ASSERT_TRUE(instance) << instance.error().message();
        auto devices = PhysicalDevice::list(**instance);
        if (!devices && devices.error().code == ErrorCode::not_found) GTEST_SKIP() << devices.error().message();
        ASSERT_TRUE(devices) << devices.error().message();
        instance_ = *instance;
        physical_ = std::move(devices->front());
    }

    /// Makes a device with the folder as cache, a pipeline, and destroys both.
    void make_a_pipeline() {
        TestDevice device("vulkan", {.pipeline_cache = folder_.path().string()});
        ASSERT_TRUE(device.get()) << device.error();
        must(device->create_compute_pipeline({.shader = must(device->create_shader(compile_text(
                                                  "empty.comp", "layout(local_size_x = 1) in; void main() {}")))}));
        must(device->save_pipeline_cache());
        device.destroy_device();
        for (const std::string& message : device.take_messages()) ADD_FAILURE() << message;
    }
    [[nodiscard]] std::optional<std::vector<std::byte>> stored() const {
        return DiskCache(folder_.path()).load(PipelineCache::category, PipelineCache::key_of(*physical_));
    }
    [[nodiscard]] fs::path file() const {
        for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
            if (entry.is_regular_file()) return entry.path();
        return {};
    }

    TemporaryFolder folder_;
    std::shared_ptr<const Instance> instance_;
    std::unique_ptr<PhysicalDevice> physical_;
};

TEST_F(PipelineCacheTest, IsKeptFromDeviceToDevice) {
    EXPECT_FALSE(stored());
    make_a_pipeline();
    const auto first = stored();
    ASSERT_TRUE(first);
    EXPECT_TRUE(PipelineCache::is_usable(*physical_, *first));
    make_a_pipeline();
    EXPECT_TRUE(stored());
}

TEST_F(PipelineCacheTest, IsRebuiltWhenTheFileIsDamaged) {
    make_a_pipeline();
    // Its name stays the same; the file itself is removed whenever it is found to be damaged.
    const fs::path path = file();
    ASSERT_FALSE(path.empty());
    const auto whole = read_binary_file(path);
    ASSERT_TRUE(whole);
    // One byte changed, in turn over the file; then the file cut off at several places.
    for (std::size_t at = 0; at < whole->size(); at += 1 + whole->size() / 16) {
        std::vector<std::byte> damaged = *whole;
        damaged[at] ^= std::byte{0x20};
        must(write_file_atomically(path, damaged));
        EXPECT_FALSE(stored()) << "byte " << at;
    }
    for (const std::size_t size : {std::size_t{0}, std::size_t{5}, whole->size() / 2, whole->size() - 1}) {
        make_a_pipeline();
        std::vector<std::byte> damaged(whole->begin(), whole->begin() + static_cast<std::ptrdiff_t>(size));
        must(write_file_atomically(path, damaged));
        EXPECT_FALSE(stored()) << size << " bytes";
    }
    make_a_pipeline();
    EXPECT_TRUE(stored());
}

TEST_F(PipelineCacheTest, RefusesTheCacheOfAnotherDriver) {
    make_a_pipeline();
    const auto whole = stored();
    ASSERT_TRUE(whole);
    const auto changed = [&](std::size_t at) {
        std::vector<std::byte> bytes = *whole;
        bytes[at] ^= std::byte{1};
        return bytes;
    };
    using Header = VkPipelineCacheHeaderVersionOne;
    for (const std::size_t at : {offsetof(Header, headerVersion), offsetof(Header, vendorID),
                                 offsetof(Header, deviceID), offsetof(Header, pipelineCacheUUID) + 7})
        EXPECT_FALSE(PipelineCache::is_usable(*physical_, changed(at))) << "byte " << at;
    EXPECT_FALSE(PipelineCache::is_usable(*physical_, {}));
    EXPECT_FALSE(PipelineCache::is_usable(*physical_, std::span(*whole).first(sizeof(Header) - 1)));
    // A header that claims to be longer than the data.
    std::vector<std::byte> long_header = *whole;
    const std::uint32_t size = 0x7fffffff;
    std::memcpy(long_header.data(), &size, 4);
    EXPECT_FALSE(PipelineCache::is_usable(*physical_, long_header));
    // With a valid checksum on disk it is replaced by one of this driver.
    ASSERT_TRUE(DiskCache(folder_.path())
                    .store(PipelineCache::category, PipelineCache::key_of(*physical_),
                           changed(offsetof(Header, pipelineCacheUUID))));
    make_a_pipeline();
    const auto rebuilt = stored();
    ASSERT_TRUE(rebuilt);
    EXPECT_TRUE(PipelineCache::is_usable(*physical_, *rebuilt));
}

TEST_F(PipelineCacheTest, GoesOnWithoutAFolder) {
    // A file stands where the folder should be.
    const fs::path blocked = folder_.path() / "blocked";
    must(write_file_atomically(blocked, std::string_view("x")));
    TestDevice device("vulkan", {.pipeline_cache = (blocked / "cache").string()});
    ASSERT_TRUE(device.get()) << device.error();
    must(device->create_compute_pipeline({.shader = must(device->create_shader(compile_text(
                                              "empty.comp", "layout(local_size_x = 1) in; void main() {}")))}));
    EXPECT_TRUE(device->save_pipeline_cache());
}

}  // namespace
}  // namespace nacre::vulkan::test
