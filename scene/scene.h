// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "materials/description.h"
#include "materials/specular_table.h"

/// @file
/// A scene as plain data, ready to be drawn: every vertex is final (morph targets, skins and animations are already
/// applied for `Scene::time`), every primitive is an indexed list, every index is in range, every number is finite.
///
///     Expected<Scene> scene = load_scene("car.gltf");               // scene/load.h
///     for (const Instance& instance : scene->instances)
///         for (const Primitive& primitive : scene->meshes[instance.mesh].primitives)
///             for (const glm::mat4& world : instance.transforms) draw(primitive, world);
///
/// Space: right-handed, +Y up, meters; a camera looks along its own -Z. Front faces wind counter-clockwise
/// (reversed where `is_mirrored(transform)`). Colors are linear with sRGB primaries, luminance in cd/m2.
/// Plain data: reading from many threads is safe while nobody writes.

namespace nacre::scene {

/// Axis-aligned box; empty while minimum > maximum.
struct Bounds {
    glm::vec3 minimum{std::numeric_limits<float>::max()};
    glm::vec3 maximum{std::numeric_limits<float>::lowest()};

    [[nodiscard]] bool empty() const { return !(minimum.x <= maximum.x); }
    void add(const glm::vec3& point);
    void add(const Bounds& other);
    [[nodiscard]] glm::vec3 center() const { return 0.5f * minimum + 0.5f * maximum; }
    [[nodiscard]] float radius() const;  ///< Half the diagonal, meters; 0 when empty.
    [[nodiscard]] Bounds transformed(const glm::mat4& transform) const;
};

enum class ColorSpace {
    linear,  ///< Texel values are data or linear color.
    srgb,    ///< rgb is sRGB encoded (decode before filtering); a is linear.
};

/// A decoded picture, 8 bits per channel RGBA, row 0 on top, no padding.
/// Two images may share `pixels`: a picture used both as color and as data appears once for each color space.
struct Image {
    std::string name;
    std::string origin;     ///< Where the encoded picture came from: a path, "data URI" or "bufferView 3".
    std::string mime_type;  ///< "image/png" or "image/jpeg"; empty for pictures made by code.
    ColorSpace color_space = ColorSpace::linear;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    bool has_alpha = false;                                   ///< Some texel has alpha below 255.
    std::shared_ptr<const std::vector<std::uint8_t>> pixels;  ///< 4 * width * height bytes; never null.
};

enum class Filter { nearest, linear };
enum class MipFilter { none, nearest, linear };
enum class Wrap { repeat, mirrored_repeat, clamp_to_edge };

/// How a texture is read. The default is what glTF recommends where a file does not say.
struct Sampler {
    Filter magnification = Filter::linear;
    Filter minification = Filter::linear;
    MipFilter mip = MipFilter::linear;
    Wrap wrap_u = Wrap::repeat;
    Wrap wrap_v = Wrap::repeat;

    bool operator==(const Sampler&) const = default;
};

enum class Topology { point_list, line_list, triangle_list };

/// Geometry with one material. Attribute arrays are either empty or as long as `positions`.
struct Primitive {
    Topology topology = Topology::triangle_list;
    std::vector<glm::vec3> positions;  ///< Meters, in the space of the mesh.
    std::vector<glm::vec3> normals;    ///< Unit length. Always there for triangles; may be empty for points and lines.
    std::vector<glm::vec4> tangents;   ///< xyz: unit tangent, w: +1 or -1, bitangent = w * cross(normal, tangent).
                                       ///< There when the file has them or `materials::needs_tangents`, else empty.
    std::vector<glm::vec2> uv0;        ///< Texture coordinates, (0, 0) is the upper left corner of the picture.
    std::vector<glm::vec2> uv1;
    std::vector<glm::vec4> colors;       ///< Linear RGBA, [0, 1]; multiplies the base color.
    std::vector<std::uint32_t> indices;  ///< Never empty; a multiple of 1, 2 or 3 by topology; all < positions.size().
    std::uint32_t material = 0;          ///< Index into Scene::materials, always valid.
    Bounds bounds;                       ///< Of the positions that are indexed.
};

struct Mesh {
    std::string name;
    std::vector<Primitive> primitives;
};

/// A mesh placed in the world once or many times.
struct Instance {
    std::string name;
    std::uint32_t mesh = 0;             ///< Index into Scene::meshes, always valid.
    std::vector<glm::mat4> transforms;  ///< Mesh to world, affine; one, or as many as EXT_mesh_gpu_instancing says.
};

enum class Projection { perspective, orthographic };

/// A camera at the place of its node.
struct Camera {
    std::string name;
    Projection projection = Projection::perspective;
    glm::mat4 world{1.0f};                     ///< Camera to world, without scale: looks along -Z, +Y is up.
    float vertical_field_of_view = 0.785398f;  ///< Perspective: full angle, radians, (0, pi).
    float aspect_ratio = 0.0f;                 ///< Perspective: width / height of the frame; 0: that of the picture.
    float half_width = 1.0f;                   ///< Orthographic: meters.
    float half_height = 1.0f;                  ///< Orthographic: meters.
    float near_distance = 0.1f;                ///< Meters, > 0 for perspective, >= 0 for orthographic.
    float far_distance = std::numeric_limits<float>::infinity();  ///< Meters; infinity: none (perspective only).
};

enum class LightKind { directional, point, spot };

/// A punctual light. Units are photometric, as in KHR_lights_punctual, and shading keeps them: a directional light
/// of intensity E gives illuminance E * cos(theta) (lux), a point or spot light of intensity I gives I * cos(theta) /
/// distance^2, so that a white Lambertian surface shows luminance E / pi (cd/m2). Emission and environments are in
/// the same cd/m2. For radiometric quantities see `luminous_efficacy`.
struct Light {
    std::string name;
    LightKind kind = LightKind::point;
    glm::vec3 color{1.0f};                   ///< Linear, multiplies intensity.
    float intensity = 1.0f;                  ///< Directional: lux. Point and spot: candela. >= 0.
    glm::vec3 position{0.0f};                ///< World, meters. Point and spot.
    glm::vec3 direction{0.0f, 0.0f, -1.0f};  ///< World, unit: where the light travels to. Directional and spot.
    float range = std::numeric_limits<float>::infinity();  ///< Meters; light is faded to 0 at this distance.
    float inner_cone_angle = 0.0f;       ///< Spot: radians from the axis where fading begins, < outer_cone_angle.
    float outer_cone_angle = 0.785398f;  ///< Spot: radians from the axis where it has faded, <= pi / 2.
    bool casts_shadows = true;
};

/// Lumens per watt at 555 nm, by which photometric quantities become radiometric ones and back (the definition of
/// the candela): radiance = luminance / luminous_efficacy.
inline constexpr float luminous_efficacy = 683.0f;

/// Light from infinitely far away in all directions, as an equirectangular picture (see environment_direction).
struct Environment {
    std::string name;  ///< File path or "studio".
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<glm::vec4> texels;  ///< Row 0 on top (+Y); rgb: linear, finite, >= 0; times intensity = cd/m2; a: 1.
    float intensity = 1.0f;
    float rotation = 0.0f;  ///< Radians around +Y, counter-clockwise seen from above.

    [[nodiscard]] bool present() const { return !texels.empty(); }
};

/// See the top of this file.
struct Scene {
    std::string name;  ///< Path or built-in name that it was loaded from.
    std::vector<Image> images;
    std::vector<Sampler> samplers;
    std::vector<materials::MaterialDescription> materials;  ///< Never empty when there is a primitive.
    std::vector<Mesh> meshes;
    std::vector<Instance> instances;
    std::vector<Camera>
        cameras;  ///< At least one; the first is the default. Made by `framing_camera` if the file has none.
    std::vector<Light> lights;
    /// What Slab::specular_lut of the materials' trees counts in; empty: materials::default_specular_tables().
    std::vector<materials::SpecularTable> specular_tables;
    Environment environment;            ///< Always present; `studio_environment()` where the source has none.
    float time = 0.0f;                  ///< Seconds at which animations were evaluated.
    std::vector<std::string> warnings;  ///< What was wrong but survivable, one sentence each.
};

/// Box around everything that is drawn, in world space.
[[nodiscard]] Bounds world_bounds(const Scene& scene);

/// True when the transform turns counter-clockwise faces into clockwise ones (negative determinant).
[[nodiscard]] bool is_mirrored(const glm::mat4& transform);

/// A perspective camera (vertical field of view 45 degrees) from the front, a little above and to the right, that
/// sees all of `bounds` in a picture of the given width / height. Named "default". Empty bounds: looks at the origin.
[[nodiscard]] Camera framing_camera(const Bounds& bounds, float aspect_ratio = 16.0f / 9.0f);

/// The camera with that name, or by decimal index ("0", "1", ...); null when there is none.
[[nodiscard]] const Camera* find_camera(const Scene& scene, const std::string& name);

/// Number of triangles, with every instance counted.
[[nodiscard]] std::uint64_t triangle_count(const Scene& scene);

}  // namespace nacre::scene
