// SPDX-License-Identifier: Apache-2.0
#version 460
// Lets go of what an alpha-tested material does not cover. Shadow maps use it too.
#include "passes/shared/material.glsl"

void main() {
    if (base_color().a < material_alpha_cutoff()) discard;
}
