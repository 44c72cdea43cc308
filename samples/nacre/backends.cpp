// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/backends.h"

#include <algorithm>

#include "backends/gl/gl_backend.h"
#include "backends/vulkan/vulkan_backend.h"
#include "rhi/backend.h"

namespace nacre::command {
namespace {

std::vector<std::unique_ptr<rhi::Backend>> make_backends() {
    std::vector<std::unique_ptr<rhi::Backend>> backends;
    backends.push_back(vulkan::make_backend());
    backends.push_back(gl::make_backend());
    backends.push_back(gl::make_es_backend());
    return backends;
}

}  // namespace

std::unique_ptr<rhi::Instance> make_instance() { return std::make_unique<rhi::Instance>(make_backends()); }

std::vector<std::string> backend_names() {
    std::vector<std::string> names;
    for (const auto& backend : make_backends()) names.emplace_back(backend->name());
    return names;
}

std::vector<std::string> working_backends(const rhi::Instance& instance) {
    const std::vector<rhi::AdapterInfo> adapters = instance.adapters();
    std::vector<std::string> names = instance.backend_names();
    std::erase_if(names, [&](const std::string& name) {
        return std::ranges::none_of(adapters, [&](const auto& adapter) { return adapter.backend == name; });
    });
    return names;
}

}  // namespace nacre::command
