// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scene/gltf/accessor.h"
#include "scene/gltf/node.h"

namespace nacre::scene::gltf {
namespace {

enum class Interpolation { linear, step, cubic_spline };

/// The keyframes of one channel. With cubic splines each key has three values: in-tangent, value, out-tangent.
struct Curve {
    std::vector<float> times;  ///< Seconds, strictly increasing.
    std::vector<float> values;
    std::size_t components = 0;  ///< Of one value.
    Interpolation interpolation = Interpolation::linear;
    bool is_rotation = false;

    [[nodiscard]] const float* value(std::size_t key) const {
        const std::size_t values_per_key = interpolation == Interpolation::cubic_spline ? 3 : 1;
        const std::size_t offset = interpolation == Interpolation::cubic_spline ? 1 : 0;
        return values.data() + (key * values_per_key + offset) * components;
    }
};

/// Value of a curve at a time (glTF 2.0, appendix C).
std::vector<float> evaluate(const Curve& curve, float time) {
    const std::size_t n = curve.components;
    const auto copy = [&](std::size_t key) { return std::vector<float>(curve.value(key), curve.value(key) + n); };
    if (time <= curve.times.front()) return copy(0);
    if (time >= curve.times.back()) return copy(curve.times.size() - 1);

    const auto after = std::upper_bound(curve.times.begin(), curve.times.end(), time);
    const auto next = static_cast<std::size_t>(after - curve.times.begin());
    const std::size_t key = next - 1;
    if (curve.interpolation == Interpolation::step) return copy(key);

    const float duration = curve.times[next] - curve.times[key];
    const float t = (time - curve.times[key]) / duration;
    const float* a = curve.value(key);
    const float* b = curve.value(next);
    std::vector<float> result(n);
    if (curve.interpolation == Interpolation::cubic_spline) {
        const float* out_tangent = a + n;
        const float* in_tangent = b - n;
        const float t2 = t * t, t3 = t2 * t;
        for (std::size_t i = 0; i < n; ++i) {
            result[i] = (2.0f * t3 - 3.0f * t2 + 1.0f) * a[i] + duration * (t3 - 2.0f * t2 + t) * out_tangent[i] +
                        (-2.0f * t3 + 3.0f * t2) * b[i] + duration * (t3 - t2) * in_tangent[i];
        }
    } else if (curve.is_rotation) {
        const glm::quat from = unit_quaternion({a[0], a[1], a[2], a[3]});
        const glm::quat to = unit_quaternion({b[0], b[1], b[2], b[3]});
        const glm::quat rotation = glm::slerp(from, to, t);  // the short way around
        result = {rotation.x, rotation.y, rotation.z, rotation.w};
    } else {
        for (std::size_t i = 0; i < n; ++i) result[i] = (1.0f - t) * a[i] + t * b[i];
    }
    return result;
}

/// How many weights the mesh of a node has; 0 where it has no mesh or no targets.
std::size_t morph_target_count(Document& document, std::size_t node) {
    const auto& meshes = document.list("meshes");
    const auto mesh = document.list("nodes")[node].find_index("mesh", meshes.size(), "mesh");
    if (!mesh) return 0;
    if (meshes[*mesh].count("primitives") == 0) return 0;
    return meshes[*mesh].at("primitives")[0].count("targets");
}

Curve read_curve(Document& document, const JsonView& sampler, const std::string& element, std::size_t components,
                 bool is_rotation) {
    Curve curve{.components = components, .is_rotation = is_rotation};
    const std::size_t accessor_count = document.list("accessors").size();
    const std::string interpolation = sampler.text("interpolation", "LINEAR");
    if (interpolation == "STEP") {
        curve.interpolation = Interpolation::step;
    } else if (interpolation == "CUBICSPLINE") {
        curve.interpolation = Interpolation::cubic_spline;
    } else if (interpolation != "LINEAR") {
        sampler.at("interpolation").reject_as("LINEAR, STEP or CUBICSPLINE");
    }
    const std::size_t input = sampler.index("input", accessor_count, "accessor");
    if (describe_accessor(document, input).components() != 1) {
        reject(fmt::format("{}, accessor {}: key times must be of type SCALAR", element, input));
    }
    curve.times = read_reals(document, input, element);
    curve.values = read_reals(document, sampler.index("output", accessor_count, "accessor"), element);
    for (std::size_t i = 0; i < curve.times.size(); ++i) {
        if (!std::isfinite(curve.times[i]) || (i > 0 && curve.times[i] <= curve.times[i - 1])) {
            reject(fmt::format("{}: its key times do not increase strictly (key {})", element, i));
        }
    }
    const std::size_t values_per_key = curve.interpolation == Interpolation::cubic_spline ? 3 : 1;
    if (curve.values.size() != curve.times.size() * values_per_key * components) {
        reject(fmt::format(
            "{}: {} keys with {} values of {} components each need {} numbers, but the output accessor "
            "holds {}",
            element, curve.times.size(), values_per_key, components,
            with_commas(curve.times.size() * values_per_key * components), with_commas(curve.values.size())));
    }
    return curve;
}

}  // namespace

void apply_animation(Document& document, std::vector<Node>& nodes, std::size_t animation, float time) {
    const auto& animations = document.list("animations");
    if (animation >= animations.size()) return;
    const JsonView& json = animations[animation];
    const std::string name = label("animation", animation, json);
    const std::vector<JsonView> samplers = json.list("samplers");
    const std::vector<JsonView> channels = json.list("channels");
    for (std::size_t index = 0; index < channels.size(); ++index) {
        const std::string element = fmt::format("{}, channel {}", name, index);
        const JsonView target = channels[index].at("target");
        const auto node_index = target.find_index("node", nodes.size(), "node");
        const std::string path = target.text("path");
        if (!node_index) continue;  // Extensions may animate other things; glTF says to skip such channels.
        const JsonView& sampler =
            samplers[channels[index].index("sampler", samplers.size(), "sampler of its animation")];

        std::size_t components = 0;
        if (path == "translation" || path == "scale") {
            components = 3;
        } else if (path == "rotation") {
            components = 4;
        } else if (path == "weights") {
            components = morph_target_count(document, *node_index);
        }
        if (components == 0) {
            document.warnings().add(fmt::format(
                "{}: its target '{}' is not known or has nothing to move; it was left out", element, printable(path)));
            continue;
        }
        const std::vector<float> value =
            evaluate(read_curve(document, sampler, element, components, path == "rotation"), time);
        if (!std::all_of(value.begin(), value.end(), [](float v) { return std::isfinite(v); })) {
            document.warnings().add(element + ": its value is not a finite number and was left out");
            continue;
        }
        Node& node = nodes[*node_index];
        if (path == "translation") {
            node.translation = {value[0], value[1], value[2]};
        } else if (path == "scale") {
            node.scale = {value[0], value[1], value[2]};
        } else if (path == "rotation") {
            node.rotation = unit_quaternion({value[0], value[1], value[2], value[3]});
        } else {
            node.weights = value;
            node.has_weights = true;
        }
    }
}

}  // namespace nacre::scene::gltf
