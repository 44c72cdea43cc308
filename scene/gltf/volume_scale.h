// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene.h"

namespace nacre::scene::gltf {

/// Brings the thickness of volumes from the space of their meshes to that of the world (KHR_materials_volume): where a
/// mesh is placed larger or smaller, it gets materials of its own. Scales that differ by axis count as the cube root of
/// their product; an instance with many transforms has the scale of its first.
void scale_volumes(Scene& scene);

}  // namespace nacre::scene::gltf
