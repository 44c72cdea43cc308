// SPDX-License-Identifier: Apache-2.0
#version 460
#include "passes/hit_shading/surface_points.glsl"
