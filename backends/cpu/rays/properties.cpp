// SPDX-License-Identifier: Apache-2.0
// What shaders ask of an intersection beyond what a query keeps.
#include <bit>
#include <cstring>

#include "backends/cpu/rays/ray_query.h"
#include "backends/cpu/rays/ray_scene.h"

namespace nacre::cpu {
namespace {

/// Three rows of four times a point (`w` 1) or direction (`w` 0).
void transform(const std::array<float, 12>& matrix, const float (&vector)[3], float w, float (&result)[3]) {
    for (std::size_t row = 0; row < 3; ++row)
        result[row] = matrix[row * 4] * vector[0] + matrix[row * 4 + 1] * vector[1] + matrix[row * 4 + 2] * vector[2] +
                      matrix[row * 4 + 3] * w;
}

void find_property(const RayQueryLanes* query_pointer, std::uint32_t wanted, std::uint32_t live,
                   std::uint32_t* result) {
    const RayQueryLanes& query = *query_pointer;
    const bool is_committed = (wanted & ray_property_committed) != 0;
    const auto property = static_cast<RayProperty>(wanted & ~ray_property_committed);
    const auto put = [&](std::uint32_t word, std::uint32_t lane, const auto& value) {
        static_assert(sizeof value == 4);
        std::memcpy(result + word * max_lanes + lane, &value, 4);
    };
    std::uint32_t words = 1;
    if (property == RayProperty::object_origin || property == RayProperty::object_direction) words = 3;
    if (property == RayProperty::object_to_world || property == RayProperty::world_to_object) words = 12;
    std::memset(result, 0, words * max_lanes * sizeof(std::uint32_t));
    for (; live != 0; live &= live - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(live));
        const auto status = static_cast<RayStatus>(query.status[lane]);
        const bool has_hit = is_committed ? status != RayStatus::none && query.geometry[lane] != no_hit
                                          : status == RayStatus::waiting;
        if (!has_hit || !query.scene[lane]) continue;
        const std::uint32_t number = (is_committed ? query.instance : query.candidate_instance)[lane];
        const auto& instances = query.scene[lane]->instances();
        if (number >= instances.size()) continue;
        const RayInstance& instance = instances[number];
        const float origin[3] = {query.origin[0][lane], query.origin[1][lane], query.origin[2][lane]};
        const float direction[3] = {query.direction[0][lane], query.direction[1][lane], query.direction[2][lane]};
        float vector[3];
        switch (property) {
            case RayProperty::custom_index: put(0, lane, instance.custom_index); break;
            case RayProperty::table_offset: put(0, lane, instance.table_offset); break;
            case RayProperty::front_face: {
                const auto& normal = is_committed ? query.normal : query.candidate_normal;
                transform(instance.to_object, direction, 0.0f, vector);
                const float cosine =
                    vector[0] * normal[0][lane] + vector[1] * normal[1][lane] + vector[2] * normal[2][lane];
                put(0, lane, std::uint32_t{(cosine < 0) != has_any(instance.flags, rhi::InstanceFlags::flip_facing)});
                break;
            }
            case RayProperty::object_origin:
            case RayProperty::object_direction:
                if (property == RayProperty::object_origin) transform(instance.to_object, origin, 1.0f, vector);
                else transform(instance.to_object, direction, 0.0f, vector);
                for (std::uint32_t i = 0; i < 3; ++i) put(i, lane, vector[i]);
                break;
            case RayProperty::object_to_world:
            case RayProperty::world_to_object: {
                const auto& matrix = property == RayProperty::object_to_world ? instance.to_world : instance.to_object;
                for (std::uint32_t column = 0; column < 4; ++column)
                    for (std::uint32_t row = 0; row < 3; ++row) put(column * 3 + row, lane, matrix[row * 4 + column]);
                break;
            }
        }
    }
}

}  // namespace

RayPropertyFunction ray_property_function() { return find_property; }

}  // namespace nacre::cpu
