// SPDX-License-Identifier: Apache-2.0
#include "core/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <new>
#include <system_error>

namespace nacre {
namespace {

std::string quoted(const std::filesystem::path& path) { return fmt::format("'{}'", path.native()); }

std::unexpected<Error> system_failure(std::string attempted, const std::filesystem::path& path, int error_number) {
    const ErrorCode code =
        error_number == ENOENT || error_number == ENOTDIR ? ErrorCode::not_found : ErrorCode::input_output;
    std::string remedy;
    if (code == ErrorCode::not_found)
        remedy = "Check the path; it is taken relative to the folder in which the program was started.";
    else if (error_number == EACCES || error_number == EPERM || error_number == EROFS)
        remedy = "Check the permissions or choose another folder.";
    else if (error_number == ENOSPC || error_number == EDQUOT)
        remedy = "Free some space on the disk.";
    return fail(code, std::move(attempted), quoted(path), std::generic_category().message(error_number), remedy);
}

class FileDescriptor {
  public:
    explicit FileDescriptor(int descriptor) : descriptor_(descriptor) {}
    FileDescriptor(const FileDescriptor&) = delete;
    FileDescriptor& operator=(const FileDescriptor&) = delete;
    ~FileDescriptor() {
        if (descriptor_ >= 0) ::close(descriptor_);
    }
    [[nodiscard]] int get() const { return descriptor_; }
    /// Closes now and says whether the system accepted all data: some file systems report a full disk only here.
    bool close() { return ::close(std::exchange(descriptor_, -1)) == 0; }

  private:
    int descriptor_;
};

/// Container is std::vector<std::byte> or std::string.
template <typename Container>
Expected<Container> read_file(const std::filesystem::path& path, std::uint64_t limit) {
    constexpr const char* attempted = "read file";
    const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file.get() < 0) return system_failure(attempted, path, errno);
    struct stat status {};
    if (::fstat(file.get(), &status) != 0) return system_failure(attempted, path, errno);
    if (S_ISDIR(status.st_mode))
        return fail(ErrorCode::input_output, attempted, quoted(path), "it is a folder", "Name a file.");

    const auto too_large = [&](std::uint64_t size) {
        return fail(ErrorCode::out_of_memory, attempted, quoted(path),
                    fmt::format("it holds {}{} bytes but at most {} are read",
                                S_ISREG(status.st_mode) ? "" : "at least ", size, limit));
    };
    const std::uint64_t expected_size = S_ISREG(status.st_mode) ? static_cast<std::uint64_t>(status.st_size) : 0;
    if (expected_size > limit) return too_large(expected_size);

    try {
        Container content;
        // One byte more than expected, so that the end of an ordinary file is found without growing. Files of /proc
        // and pipes tell no size: they grow by doubling.
        content.resize(expected_size > 0 ? expected_size + 1 : 4096);
        std::size_t used = 0;
        for (;;) {
            if (used == content.size()) content.resize(content.size() * 2);
            const ssize_t count = ::read(file.get(), content.data() + used, content.size() - used);
            if (count < 0 && errno == EINTR) continue;
            if (count < 0) return system_failure(attempted, path, errno);
            if (count == 0) break;
            used += static_cast<std::size_t>(count);
            if (used > limit) return too_large(used);
        }
        content.resize(used);
        return content;
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::out_of_memory, attempted, quoted(path),
                    fmt::format("no memory for its {} bytes", expected_size));
    }
}

}  // namespace

Expected<std::vector<std::byte>> read_binary_file(const std::filesystem::path& path, std::uint64_t limit) {
    return read_file<std::vector<std::byte>>(path, limit);
}

Expected<std::string> read_text_file(const std::filesystem::path& path, std::uint64_t limit) {
    Expected<std::string> text = read_file<std::string>(path, limit);
    if (text && text->starts_with("\xEF\xBB\xBF")) text->erase(0, 3);
    return text;
}

Expected<void> write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes) {
    constexpr const char* attempted = "write file";
    struct stat status {};
    // What is no ordinary file (a pipe, /dev/stdout) cannot be replaced, only written to.
    const bool is_device = ::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
    const std::filesystem::path folder = path.parent_path();
    if (!folder.empty() && !is_device) {
        std::error_code error;
        std::filesystem::create_directories(folder, error);
        if (error) return system_failure("create folder", folder, error.value());
    }

    static std::atomic<std::uint64_t> counter{0};
    const std::filesystem::path temporary =
        is_device ? path : folder / fmt::format("{}{}-{}", temporary_file_prefix, ::getpid(), counter.fetch_add(1));
    FileDescriptor file(::open(temporary.c_str(), O_WRONLY | (is_device ? 0 : O_CREAT | O_TRUNC) | O_CLOEXEC, 0666));
    if (file.get() < 0) return system_failure(attempted, path, errno);

    int error_number = 0;
    for (std::size_t written = 0; written < bytes.size() && error_number == 0;) {
        const ssize_t count = ::write(file.get(), bytes.data() + written, bytes.size() - written);
        if (count >= 0)
            written += static_cast<std::size_t>(count);
        else if (errno != EINTR)
            error_number = errno;
    }
    if (!file.close() && error_number == 0) error_number = errno;
    if (!is_device && error_number == 0 && ::rename(temporary.c_str(), path.c_str()) != 0) error_number = errno;
    if (error_number != 0) {
        if (!is_device) ::unlink(temporary.c_str());
        return system_failure(attempted, path, error_number);
    }
    return {};
}

Expected<void> write_file_atomically(const std::filesystem::path& path, std::string_view text) {
    return write_file_atomically(path, std::as_bytes(std::span(text)));
}

}  // namespace nacre
