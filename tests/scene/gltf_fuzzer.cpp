// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <source_location>
#include <span>

#include "scene/load.h"
#include "scene/scene.h"

/// @file
/// libFuzzer target for the importer: any bytes must give a scene whose promises hold, or an error that says something.
///
///     ./run fuzz        # all fuzz targets, with the seeds in tests/seeds and those made of the sample scenes

namespace {

using nacre::scene::Scene;

void require(bool condition, std::source_location place = std::source_location::current()) {
    if (condition) return;
    std::fprintf(stderr, "a promise is broken at line %u\n", static_cast<unsigned>(place.line()));
    std::abort();
}

void check_promises(const Scene& scene) {
    require(!scene.cameras.empty() && scene.environment.present());
    for (const auto& mesh : scene.meshes) {
        for (const auto& primitive : mesh.primitives) {
            const std::size_t count = primitive.positions.size();
            require(!primitive.indices.empty() && primitive.material < scene.materials.size());
            for (const std::uint32_t index : primitive.indices) require(index < count);
            const bool is_triangles = primitive.topology == nacre::scene::Topology::triangle_list;
            require(primitive.normals.size() == count || (!is_triangles && primitive.normals.empty()));
            require(primitive.tangents.empty() || primitive.tangents.size() == count);
            require(primitive.uv0.empty() || primitive.uv0.size() == count);
            require(primitive.uv1.empty() || primitive.uv1.size() == count);
            require(primitive.colors.empty() || primitive.colors.size() == count);
            for (const auto& p : primitive.positions)
                require(p.x - p.x == 0.0f && p.y - p.y == 0.0f && p.z - p.z == 0.0f);
            for (const auto& n : primitive.normals) {
                const float squared = n.x * n.x + n.y * n.y + n.z * n.z;
                require(squared > 0.99f && squared < 1.01f);
            }
            for (const auto& t : primitive.tangents) {
                const float squared = t.x * t.x + t.y * t.y + t.z * t.z;
                require(squared > 0.99f && squared < 1.01f && (t.w == 1.0f || t.w == -1.0f));
            }
        }
    }
    for (const auto& instance : scene.instances) {
        require(instance.mesh < scene.meshes.size() && !instance.transforms.empty());
    }
    for (const auto& material : scene.materials) {
        nacre::materials::for_each_texture(material, [&](const auto& texture, bool) {
            require(static_cast<std::size_t>(texture.image) < scene.images.size());
            require(static_cast<std::size_t>(texture.sampler) < scene.samplers.size());
        });
    }
    for (const auto& image : scene.images) {
        require(image.pixels && image.pixels->size() == std::size_t{4} * image.width * image.height);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    nacre::scene::LoadOptions options;
    options.time = 0.25f;
    options.limits.geometry_bytes = std::uint64_t{16} << 20;
    options.limits.image_bytes = std::uint64_t{4} << 20;
    options.limits.image_side = 1024;
    // No folder: a fuzzer must not open files by names that it makes up.
    const auto scene = nacre::scene::load_gltf(std::as_bytes(std::span(data, size)), "fuzzed.gltf", "", options);
    if (scene) {
        check_promises(*scene);
    } else {
        require(!scene.error().message().empty());
        require(scene.error().code != nacre::ErrorCode::internal);
    }
    return 0;
}
