// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_GLINTS
#define NACRE_CLOSURES_GLINTS
#include "materials/closures/ggx.glsl"

// A microfacet surface of which the pixel sees only some facets: the smooth lobe times (facets that reflect towards the
// view) over (how many would on average). The number of facets in a cell of the surface and a cell of slopes is drawn
// from a Poisson distribution, always the same for the same cell. So the mean over the surface is the smooth lobe
// whatever the density, and the lobe itself is the limit of many facets, for any distribution of normals. Source of the
// idea of drawing counts instead of facets: Jakob et al. 2014, "Discrete stochastic microfacet models"; Deliot and
// Belcour 2023, "Real-time rendering of glinty appearances using distributed binomial laws on anisotropic grids".

// Cells of slopes for each alpha along an axis: a facet is as flat as one of them is wide.
const float glint_slope_cells = 6.0;

uint glint_hash(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Cells have whole numbers, also far from the origin, where they repeat after a million.
uint glint_cell(float place) { return uint(place - floor(place / 1048576.0) * 1048576.0); }

// Number in [0, 1) of 24 bits.
float glint_uniform(uint x) { return float(x >> 8u) / 16777216.0; }

// A count whose mean is `mean`: by the inverse of the Poisson distribution where that is small, else by a normal one.
// Small means are all in the tail, which is counted down from above: a float near 1 would be off by 3e-8, which is all
// of the probability of a facet where few are seen at slopes far out.
float glint_count(float mean, uint seed) {
    if (mean > 20.0) {
        float radius = sqrt(-2.0 * log(1.0 - glint_uniform(seed)));
        return max(mean + sqrt(mean) * radius * cos(2.0 * pi * glint_uniform(glint_hash(seed))), 0.0);
    }
    // In the middle of its 2^-32: the mean over all seeds is that of the distribution down to means of 1e-8.
    float u = (float(seed) + 0.5) / 4294967296.0;
    float probability = exp(-mean);
    float tail = exponential_rest(mean);  // of more than `count`
    float count = 0.0;
    for (int i = 0; i < 64; ++i) {
        if (u >= tail) break;
        count += 1.0;
        probability *= mean / count;
        tail -= probability;
    }
    return count;
}

// Facets that reflect over their mean, in one cell of the surface, over the four cells of slopes around a slope.
float glint_slopes(vec2 slope, float mean, uint seed) {
    float x = floor(slope.x);
    float y = floor(slope.y);
    float part_x = slope.x - x;
    float part_y = slope.y - y;
    float sum = 0.0;
    for (int corner = 0; corner < 4; ++corner) {
        float right = float(corner & 1);
        float upper = float(corner >> 1);
        float weight = (right > 0.0 ? part_x : 1.0 - part_x) * (upper > 0.0 ? part_y : 1.0 - part_y);
        uint cell = glint_hash(glint_cell(y + upper) + glint_hash(glint_cell(x + right) + seed));
        if (weight > 0.0) sum += weight * glint_count(mean, cell);
    }
    return sum / mean;
}

// The same over the four cells around a position; level: log2 of the size of a cell.
float glint_cells(vec2 position, float level, vec2 slope, float density, float share) {
    float size = exp2(level);
    float mean = max(density * size * size * share, 1e-12);
    // So many facets are the smooth lobe.
    if (mean > 1e8) return 1.0;
    float x = position.x / size - 0.5;
    float y = position.y / size - 0.5;
    float left = floor(x);
    float lower = floor(y);
    uint seed = glint_hash(uint(level + 128.0));
    float sum = 0.0;
    for (int corner = 0; corner < 4; ++corner) {
        float right = float(corner & 1);
        float upper = float(corner >> 1);
        float weight = (right > 0.0 ? x - left : 1.0 - (x - left)) * (upper > 0.0 ? y - lower : 1.0 - (y - lower));
        uint cell = glint_hash(glint_cell(lower + upper) + glint_hash(glint_cell(left + right) + seed));
        if (weight > 0.0) sum += weight * glint_slopes(slope, mean, cell);
    }
    return sum;
}

// Factor on a lobe's value. density: facets per unit square of position; dx, dy: change of position to the next pixels.
float glint_factor(vec3 h, vec2 alpha, float density, vec2 position, vec2 dx, vec2 dy) {
    if (h.z <= 1e-4) return 1.0;
    float slope_x = h.x / (h.z * alpha.x);
    float slope_y = h.y / (h.z * alpha.y);
    // Share of the facets whose slopes lie in one cell: the density of slopes times the area of a cell.
    float stretched = 1.0 + slope_x * slope_x + slope_y * slope_y;
    float share = 1.0 / (pi * stretched * stretched * glint_slope_cells * glint_slope_cells);
    // Cells as large as the footprint, but not smaller than what holds one facet: nearer than that, a facet fills the
    // pixel.
    float footprint = abs(dx.x * dy.y - dx.y * dy.x);
    float level = 0.5 * log2(clamp(max(footprint, 1.0 / density), 1e-24, 1e24));
    float lower = floor(level);
    vec2 slope = vec2(slope_x, slope_y) * glint_slope_cells;
    return mix(glint_cells(position, lower, slope, density, share),
               glint_cells(position, lower + 1.0, slope, density, share), level - lower);
}

#endif
