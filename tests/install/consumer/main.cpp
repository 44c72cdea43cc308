// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/cpu_backend.h"
#include "backends/gl/gl_backend.h"
#include "backends/vulkan/vulkan_backend.h"
#include "rhi/device.h"

#include <iostream>

int main() {
    std::vector<std::unique_ptr<nacre::rhi::Backend>> backends;
    backends.push_back(nacre::vulkan::make_backend());
    backends.push_back(nacre::gl::make_backend());
    backends.push_back(nacre::cpu::make_backend());
    const nacre::rhi::Instance instance(std::move(backends));
    for (const auto& adapter : instance.adapters()) std::cout << adapter.backend << ": " << adapter.name << '\n';
    for (const auto& missing : instance.unavailable()) std::cout << missing.backend << ": " << missing.error.message() << '\n';
    const auto device = instance.create_device({.backend = "cpu"});
    if (!device) {
        std::cout << device.error().message() << '\n';
        return 1;
    }
    std::cout << "nacre works\n";
}
