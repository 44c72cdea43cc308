// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <cstddef>
#include <cstdint>

#include "backends/cpu/rays/ray_query.h"

/// @file
/// All that differs between versions of Embree. This is version 3; version 4 takes the filter and the flags of a call
/// as RTCIntersectArguments instead of members of a context, and needs no more than another body for these functions.

namespace nacre::cpu::embree {

static_assert(offsetof(RTCRayHit16, ray.tfar) == offsetof(RayQueryLanes, t));
static_assert(offsetof(RTCRayHit16, ray.mask) == offsetof(RayQueryLanes, cull_mask));
static_assert(offsetof(RTCRayHit16, ray.id) == offsetof(RayQueryLanes, id));
static_assert(offsetof(RTCRayHit16, hit.Ng_x) == offsetof(RayQueryLanes, normal));
static_assert(offsetof(RTCRayHit16, hit.geomID) == offsetof(RayQueryLanes, geometry));
static_assert(offsetof(RTCRayHit16, hit.instID) == offsetof(RayQueryLanes, instance));
static_assert(sizeof(RTCRayHit16) == offsetof(RayQueryLanes, scene) && RTC_MAX_INSTANCE_LEVEL_COUNT == 1);

using Filter = RTCFilterFunctionN;

/// What goes with a call and comes back to filters; derived classes add to it.
struct CallContext {
    RTCIntersectContext context;

    /// @param is_coherent  the rays of a packet go about the same way
    /// @param instance     what hits get as instance that are in none
    /// @param filter       called for each hit of any geometry, or null
    CallContext(bool is_coherent, unsigned instance, Filter filter = nullptr) {
        rtcInitIntersectContext(&context);
        context.instID[0] = instance;
        context.flags = is_coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
        context.filter = filter;
    }
};

/// The context of the call that a filter was called by.
inline CallContext& context_of(const RTCFilterFunctionNArguments& arguments) {
    return *reinterpret_cast<CallContext*>(arguments.context);
}

/// The context of the call that meets a geometry of the program's own.
inline CallContext& context_of(const RTCIntersectFunctionNArguments& arguments) {
    return *reinterpret_cast<CallContext*>(arguments.context);
}
/// The instance that such a geometry is met in.
inline unsigned instance_of(const RTCIntersectFunctionNArguments& arguments) { return arguments.context->instID[0]; }

inline void intersect(RTCScene scene, CallContext& call, RTCRayHit& ray) { rtcIntersect1(scene, &call.context, &ray); }
inline void intersect(RTCScene scene, CallContext& call, const int* valid, RTCRayHit4& rays) {
    rtcIntersect4(valid, scene, &call.context, &rays);
}
inline void intersect(RTCScene scene, CallContext& call, const int* valid, RTCRayHit8& rays) {
    rtcIntersect8(valid, scene, &call.context, &rays);
}
inline void intersect(RTCScene scene, CallContext& call, const int* valid, RTCRayHit16& rays) {
    rtcIntersect16(valid, scene, &call.context, &rays);
}
inline void occluded(RTCScene scene, CallContext& call, RTCRay& ray) { rtcOccluded1(scene, &call.context, &ray); }
inline void occluded(RTCScene scene, CallContext& call, const int* valid, RTCRay16& rays) {
    rtcOccluded16(valid, scene, &call.context, &rays);
}

/// Makes filters of calls possible; without it they are not called, and Embree may stop the program.
inline constexpr RTCSceneFlags filtered_scene = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;

}  // namespace nacre::cpu::embree
