// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/quirks.h"

#include <cstdlib>
#include <mutex>

namespace nacre::gl {

void set_driver_environment() {
    static std::once_flag once;
    std::call_once(once, [] {
        ::setenv("GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx", /*overwrite=*/0);
    });
}

Quirks find_quirks(std::string_view renderer, std::string_view) {
    Quirks quirks;
    for (std::string_view name : {"llvmpipe", "softpipe", "swrast", "SwiftShader"})
        quirks.is_software |= renderer.find(name) != std::string_view::npos;
    return quirks;
}

}  // namespace nacre::gl
