// SPDX-License-Identifier: Apache-2.0
#include "core/dynamic_library.h"

#include <dlfcn.h>
#include <fmt/format.h>

namespace nacre {

DynamicLibrary::DynamicLibrary(DynamicLibrary&& other) noexcept
    : handle_(std::exchange(other.handle_, nullptr)), name_(std::exchange(other.name_, {})) {}

DynamicLibrary& DynamicLibrary::operator=(DynamicLibrary&& other) noexcept {
    // The old library is closed by the destructor of `old`.
    DynamicLibrary old(std::move(other));
    std::swap(handle_, old.handle_);
    std::swap(name_, old.name_);
    return *this;
}

DynamicLibrary::~DynamicLibrary() {
    if (handle_) dlclose(handle_);
}

Expected<DynamicLibrary> DynamicLibrary::open(std::initializer_list<std::string_view> names,
                                              std::string_view debian_package, LibraryLifetime lifetime) {
    std::string tried;
    std::string reasons;
    for (std::string_view name : names) {
        const std::string terminated(name);
        const int flags = RTLD_NOW | RTLD_LOCAL | (lifetime == LibraryLifetime::resident ? RTLD_NODELETE : 0);
        if (void* handle = dlopen(terminated.c_str(), flags)) {
            DynamicLibrary library;
            library.handle_ = handle;
            library.name_ = terminated;
            return library;
        }
        const char* reason = dlerror();
        tried += fmt::format("{}'{}'", tried.empty() ? "" : ", ", name);
        reasons += fmt::format("{}{}", reasons.empty() ? "" : "; ", reason ? reason : "no reason given");
    }
    return fail(ErrorCode::not_found, "open library", tried, reasons.empty() ? "no name was given" : reasons,
                debian_package.empty() ? "" : fmt::format("Install it: apt-get install {}", debian_package));
}

void* DynamicLibrary::find_address(const char* name) const noexcept { return handle_ ? dlsym(handle_, name) : nullptr; }

Expected<void*> DynamicLibrary::address_of(const char* name) const {
    if (!handle_) return fail(ErrorCode::not_found, "find symbol", fmt::format("'{}'", name), "no library is open");
    dlerror();
    void* address = dlsym(handle_, name);
    if (address) return address;
    const char* reason = dlerror();
    return fail(ErrorCode::not_found, "find symbol", fmt::format("'{}' in library '{}'", name, name_),
                reason ? reason : "the symbol is null", "The library is too old or is another one of the same name.");
}

}  // namespace nacre
