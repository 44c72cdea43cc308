// SPDX-License-Identifier: Apache-2.0
#include "scene/environment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "core/image.h"

namespace nacre::scene {
namespace {

constexpr float pi = std::numbers::pi_v<float>;

/// A rectangular lamp far away, with a soft border.
struct SoftBox {
    glm::vec3 direction;  ///< To its center.
    float half_width;     ///< Tangent of half its angular size, along the horizon.
    float half_height;    ///< The same, upwards.
    float softness;       ///< Width of its border, in the same tangents.
    glm::vec3 luminance;
};

float smooth_step(float from, float to, float x) {
    const float t = std::clamp((x - from) / (to - from), 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

glm::vec3 light_of(const SoftBox& lamp, const glm::vec3& direction) {
    const glm::vec3 axis = glm::normalize(lamp.direction);
    const float depth = glm::dot(direction, axis);
    if (depth <= 0.0f) return glm::vec3(0.0f);
    const glm::vec3 reference = std::abs(axis.y) > 0.99f ? glm::vec3(0, 0, -1) : glm::vec3(0, 1, 0);
    const glm::vec3 right = glm::normalize(glm::cross(axis, reference));
    const glm::vec3 up = glm::cross(right, axis);
    const float x = std::abs(glm::dot(direction, right)) / depth;
    const float y = std::abs(glm::dot(direction, up)) / depth;
    const float inside = (1.0f - smooth_step(lamp.half_width, lamp.half_width + lamp.softness, x)) *
                         (1.0f - smooth_step(lamp.half_height, lamp.half_height + lamp.softness, y));
    return inside * lamp.luminance;
}

glm::vec3 studio_light(const glm::vec3& direction) {
    // The part of the room that a camera looking along -Z sees is free of lamps.
    static const SoftBox lamps[] = {
        {{0.1f, 1.0f, 0.35f}, 0.75f, 0.5f, 0.15f, {3.1f, 3.05f, 3.0f}},    // overhead
        {{-0.9f, 0.55f, 0.6f}, 0.32f, 0.45f, 0.08f, {5.0f, 4.75f, 4.4f}},  // key, upper left front
        {{1.0f, 0.2f, 0.35f}, 0.3f, 0.6f, 0.15f, {1.3f, 1.45f, 1.65f}},    // fill, right
        {{0.9f, 0.35f, -0.42f}, 0.07f, 0.5f, 0.05f, {4.0f, 4.0f, 4.2f}},   // rim, behind on the right
        {{-0.95f, 0.25f, -0.3f}, 0.05f, 0.4f, 0.05f, {2.4f, 2.4f, 2.5f}},  // rim, behind on the left
    };
    // The room: walls that are brightest a little above the horizon, a darker floor.
    const float rise = direction.y - 0.12f;
    const float wall = 0.30f + 0.34f * std::exp(-rise * rise * 5.0f);
    const float floor = smooth_step(0.02f, -0.5f, direction.y);
    glm::vec3 light = glm::mix(wall * glm::vec3(1.01f, 1.0f, 0.98f), glm::vec3(0.20f, 0.195f, 0.19f), floor);
    for (const SoftBox& lamp : lamps) light += light_of(lamp, direction);
    return light;
}

}  // namespace

glm::vec3 environment_direction(const glm::vec2& uv) {
    const float azimuth = (uv.x - 0.5f) * 2.0f * pi;  // 0 at -Z, growing towards +X
    const float polar = uv.y * pi;
    const float sin_polar = std::sin(polar);
    return {sin_polar * std::sin(azimuth), std::cos(polar), -sin_polar * std::cos(azimuth)};
}

glm::vec2 environment_uv(const glm::vec3& direction) {
    const float length = glm::length(direction);
    if (!(length > 0.0f)) return {0.5f, 0.5f};
    const float azimuth = std::atan2(direction.x, -direction.z);
    return {0.5f + azimuth / (2.0f * pi), std::acos(std::clamp(direction.y / length, -1.0f, 1.0f)) / pi};
}

Expected<Environment> load_environment(const std::string& path) {
    const ImageLimits limits{.max_width = 16384, .max_height = 8192};
    auto info = read_image_info(path, limits);
    if (info && info->format != ImageFormat::radiance && info->format != ImageFormat::openexr) {
        return fail(
            ErrorCode::unsupported, "load environment", "'" + path + "'",
            fmt::format("it is a {} file, which cannot hold the brightness of a light source", name_of(info->format)),
            "Use a Radiance (.hdr) or OpenEXR (.exr) picture.");
    }
    auto picture = info ? read_image(path, limits) : std::unexpected(info.error());
    if (!picture) {
        Error error = picture.error();
        error.attempted = "load environment";
        error.subject = "'" + path + "'";
        return std::unexpected(std::move(error));
    }

    static constexpr float largest_half = 65504.0f;
    const auto clean = [](float value) { return value > 0.0f ? std::min(value, largest_half) : 0.0f; };
    Environment result{.name = path, .width = picture->width, .height = picture->height};
    result.texels.reserve(picture->texel_count());
    for (std::size_t i = 0; i < picture->texel_count(); ++i) {
        const float* texel = picture->pixels.data() + i * picture->channels;
        const glm::vec3 rgb = picture->channels >= 3 ? glm::vec3(texel[0], texel[1], texel[2]) : glm::vec3(texel[0]);
        result.texels.emplace_back(clean(rgb.r), clean(rgb.g), clean(rgb.b), 1.0f);
    }
    return result;
}

namespace {

Environment make_studio() {
    Environment result{.name = "studio", .width = 512, .height = 256};
    result.texels.reserve(std::size_t{result.width} * result.height);
    double weighted_luminance = 0.0;
    double weight_sum = 0.0;
    for (std::uint32_t row = 0; row < result.height; ++row) {
        const float v = (static_cast<float>(row) + 0.5f) / static_cast<float>(result.height);
        const float solid_angle = std::sin(v * pi);
        for (std::uint32_t column = 0; column < result.width; ++column) {
            const float u = (static_cast<float>(column) + 0.5f) / static_cast<float>(result.width);
            const glm::vec3 light = studio_light(environment_direction({u, v}));
            weighted_luminance += solid_angle * glm::dot(light, glm::vec3(0.2126f, 0.7152f, 0.0722f));
            weight_sum += solid_angle;
            result.texels.emplace_back(light, 1.0f);
        }
    }
    const auto to_documented_mean = static_cast<float>(0.5 * weight_sum / weighted_luminance);
    for (glm::vec4& texel : result.texels) texel = glm::vec4(glm::vec3(texel) * to_documented_mean, 1.0f);
    return result;
}

}  // namespace

Environment studio_environment() {
    static const Environment studio = make_studio();
    return studio;
}

}  // namespace nacre::scene
