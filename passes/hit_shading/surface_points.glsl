// SPDX-License-Identifier: Apache-2.0
// Writes down what the rasterizer interpolates at each pixel, for passes/hit_shading/hit_shading.comp. The camera's depth has
// decided what is seen.
layout(early_fragment_tests) in;
#define READS_POSITION
#include "passes/shared/fragment_inputs.glsl"
#include "passes/hit_shading/surface_point.glsl"

layout(set = 0, binding = 1, std430) writeonly buffer SurfacePoints { SurfacePoint points[]; };
#ifndef MATERIAL_BLOCK_BINDING
#define MATERIAL_BLOCK_BINDING 0
#endif
layout(set = 1, binding = MATERIAL_BLOCK_BINDING, std140) uniform MaterialBlock { uvec4 rows[8]; } material_block;

void main() {
    SurfacePoint point;
    uint attributes = 0u;
    point.normal = point.tangent = point.uv = point.uv0_gradients = point.uv1_gradients = vec4(0.0);
    point.color = vec4(1.0);
    point.position = vec4(in_position, 0.0);
#ifdef HAS_NORMALS
    attributes |= 1u;
    point.normal = vec4(in_normal, 0.0);
#endif
#ifdef HAS_TANGENTS
    attributes |= 2u;
    point.tangent = in_tangent;
#endif
#ifdef HAS_UV0
    attributes |= 4u;
    point.uv.xy = in_uv0;
    point.uv0_gradients = vec4(dFdx(in_uv0), dFdy(in_uv0));
#endif
#ifdef HAS_UV1
    attributes |= 8u;
    point.uv.zw = in_uv1;
    point.uv1_gradients = vec4(dFdx(in_uv1), dFdy(in_uv1));
#endif
#ifdef HAS_COLORS
    attributes |= 16u;
    point.color = in_color;
#endif
    if (!gl_FrontFacing) attributes |= 32u;
    point.ids = uvec4(material_block.rows[0].w >> 16u, attributes, 0u, 0u);
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    points[pixel.y * uint(PICTURE_WIDTH) + pixel.x] = point;
}
