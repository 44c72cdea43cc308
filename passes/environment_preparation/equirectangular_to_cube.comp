// SPDX-License-Identifier: Apache-2.0
#version 460
// A mip of the environment cube from an equirectangular picture with mips.
#include "materials/closures/math.glsl"
#include "passes/shared/cube.glsl"
#include "passes/shared/half.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D equirectangular;
layout(set = 0, binding = 1, rgba16f) uniform writeonly imageCube cube;
layout(set = 0, binding = 2, std140) uniform EnvironmentBlock { vec4 parameters; };  // rotation, intensity

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int size = imageSize(cube).x;
    if (texel.x >= size || texel.y >= size) return;
    vec3 direction = normalize(cube_direction(texel.z, (vec2(texel.xy) + 0.5) / float(size)));
    // The picture turns counter-clockwise seen from above: directions turn back before the look-up.
    float c = cos(parameters.x), s = sin(parameters.x);
    vec3 turned = vec3(c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z);
    // At the poles the azimuth has no meaning, and atan no value.
    float azimuth = abs(turned.x) + abs(turned.z) > 1e-6 ? atan(turned.x, -turned.z) : 0.0;
    // Near the poles the cosine has lost the angle, and arc cosines of drivers are off by up to 1.5e-4 (Mesa's).
    vec2 uv = vec2(0.5 + azimuth / (2.0 * pi), atan(length(vec2(turned.x, turned.z)), turned.y) / pi);
    // A texel of the cube covers this many of the picture; explicit, since compute shaders have no derivatives.
    float lod = max(log2(float(textureSize(equirectangular, 0).x) / float(4 * size)), 0.0);
    vec3 light = textureLod(equirectangular, uv, lod).rgb * parameters.y;
    imageStore(cube, texel, vec4(round_to_half(clamp(light, vec3(0.0), vec3(65504.0))), 1.0));
}
