// SPDX-License-Identifier: Apache-2.0
#include "samples/backends.h"

#include <cstdlib>

#ifdef NACRE_HAS_VULKAN
#include "backends/vulkan/vulkan_backend.h"
#endif
#ifdef NACRE_HAS_GL
#include "backends/gl/gl_backend.h"
#endif
#ifdef NACRE_HAS_CPU
#include "backends/cpu/cpu_backend.h"
#endif

namespace nacre {

std::vector<std::unique_ptr<rhi::Backend>> all_backends() {
    // Mesa's software drivers filter textures with shortcuts that are not conformant, and not the same ones on Vulkan
    // and OpenGL, unless they are told not to before they are loaded. Devices of their own do not look at this.
    setenv("GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx", 0);
    std::vector<std::unique_ptr<rhi::Backend>> backends;
#ifdef NACRE_HAS_CPU
    // First, so "auto" takes it: it works on every machine and needs no driver.
    backends.push_back(cpu::make_backend());
#endif
#ifdef NACRE_HAS_VULKAN
    backends.push_back(vulkan::make_backend());
#endif
#ifdef NACRE_HAS_GL
    backends.push_back(gl::make_backend());
    backends.push_back(gl::make_es_backend());
#endif
    return backends;
}

}  // namespace nacre
