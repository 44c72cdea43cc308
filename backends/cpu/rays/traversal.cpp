// SPDX-License-Identifier: Apache-2.0
// How queries meet the scene. Lanes go one of three ways:
// - Where every hit counts at once, one packet of Embree on the query's own memory.
// - Where some geometry is not opaque, one packet whose filter collects candidates by the way and lets the ray go on;
// the shader then
//   gets them by rising distance. Of the candidates of a lane only the nearest `kept_candidates` have room.
// - Where that room was too small, there are boxes, or a ray or instance overrules opacity or culls, one ray at a time
// with a filter for all geometry.
//   It begins behind the last candidate that the shader saw. A single ray gives a triangle the same distance each time,
//   a packet may not, so what is found here is in one order: that of (distance, instance, geometry, primitive).
#include "backends/cpu/rays/traversal.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>

#include "backends/cpu/rays/embree.h"
#include "backends/cpu/rays/ray_scene.h"

namespace nacre::cpu {
namespace {

constexpr std::uint32_t flags_against_packets =
    ray_no_opaque | ray_cull_back_facing | ray_cull_front_facing | ray_cull_opaque | ray_cull_no_opaque;

/// Calls `body` for each lane of a mask, from the lowest.
template <typename Body>
void for_each_lane(std::uint32_t lanes, Body&& body) {
    for (; lanes != 0; lanes &= lanes - 1) body(static_cast<std::uint32_t>(std::countr_zero(lanes)));
}

auto order_of(const RayCandidate& c) { return std::tuple(c.t, c.instance, c.geometry, c.primitive); }

enum class Kept { yes, twice, no_room };

/// Puts a candidate into its place of a list of rising order; where the list is full, the last one falls out.
Kept keep(RayCandidate* list, std::uint32_t& count, const RayCandidate& candidate) {
    std::uint32_t at = count;
    while (at > 0 && order_of(candidate) < order_of(list[at - 1])) --at;
    if (at > 0 && order_of(list[at - 1]) == order_of(candidate)) return Kept::twice;
    if (at == kept_candidates) return Kept::no_room;
    const bool is_full = count == kept_candidates;
    for (std::uint32_t i = is_full ? count - 1 : count; i > at; --i) list[i] = list[i - 1];
    list[at] = candidate;
    if (is_full) return Kept::no_room;
    ++count;
    return Kept::yes;
}

/// A call of Embree, for filters.
struct Call : embree::CallContext {
    enum class Way { all_count, packet, single };
    Call(Way how, bool is_coherent, const RayScene& traced, RayQueryLanes& query_, embree::Filter filter = nullptr)
        : CallContext(is_coherent, traced.only_instance(), filter), way(how), scene(traced), query(query_) {}
    Way way;
    const RayScene& scene;
    RayQueryLanes& query;
    // Single rays.
    std::uint32_t lane = 0;
    bool has_last = false;
    RayCandidate last{};  ///< Candidates up to this one were seen.
};

RayCandidate candidate_of(const RTCFilterFunctionNArguments& arguments, unsigned i) {
    RTCHitN* hit = arguments.hit;
    const unsigned n = arguments.N;
    return {RTCRayN_tfar(arguments.ray, n, i),
            RTCHitN_u(hit, n, i),
            RTCHitN_v(hit, n, i),
            RTCHitN_primID(hit, n, i),
            RTCHitN_geomID(hit, n, i),
            RTCHitN_instID(hit, n, i, 0),
            0,
            {RTCHitN_Ng_x(hit, n, i), RTCHitN_Ng_y(hit, n, i), RTCHitN_Ng_z(hit, n, i)}};
}

/// Of geometry that is not opaque. Packets may come as single rays, so lanes are told by their numbers.
void collect(const RTCFilterFunctionNArguments* arguments) {
    auto& call = static_cast<Call&>(embree::context_of(*arguments));
    if (call.way != Call::Way::packet) return;
    for (unsigned i = 0; i < arguments->N; ++i) {
        if (arguments->valid[i] == 0) continue;
        const std::uint32_t lane = RTCRayN_id(arguments->ray, arguments->N, i);
        if (lane >= max_lanes) continue;
        if (keep(call.query.candidates[lane], call.query.candidate_count[lane], candidate_of(*arguments, i)) ==
            Kept::no_room)
            call.query.has_more[lane] = 1;
        arguments->valid[i] = 0;
    }
}

/// Whether a hit counts at once, all things considered.
bool counts_at_once(const RayInstance& instance, std::uint32_t geometry, std::uint32_t ray_flags) {
    if (ray_flags & ray_opaque) return true;
    if (ray_flags & ray_no_opaque) return false;
    if (has_any(instance.flags, rhi::InstanceFlags::force_opaque)) return true;
    if (has_any(instance.flags, rhi::InstanceFlags::force_no_opaque)) return false;
    return instance.mesh->is_opaque(geometry);
}

/// Whether a ray passes by what is opaque, or by what is not.
bool culls(std::uint32_t ray_flags, bool is_opaque) {
    return (ray_flags & (is_opaque ? ray_cull_opaque : ray_cull_no_opaque)) != 0;
}

/// Keeps a candidate of a single ray, unless it was seen before.
void keep_single(Call& call, const RayCandidate& candidate) {
    if (call.has_last && order_of(candidate) <= order_of(call.last)) return;
    RayQueryLanes& query = call.query;
    if (keep(query.candidates[call.lane], query.candidate_count[call.lane], candidate) == Kept::no_room)
        query.has_more[call.lane] = 1;
}

/// Of all triangles, for a single ray.
void judge(const RTCFilterFunctionNArguments* arguments) {
    auto& call = static_cast<Call&>(embree::context_of(*arguments));
    const std::uint32_t ray_flags = call.query.flags[call.lane];
    for (unsigned i = 0; i < arguments->N; ++i) {
        if (arguments->valid[i] == 0) continue;
        const RayCandidate candidate = candidate_of(*arguments, i);
        const RayInstance& instance = call.scene.instances()[candidate.instance];
        const bool is_opaque = counts_at_once(instance, candidate.geometry, ray_flags);
        bool is_culled = culls(ray_flags, is_opaque) || (ray_flags & ray_skip_triangles) != 0;
        if ((ray_flags & (ray_cull_back_facing | ray_cull_front_facing)) != 0 &&
            !has_any(instance.flags, rhi::InstanceFlags::disable_culling)) {
            // The ray that a filter sees is in the space of the object, as the normal is.
            const float cosine = RTCRayN_dir_x(arguments->ray, arguments->N, i) * candidate.normal[0] +
                                 RTCRayN_dir_y(arguments->ray, arguments->N, i) * candidate.normal[1] +
                                 RTCRayN_dir_z(arguments->ray, arguments->N, i) * candidate.normal[2];
            const bool is_front = (cosine < 0) != has_any(instance.flags, rhi::InstanceFlags::flip_facing);
            is_culled = is_culled || (ray_flags & (is_front ? ray_cull_front_facing : ray_cull_back_facing)) != 0;
        }
        if (is_culled) {
            arguments->valid[i] = 0;
            continue;
        }
        if (is_opaque) continue;
        keep_single(call, candidate);
        arguments->valid[i] = 0;
    }
}

void bound_box(const RTCBoundsFunctionArguments* arguments) {
    const auto& all = *static_cast<const RayBoxes*>(arguments->geometryUserPtr);
    const RayBoxes::Box& box = all.boxes[arguments->primID];
    const bool is_usable = box.is_usable();
    const float* lower = is_usable ? box.lower : all.stand_in.data();
    const float* upper = is_usable ? box.upper : all.stand_in.data();
    RTCBounds& bounds = *arguments->bounds_o;
    bounds.lower_x = lower[0], bounds.lower_y = lower[1], bounds.lower_z = lower[2];
    bounds.upper_x = upper[0], bounds.upper_y = upper[1], bounds.upper_z = upper[2];
}

/// A box that a ray may go through. It shortens no ray: where its hit lies, the shader says.
void meet_box(const RTCIntersectFunctionNArguments* arguments) {
    auto& call = static_cast<Call&>(embree::context_of(*arguments));
    if (call.way != Call::Way::single || arguments->N != 1 || arguments->valid[0] == 0) return;
    const RayBoxes::Box& box = static_cast<const RayBoxes*>(arguments->geometryUserPtr)->boxes[arguments->primID];
    const std::uint32_t ray_flags = call.query.flags[call.lane], instance = embree::instance_of(*arguments);
    if (!box.is_usable() || (ray_flags & ray_skip_boxes) || instance >= call.scene.instances().size()) return;
    const bool is_opaque = counts_at_once(call.scene.instances()[instance], arguments->geomID, ray_flags);
    if (culls(ray_flags, is_opaque)) return;
    RTCRayN* ray = RTCRayHitN_RayN(arguments->rayhit, 1);
    const float origin[3] = {RTCRayN_org_x(ray, 1, 0), RTCRayN_org_y(ray, 1, 0), RTCRayN_org_z(ray, 1, 0)};
    const float direction[3] = {RTCRayN_dir_x(ray, 1, 0), RTCRayN_dir_y(ray, 1, 0), RTCRayN_dir_z(ray, 1, 0)};
    // From where the query begins, not the ray, which may begin behind what was seen: a box must come at the same
    // distance each time.
    float enters = call.query.t_min[call.lane], leaves = RTCRayN_tfar(ray, 1, 0);
    constexpr float rounding = 4 * std::numeric_limits<float>::epsilon();
    for (int axis = 0; axis < 3; ++axis) {
        if (direction[axis] == 0) {
            if (origin[axis] < box.lower[axis] || origin[axis] > box.upper[axis]) return;
            continue;
        }
        const float a = (box.lower[axis] - origin[axis]) / direction[axis],
                    b = (box.upper[axis] - origin[axis]) / direction[axis];
        const float near = std::min(a, b), far = std::max(a, b);
        enters = std::max(enters, near - std::abs(near) * rounding);
        leaves = std::min(leaves, far + std::abs(far) * rounding);
    }
    if (!(enters <= leaves)) return;
    keep_single(call, {.t = enters,
                       .u = 0,
                       .v = 0,
                       .primitive = arguments->primID,
                       .geometry = arguments->geomID,
                       .instance = instance,
                       .kind = ray_candidate_box | (is_opaque ? std::uint32_t{ray_candidate_opaque} : 0),
                       .normal = {}});
}

/// Rays that only ask whether there is a hit pass through boxes; those that may meet some take another way.
void ignore_box(const RTCOccludedFunctionNArguments*) {}

/// Lanes as Embree takes them.
struct alignas(64) ValidLanes {
    explicit ValidLanes(std::uint32_t lanes) {
        // Compared with single bits, which vectorizes without shifts.
        constexpr auto bits = [] {
            std::array<std::uint32_t, max_lanes> result{};
            for (std::uint32_t i = 0; i < max_lanes; ++i) result[i] = 1u << i;
            return result;
        }();
        for (std::uint32_t i = 0; i < max_lanes; ++i) words[i] = (lanes & bits[i]) == bits[i] ? -1 : 0;
    }
    int words[max_lanes];
};

/// Copies of rays and hits in packets that the machine has natively.
template <typename Packet, std::uint32_t width>
void intersect_parts(RTCScene scene, embree::CallContext& call, RTCRayHit16& rays, std::uint32_t lanes) {
    constexpr std::size_t rows = sizeof(RTCRayHit16) / sizeof(float) / 16;
    static_assert(sizeof(Packet) == rows * width * sizeof(float));
    for (std::uint32_t first = 0; first < 16; first += width) {
        const std::uint32_t part_lanes = lanes >> first & ((1u << width) - 1);
        if (part_lanes == 0) continue;
        Packet part;
        alignas(64) int valid[width];
        for (std::uint32_t i = 0; i < width; ++i) valid[i] = part_lanes >> i & 1 ? -1 : 0;
        auto* to = reinterpret_cast<std::byte*>(&part);
        auto* from = reinterpret_cast<std::byte*>(&rays) + first * sizeof(float);
        for (std::size_t row = 0; row < rows; ++row)
            std::memcpy(to + row * width * sizeof(float), from + row * 16 * sizeof(float), width * sizeof(float));
        embree::intersect(scene, call, valid, part);
        for (std::size_t row = 0; row < rows; ++row)
            std::memcpy(from + row * 16 * sizeof(float), to + row * width * sizeof(float), width * sizeof(float));
    }
}

RTCRayHit single_ray(const RTCRayHit16& rays, std::uint32_t lane) {
    RTCRayHit ray;
    ray.ray = rtcGetRayFromRayN(reinterpret_cast<RTCRayN*>(const_cast<RTCRay16*>(&rays.ray)), 16, lane);
    ray.hit.geomID = ray.hit.primID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    return ray;
}

void put_single_hit(RTCRayHit16& rays, std::uint32_t lane, const RTCRayHit& ray) {
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
    rays.ray.tfar[lane] = ray.ray.tfar;
    rays.hit.Ng_x[lane] = ray.hit.Ng_x, rays.hit.Ng_y[lane] = ray.hit.Ng_y, rays.hit.Ng_z[lane] = ray.hit.Ng_z;
    rays.hit.u[lane] = ray.hit.u, rays.hit.v[lane] = ray.hit.v;
    rays.hit.primID[lane] = ray.hit.primID;
    rays.hit.geomID[lane] = ray.hit.geomID;
    rays.hit.instID[0][lane] = ray.hit.instID[0];
}

RTCRayHit16& rays_of(RayQueryLanes& query) { return reinterpret_cast<RTCRayHit16&>(query); }

/// Traces a packet in place.
void intersect_lanes(const RayScene& scene, Call& call, RayQueryLanes& query, std::uint32_t lanes) {
    RTCRayHit16& rays = rays_of(query);
    if (std::has_single_bit(lanes)) {
        // A fifth faster than a packet with one ray.
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
        RTCRayHit ray = single_ray(rays, lane);
        embree::intersect(scene.scene(), call, ray);
        return put_single_hit(rays, lane, ray);
    }
    switch (scene.packet_width()) {
        case 16: return embree::intersect(scene.scene(), call, ValidLanes(lanes).words, rays);
        case 8: return intersect_parts<RTCRayHit8, 8>(scene.scene(), call, rays, lanes);
        default: return intersect_parts<RTCRayHit4, 4>(scene.scene(), call, rays, lanes);
    }
}

/// Traces rays of which nothing is asked but whether they hit.
void find_whether_hit(const RayScene& scene, Call& call, RayQueryLanes& query, std::uint32_t lanes) {
    RTCRay16& rays = rays_of(query).ray;
    if (std::has_single_bit(lanes) || scene.packet_width() != 16) {
        for_each_lane(lanes, [&](std::uint32_t lane) {
            RTCRay ray = rtcGetRayFromRayN(reinterpret_cast<RTCRayN*>(&rays), 16, lane);
            embree::occluded(scene.scene(), call, ray);
            query.t[lane] = ray.tfar;
        });
    } else {
        embree::occluded(scene.scene(), call, ValidLanes(lanes).words, rays);
    }
    // Rays end at minus infinity where they hit, now or earlier; nothing else asks for their lengths.
    for (std::uint32_t i = 0; i < max_lanes; ++i) query.geometry[i] = query.t[i] < 0 ? 0 : query.geometry[i];
}

/// The long way for one lane, from behind `last` where there is one.
void judge_lane(const RayScene& scene, RayQueryLanes& query, std::uint32_t lane, const RayCandidate* last) {
    Call call(Call::Way::single, false, scene, query, judge);
    call.lane = lane;
    query.candidate_count[lane] = query.next_candidate[lane] = query.has_more[lane] = 0;
    RTCRayHit ray = single_ray(rays_of(query), lane);
    if (last) {
        call.has_last = true;
        call.last = *last;
        ray.ray.tnear = std::max(ray.ray.tnear, std::nextafter(last->t, 0.0f));
    }
    embree::intersect(scene.scene(), call, ray);
    put_single_hit(rays_of(query), lane, ray);
}

/// Steps to the next candidate of a lane that is nearer than what is committed; false where there is none.
bool next_candidate(RayQueryLanes& query, std::uint32_t lane) {
    if (query.next_candidate[lane] >= query.candidate_count[lane]) return false;
    const RayCandidate& candidate = query.candidates[lane][query.next_candidate[lane]];
    if (!(candidate.t < query.t[lane])) {
        // Neither this one nor those behind it count, nor what had no room.
        query.has_more[lane] = 0;
        query.candidate_count[lane] = 0;
        return false;
    }
    ++query.next_candidate[lane];
    query.candidate_t[lane] = candidate.t;
    query.candidate_u[lane] = candidate.u, query.candidate_v[lane] = candidate.v;
    for (int axis = 0; axis < 3; ++axis) query.candidate_normal[axis][lane] = candidate.normal[axis];
    query.candidate_primitive[lane] = candidate.primitive;
    query.candidate_geometry[lane] = candidate.geometry;
    query.candidate_instance[lane] = candidate.instance;
    query.candidate_kind[lane] = candidate.kind;
    return true;
}

/// Where every hit counts at once.
void find_hits(const RayScene& scene, RayQueryLanes& query, std::uint32_t lanes, std::uint32_t hints, float spread2) {
    const bool is_coherent = (hints & ray_similar_directions) != 0 && spread2 <= scene.coherent_spread2();
    Call call(Call::Way::all_count, is_coherent, scene, query);
    const bool asks_only_whether_hit = (hints & ray_only_whether_hit) != 0 && (hints & ray_all_terminate) != 0;
    if (hints & ray_one_by_one) {
        for_each_lane(lanes, [&](std::uint32_t lane) { intersect_lanes(scene, call, query, 1u << lane); });
    } else if (asks_only_whether_hit) {
        find_whether_hit(scene, call, query, lanes);
    } else {
        intersect_lanes(scene, call, query, lanes);
    }
}

/// First traversal of lanes of one scene; returns those that may have candidates.
std::uint32_t traverse(const RayScene& scene, RayQueryLanes& query, std::uint32_t lanes, std::uint32_t hints,
                       float spread2) {
    const std::uint32_t flags_of_any = hints >> ray_flags_shift;
    const bool has_candidates = scene.has_candidates(), has_overrides = scene.has_overrides(),
               has_boxes = scene.has_boxes();
    if (!has_boxes && (flags_of_any & (flags_against_packets | ray_skip_triangles)) == 0 &&
        ((hints & ray_all_opaque) != 0 || (!has_candidates && !has_overrides))) {
        find_hits(scene, query, lanes, hints, spread2);
        return 0;
    }
    std::uint32_t at_once = 0, collecting = 0, single = 0, asking = 0;
    for_each_lane(lanes, [&](std::uint32_t lane) {
        const std::uint32_t flags = query.flags[lane], bit = 1u << lane;
        query.candidate_count[lane] = query.next_candidate[lane] = query.has_more[lane] = 0;
        const bool meets_boxes = has_boxes && (flags & ray_skip_boxes) == 0;
        if ((flags & ray_skip_triangles) && !meets_boxes) return;
        if (meets_boxes || (flags & flags_against_packets))
            single |= bit;
        else if ((flags & ray_opaque) || (!has_candidates && !has_overrides))
            at_once |= bit;
        else if (has_overrides || (hints & ray_one_by_one))
            single |= bit;
        else
            collecting |= bit;
        // Only where some geometry, instance or ray asks for it are there lists to look into.
        if (meets_boxes || (flags & ray_no_opaque) || (has_candidates && (flags & ray_opaque) == 0)) asking |= bit;
    });
    if (at_once) find_hits(scene, query, at_once, hints, spread2);
    if (collecting) {
        // Candidates do not shorten a ray, so the nearest ones of all are kept; what follows is found by single rays.
        const bool is_coherent = (hints & ray_similar_directions) != 0 && spread2 <= scene.coherent_spread2();
        Call call(Call::Way::packet, is_coherent, scene, query);
        intersect_lanes(scene, call, query, collecting);
    }
    for_each_lane(single, [&](std::uint32_t lane) { judge_lane(scene, query, lane, nullptr); });
    return asking;
}

std::uint32_t proceed(RayQueryLanes* query_pointer, std::uint32_t fresh, std::uint32_t waiting, std::uint32_t hints,
                      float spread2) {
    RayQueryLanes& query = *query_pointer;
    while (fresh != 0) {
        const RayScene* scene = query.scene[std::countr_zero(fresh)];
        std::uint32_t same = fresh;
        if ((hints & ray_one_scene) == 0) {
            same = 0;
            for_each_lane(fresh,
                          [&](std::uint32_t lane) { same |= std::uint32_t{query.scene[lane] == scene} << lane; });
        }
        fresh &= ~same;
        if (scene && scene->scene()) waiting |= traverse(*scene, query, same, hints, spread2);
    }
    std::uint32_t result = 0;
    for_each_lane(waiting, [&](std::uint32_t lane) {
        bool has_next = next_candidate(query, lane);
        while (!has_next && query.has_more[lane] != 0) {
            const RayCandidate last = query.candidates[lane][query.candidate_count[lane] - 1];
            judge_lane(*query.scene[lane], query, lane, &last);
            has_next = next_candidate(query, lane);
        }
        if (has_next) result |= 1u << lane;
    });
    return result;
}

/// Takes the candidate of a lane as the committed hit.
void commit(RayQueryLanes& query, std::uint32_t lane, float t, std::uint32_t kind) {
    query.t[lane] = t;
    query.u[lane] = query.candidate_u[lane], query.v[lane] = query.candidate_v[lane];
    for (int axis = 0; axis < 3; ++axis) query.normal[axis][lane] = query.candidate_normal[axis][lane];
    query.primitive[lane] = query.candidate_primitive[lane];
    query.geometry[lane] = query.candidate_geometry[lane];
    query.instance[lane] = query.candidate_instance[lane];
    query.kind[lane] = kind;
    if (query.flags[lane] & ray_terminate_on_first_hit)
        query.status[lane] = static_cast<std::uint32_t>(RayStatus::finished);
}

bool is_at(const RayQueryLanes& query, std::uint32_t lane, bool box) {
    return query.status[lane] == static_cast<std::uint32_t>(RayStatus::waiting) &&
           ((query.candidate_kind[lane] & ray_candidate_box) != 0) == box;
}

void confirm(RayQueryLanes* query, std::uint32_t live) {
    for_each_lane(live, [&](std::uint32_t lane) {
        if (is_at(*query, lane, false)) commit(*query, lane, query->candidate_t[lane], 1);
    });
}

void generate(RayQueryLanes* query, std::uint32_t live, const float* t) {
    for_each_lane(live, [&](std::uint32_t lane) {
        // What lies beyond the ray is no hit of it.
        if (is_at(*query, lane, true) && t[lane] >= query->t_min[lane] && t[lane] <= query->t[lane])
            commit(*query, lane, t[lane], 2);
    });
}

}  // namespace

void set_candidate_filter(RTCGeometryTy* geometry) {
    rtcSetGeometryIntersectFilterFunction(geometry, collect);
    rtcSetGeometryOccludedFilterFunction(geometry, collect);
}

void set_boxes(RTCGeometryTy* geometry, RayBoxes& boxes) {
    rtcSetGeometryUserData(geometry, &boxes);
    rtcSetGeometryBoundsFunction(geometry, bound_box, nullptr);
    rtcSetGeometryIntersectFunction(geometry, meet_box);
    rtcSetGeometryOccludedFunction(geometry, ignore_box);
}

RayProceedFunction ray_proceed_function() { return proceed; }
RayConfirmFunction ray_confirm_function() { return confirm; }
RayGenerateFunction ray_generate_function() { return generate; }

}  // namespace nacre::cpu
