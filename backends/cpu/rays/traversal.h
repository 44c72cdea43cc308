// SPDX-License-Identifier: Apache-2.0
#pragma once

struct RTCGeometryTy;

namespace nacre::cpu {

struct RayBoxes;

/// Makes the hits of a geometry candidates of the queries that meet it, instead of hits at once.
void set_candidate_filter(RTCGeometryTy* geometry);
/// Makes a geometry of Embree's kind "user" one of these boxes, which must stay where they are.
void set_boxes(RTCGeometryTy* geometry, RayBoxes& boxes);

}  // namespace nacre::cpu
