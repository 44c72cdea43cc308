// SPDX-License-Identifier: Apache-2.0
#include "samples/backends.h"

#ifdef NACRE_HAS_VULKAN
#include "backends/vulkan/vulkan_backend.h"
#endif
#ifdef NACRE_HAS_GL
#include "backends/gl/gl_backend.h"
#endif

namespace nacre {

std::vector<std::unique_ptr<rhi::Backend>> all_backends() {
    std::vector<std::unique_ptr<rhi::Backend>> backends;
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
