// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>

#include "core/error.h"

/// @file
/// A library opened at run time: how Nacre reaches graphics drivers, so that a program starts on machines
/// that have none of them.
///
///     NACRE_TRY(DynamicLibrary egl, DynamicLibrary::open({"libEGL.so.1", "libEGL.so"}, "libegl1"));
///     NACRE_TRY(auto get_display, egl.symbol<EGLDisplay (*)(EGLNativeDisplayType)>("eglGetDisplay"));

namespace nacre {

enum class LibraryLifetime {
    while_open,  ///< Unloaded when the last owner closes it.
    resident,    ///< Stays loaded until the program ends: for drivers that crash or leak when unloaded.
};

/// Owns one opened library and closes it when destroyed. Opening, looking up and closing are thread-safe.
class DynamicLibrary {
  public:
    /// An empty one, which holds no library.
    DynamicLibrary() = default;
    DynamicLibrary(DynamicLibrary&& other) noexcept;
    DynamicLibrary& operator=(DynamicLibrary&& other) noexcept;
    ~DynamicLibrary();

    /// Opens the first of `names` that the system can load. The error (`not_found`) lists all names with the system's
    /// reason for each and names `debian_package` as what to install (may be empty).
    static Expected<DynamicLibrary> open(std::initializer_list<std::string_view> names, std::string_view debian_package,
                                         LibraryLifetime lifetime = LibraryLifetime::while_open);

    /// The address of a function or variable, as the pointer type `Pointer`; an error names symbol and library.
    template <typename Pointer>
    requires std::is_pointer_v<Pointer> Expected<Pointer> symbol(const char* name)
    const {
        NACRE_TRY(void* address, address_of(name));
        return reinterpret_cast<Pointer>(address);
    }

    /// As `symbol` for something optional: null where the library does not have it.
    template <typename Pointer>
    requires std::is_pointer_v<Pointer> Pointer find(const char* name)
    const noexcept { return reinterpret_cast<Pointer>(find_address(name)); }

    /// The one of the names that was opened; empty where nothing is.
    [[nodiscard]] const std::string& name() const { return name_; }
    explicit operator bool() const { return handle_ != nullptr; }

  private:
    Expected<void*> address_of(const char* name) const;
    void* find_address(const char* name) const noexcept;

    void* handle_ = nullptr;
    std::string name_;
};

}  // namespace nacre
