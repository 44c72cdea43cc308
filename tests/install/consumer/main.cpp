// SPDX-License-Identifier: Apache-2.0
#include "rhi/shader_compiler.h"
#include "scene/load.h"

#include <iostream>

int main() {
    const auto scene = nacre::scene::load_scene("builtin:spheres");
    nacre::rhi::ShaderCompiler compiler({});
    const auto shader = compiler.compile({.path = "empty.comp", .text = "layout(local_size_x = 1) in;\nvoid main() {}\n"});
    std::cout << (!scene ? scene.error().message() : !shader ? shader.error().message() : "nacre works") << '\n';
}
