// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/backends.h"

#include <algorithm>

#include "rhi/backend.h"
#include "samples/backends.h"

namespace nacre::command {
std::unique_ptr<rhi::Instance> make_instance() { return std::make_unique<rhi::Instance>(all_backends()); }

std::vector<std::string> backend_names() {
    std::vector<std::string> names;
    for (const auto& backend : all_backends()) names.emplace_back(backend->name());
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
