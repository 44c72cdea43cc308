// SPDX-License-Identifier: Apache-2.0
// Each call of the driver that can fail fails in turn. Every time an error comes back, nothing is left behind (the
// validation layer reports objects that are not destroyed), and the device goes on working.
#include <algorithm>
#include <cstring>

#include "backends/vulkan/device.h"
#include "tests/backends/vulkan/vulkan_device.h"

// Not within nacre::vulkan, whose names for its own objects are those of the RHI.
namespace nacre::test {
namespace {

using namespace rhi;
using vulkan::test::compile_text;
using vulkan::test::must;
using vulkan::test::TestDevice;
using DriverMode = vulkan::Mode;

/// What is counted, and which call fails how.
struct Plan {
    std::uint64_t calls = 0, failing_call = 0;
    VkResult result = VK_ERROR_OUT_OF_HOST_MEMORY;
    const char* failed_function = nullptr;

    bool strikes(const char* function) {
        if (++calls != failing_call) return false;
        failed_function = function;
        return true;
    }
    static inline Plan* current = nullptr;
};

/// Stands before one function of the driver.
template <typename Tag, typename Function>
struct Before;
template <typename Tag, typename... Arguments>
struct Before<Tag, VkResult(VKAPI_PTR*)(Arguments...)> {
    static inline VkResult(VKAPI_PTR* real)(Arguments...) = nullptr;
    static VKAPI_ATTR VkResult VKAPI_CALL call(Arguments... arguments) {
        if (Plan::current && Plan::current->strikes(Tag::name)) return Plan::current->result;
        return real(arguments...);
    }
};

#define FAILING_FUNCTIONS(X)     \
    X(QueueSubmit)               \
    X(AllocateMemory)            \
    X(MapMemory)                 \
    X(CreateBuffer)              \
    X(BindBufferMemory)          \
    X(CreateImage)               \
    X(BindImageMemory)           \
    X(CreateImageView)           \
    X(CreateSampler)             \
    X(CreateShaderModule)        \
    X(CreateDescriptorSetLayout) \
    X(CreateDescriptorPool)      \
    X(AllocateDescriptorSets)    \
    X(CreatePipelineLayout)      \
    X(CreatePipelineCache)       \
    X(CreateGraphicsPipelines)   \
    X(CreateComputePipelines)    \
    X(CreateRenderPass2)         \
    X(CreateFramebuffer)         \
    X(CreateQueryPool)           \
    X(CreateSemaphore)           \
    X(CreateCommandPool)         \
    X(ResetCommandPool)          \
    X(AllocateCommandBuffers)    \
    X(BeginCommandBuffer)        \
    X(EndCommandBuffer)

#define DECLARE_TAG(function)                          \
    struct Tag##function {                             \
        static constexpr const char* name = #function; \
    };
FAILING_FUNCTIONS(DECLARE_TAG)
#undef DECLARE_TAG

PFN_vkGetDeviceProcAddr real_lookup = nullptr;

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL look_up(VkDevice device, const char* name) {
    const PFN_vkVoidFunction real = real_lookup(device, name);
#define REPLACE(function)                                                                            \
    if (std::strcmp(name, "vk" #function) == 0) {                                                    \
        Before<Tag##function, PFN_vk##function>::real = reinterpret_cast<PFN_vk##function>(real);    \
        return reinterpret_cast<PFN_vkVoidFunction>(&Before<Tag##function, PFN_vk##function>::call); \
    }
    FAILING_FUNCTIONS(REPLACE)
#undef REPLACE
    return real;
}

class FailingBackend final : public Backend {
  public:
    explicit FailingBackend(DriverMode mode) : mode_(mode) {}
    std::string_view name() const override { return "vulkan"; }
    std::span<const Mode> modes() const override {
        static constexpr Mode list[] = {{"", "with failures"}};
        return list;
    }
    Expected<std::vector<AdapterInfo>> adapters() override { return vulkan::make_backend()->adapters(); }
    Expected<std::unique_ptr<BackendDevice>> create_device(const BackendDeviceDesc& desc) override {
        NACRE_TRY(auto library, vulkan::Library::open());
        NACRE_TRY(auto instance, vulkan::Instance::create(
                                     library, {.validation = desc.desc->driver_validation, .report = desc.report}));
        auto& functions = const_cast<vulkan::InstanceFunctions&>(instance->vk);
        real_lookup = std::exchange(functions.GetDeviceProcAddr, look_up);
        return vulkan::Device::create(std::move(instance), mode_, desc);
    }

  private:
    DriverMode mode_;
};

/// Uses every kind of object once; stops at the first error.
Expected<void> work(Device& device) {
    static const ShaderDesc vertex_desc = compile_text("all.vert", R"(
        void main() {
            gl_Position = vec4(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1, 0.5, 1);
        })");
    static const ShaderDesc fragment_desc = compile_text("all.frag", R"(
        layout(set = 0, binding = 0) uniform sampler2D picture;
        layout(location = 0) out vec4 color;
        void main() { color = textureLod(picture, vec2(0.5), 0); })");
    static const ShaderDesc compute_desc = compile_text("add.comp", R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Values { uint values[]; };
        void main() { values[0] += 5; })");
    constexpr TextureUsage copied = TextureUsage::copy_source | TextureUsage::copy_destination;
    NACRE_TRY(const Buffer values, device.create_buffer({.size = 16, .usage = BufferUsage::storage}));
    NACRE_TRY(const Texture picture, device.create_texture({.format = Format::rgba8_unorm,
                                                            .width = 4,
                                                            .height = 4,
                                                            .mips = 3,
                                                            .usage = TextureUsage::sampled | copied}));
    NACRE_TRY(const Texture target,
              device.create_texture({.format = Format::rgba8_unorm,
                                     .width = 4,
                                     .height = 4,
                                     .usage = TextureUsage::color_target | TextureUsage::copy_source}));
    NACRE_TRY(const Sampler sampler, device.create_sampler({}));
    NACRE_TRY(const Shader vertex, device.create_shader(vertex_desc));
    NACRE_TRY(const Shader fragment, device.create_shader(fragment_desc));
    NACRE_TRY(const Shader shader, device.create_shader(compute_desc));
    NACRE_TRY(const GraphicsPipeline graphics,
              device.create_graphics_pipeline(
                  {.vertex = vertex, .fragment = fragment, .color_targets = {{.format = Format::rgba8_unorm}}}));
    NACRE_TRY(const ComputePipeline compute, device.create_compute_pipeline({.shader = shader}));
    NACRE_TRY(const QueryPool queries, device.create_query_pool({.type = QueryType::occlusion, .count = 1}));
    NACRE_TRY(const BindGroupLayout graphics_layout, device.bind_group_layout(graphics, 0));
    NACRE_TRY(const BindGroupLayout compute_layout, device.bind_group_layout(compute, 0));
    NACRE_TRY(const BindGroup seen,
              device.create_bind_group(
                  {.layout = graphics_layout, .entries = {{.binding = 0, .texture = picture, .sampler = sampler}}}));
    NACRE_TRY(const BindGroup counted,
              device.create_bind_group({.layout = compute_layout, .entries = {{.binding = 0, .buffer = values}}}));
    const std::vector<std::byte> texels(64, std::byte{0x80});
    NACRE_CHECK(device.write_texture(picture, texels));
    const std::uint32_t zeros[4]{};
    NACRE_CHECK(device.write_buffer(values, std::as_bytes(std::span(zeros))));
    CommandList list = device.create_command_list("work");
    list.generate_mips(picture);
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
    list.set_pipeline(graphics);
    list.set_bind_group(0, seen);
    list.begin_occlusion_query(queries, 0);
    list.draw({.vertex_count = 3});
    list.end_occlusion_query(queries, 0);
    list.end_render_pass();
    list.set_pipeline(compute);
    list.set_bind_group(0, counted);
    list.dispatch({});
    NACRE_CHECK(device.submit(std::move(list)));
    NACRE_TRY(const std::vector<std::byte> pixels, device.read_texture(target));
    NACRE_TRY(const std::vector<std::byte> result, device.read_buffer(values));
    NACRE_TRY(const std::vector<std::uint64_t> samples, device.read_queries(queries, 0, 1));
    if (pixels[0] != std::byte{0x80} || result[0] != std::byte{5} || samples[0] == 0)
        return fail(ErrorCode::internal, "work", "results", "they are wrong");
    return {};
}

/// A device does without a pipeline cache, and asks for less memory where a whole block is not to be had.
constexpr std::string_view mended[] = {"CreatePipelineCache", "AllocateMemory", "MapMemory"};

class DriverFailure : public testing::TestWithParam<DriverMode> {
  protected:
    /// Makes a device and works with it while the n-th call fails. Returns false once there is no n-th call any more.
    bool fail_call(std::uint64_t n, VkResult result) {
        Plan plan{.failing_call = n, .result = result};
        Plan::current = &plan;
        std::vector<std::string> messages;
        {
            std::vector<std::unique_ptr<Backend>> backends;
            backends.push_back(std::make_unique<FailingBackend>(GetParam()));
            const Instance instance(std::move(backends));
            auto device =
                instance.create_device({.backend = "vulkan", .driver_validation = TestDevice::has_validation_layer()});
            Expected<void> outcome{};
            if (device) {
                (*device)->set_message_callback(
                    [&](const Message& message) { messages.push_back(message.code + ": " + message.text); });
                outcome = work(**device);
            } else {
                outcome = std::unexpected(device.error());
            }
            const std::string where = std::string("call ") + std::to_string(n) + ", vk" +
                                      (plan.failed_function ? plan.failed_function : "(none)");
            SCOPED_TRACE(where);
            plan.failing_call = 0;
            if (plan.failed_function && std::ranges::count(mended, plan.failed_function)) {
                EXPECT_TRUE(outcome) << outcome.error().message();
            } else if (plan.failed_function) {
                EXPECT_FALSE(outcome) << "the failure was swallowed";
                if (!outcome) {
                    EXPECT_EQ(outcome.error().code,
                              result == VK_ERROR_DEVICE_LOST ? ErrorCode::device_lost : ErrorCode::out_of_memory)
                        << outcome.error().message();
                }
            } else {
                EXPECT_TRUE(outcome) << outcome.error().message();
            }
            if (device && result != VK_ERROR_DEVICE_LOST) {
                const auto again = work(**device);
                EXPECT_TRUE(again) << again.error().message();
            }
            if (device) device->reset();
            for (const std::string& message : messages) ADD_FAILURE() << message;
        }
        Plan::current = nullptr;
        return plan.failed_function != nullptr;
    }
};

TEST_P(DriverFailure, OfEachCallIsReportedAndSurvived) {
    if (auto device = TestDevice("vulkan"); !device.get()) GTEST_SKIP() << device.error();
    std::uint64_t n = 1;
    while (fail_call(n, VK_ERROR_OUT_OF_HOST_MEMORY)) ASSERT_LT(++n, 500u);
    EXPECT_GT(n, 40u) << "too few calls for a test of all of them";
}

// This mode makes all calls that the others make, and those of render passes.
INSTANTIATE_TEST_SUITE_P(Vulkan, DriverFailure, testing::Values(DriverMode::legacy),
                         [](const auto& each) { return each.param == DriverMode::automatic ? "automatic" : "legacy"; });

}  // namespace
}  // namespace nacre::test
