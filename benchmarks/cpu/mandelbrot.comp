// SPDX-License-Identifier: Apache-2.0
#version 460
// Escape times of the Mandelbrot set, up to 1000 steps: neighbors leave the loop at very different times near the border.
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) writeonly buffer Steps { uint steps[]; };

const uvec2 size = uvec2(1920u, 1080u);

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= size.x || pixel.y >= size.y) return;
    vec2 c = vec2(-2.2, -1.1) + vec2(pixel) * (2.2 / 1080.0);
    vec2 z = vec2(0.0);
    uint count = 0u;
    while (count < 1000u && dot(z, z) <= 4.0) {
        z = vec2(z.x * z.x - z.y * z.y, 2.0 * z.x * z.y) + c;
        ++count;
    }
    steps[pixel.y * size.x + pixel.x] = count;
}
