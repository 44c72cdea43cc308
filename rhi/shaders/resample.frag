// SPDX-License-Identifier: Apache-2.0
#version 460
// Draws one mip of a texture over a target of another size or format.

layout(set = 0, binding = 0) uniform sampler2D source;
layout(push_constant) uniform Parameters {
    float lod;
} parameters;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;

void main() {
    color = textureLod(source, uv, parameters.lod);
}
