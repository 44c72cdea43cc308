// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/quirks.h"

#include <cstdlib>

#include "core/dynamic_library.h"

namespace nacre::vulkan {
namespace {

constexpr EnvironmentQuirk environment_list[] = {
    {"GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx",
     "lavapipe's default texture filter takes one level of detail for a quad of pixels and filters 8-bit textures in "
     "8-bit arithmetic; neither conforms, and pictures would differ from other devices'"},
};

}  // namespace

std::span<const EnvironmentQuirk> environment_quirks() { return environment_list; }

void prepare_for_drivers() {
    for (const EnvironmentQuirk& quirk : environment_list) ::setenv(quirk.variable, quirk.value, /*overwrite=*/0);
#if defined(__SANITIZE_ADDRESS__)
    // Lavapipe of Mesa 22.3 keeps 128 bytes when it is unloaded with the last instance. Reported from a library that is
    // no longer there, the leak has no name that a suppression could match; from a resident one there is none.
    (void)DynamicLibrary::open({"libvulkan_lvp.so"}, "", LibraryLifetime::resident);
    // The validation layer keeps some of its records of destroyed pipelines. Resident, it can be suppressed by name.
    (void)DynamicLibrary::open({"libVkLayer_khronos_validation.so"}, "", LibraryLifetime::resident);
#endif
}

}  // namespace nacre::vulkan
