// SPDX-License-Identifier: Apache-2.0
#include "materials/description.h"

namespace nacre::materials {

bool needs_tangents(const MaterialDescription& material) {
    return material.normal_texture.present() || material.anisotropy.has_value() ||
           (material.clearcoat && material.clearcoat->normal_texture.present());
}

}  // namespace nacre::materials
