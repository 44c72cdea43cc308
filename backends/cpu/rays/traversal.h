// SPDX-License-Identifier: Apache-2.0
#pragma once

struct RTCGeometryTy;

namespace nacre::cpu {

/// Makes the hits of a geometry candidates of the queries that meet it, instead of hits at once.
void set_candidate_filter(RTCGeometryTy* geometry);

}  // namespace nacre::cpu
