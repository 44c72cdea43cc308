// SPDX-License-Identifier: Apache-2.0
#version 460
#include "passes/shared/geometry.vert.glsl"
