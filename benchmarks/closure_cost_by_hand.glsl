// SPDX-License-Identifier: Apache-2.0
// A slab without features as one would write it for a renderer that has nothing else: GGX with height-correlated Smith
// masking, Schlick's Fresnel, Turquin's compensation and the albedo of the interface by table, Chan's diffuse model
// over its albedo. What does not depend on the light is computed once and multiplied together.

struct Prepared {
    vec3 view;
    float view_length;
    float alpha2;
    vec3 f0;        // times compensation and 1 / (2 pi)
    vec3 rise;      // F90 - F0, times the same
    vec3 diffuse;
    vec3 chan;      // rough, glossy and retro-reflective part
    float sharpness;
};

const float one_over_pi = 0.31830988618;

float fifth_power(float x) {
    float x2 = x * x;
    return x2 * x2 * x;
}

vec4 table_entry(int index) {
    return vec4(unpackUnorm2x16(interface_words[2 * index]), unpackUnorm2x16(interface_words[2 * index + 1]));
}

vec4 table_at(float column, float row) {
    vec2 place = clamp(vec2(column, row), vec2(0.0), vec2(1.0)) * vec2(63.0, 95.0);
    ivec2 entry = min(ivec2(place), ivec2(62, 94));
    vec2 part = place - vec2(entry);
    int index = entry.y * 64 + entry.x;
    return mix(mix(table_entry(index), table_entry(index + 1), part.x),
               mix(table_entry(index + 64), table_entry(index + 65), part.x), part.y);
}

Prepared prepare(vec3 f0, float roughness, vec3 albedo, vec3 view) {
    Prepared p;
    float alpha = roughness * roughness;
    bool is_mirror = alpha < 1e-4;
    alpha = clamp(alpha, 1e-4, 1.0);
    float cosine = clamp(view.z, 1e-8, 1.0);
    p.view = vec3(view.xy, max(view.z, 1e-8));
    p.alpha2 = alpha * alpha;
    p.view_length = sqrt(p.alpha2 * dot(view.xy, view.xy) + p.view.z * p.view.z);

    // Albedo of the interface.
    float f90 = clamp(max(f0.r, max(f0.g, f0.b)) * 50.0, 0.0, 1.0);
    vec4 entry = table_at(sqrt(cosine * (1.0 + 3.0 * alpha) / (cosine + 3.0 * alpha)), sqrt(alpha));
    float missing = entry.x;
    float typical = min(sqrt(cosine * cosine + 10.0 * p.alpha2), 1.0);
    float schlick = clamp(fifth_power(1.0 - typical) + (entry.y - 0.25) * 0.5, 0.0, 1.0);
    vec3 mean = f0 + (f90 - f0) * (1.0 / 21.0);
    vec3 single = f0 + (f90 - f0) * schlick;
    vec3 scale = 1.0 + mean * (missing / (1.0 - missing));
    vec3 reflected = single * (1.0 - missing) * scale;
    if (is_mirror) {
        reflected = f0 + (f90 - f0) * fifth_power(1.0 - cosine);
        scale = vec3(0.0);
    }
    scale *= 0.5 * one_over_pi;
    p.f0 = f0 * scale;
    p.rise = (f90 - f0) * scale;

    // Chan's model over its albedo.
    float gloss = clamp(log2(2.0 / max(p.alpha2, 1e-7) - 1.0) * (1.0 / 18.0), 0.0, 1.0);
    float glossiness = clamp(2.2 * gloss - 0.5, 0.0, 1.0);
    float retro = max((34.5 * gloss - 59.0) * gloss + 24.5, 0.0);
    p.sharpness = max(73.2 * gloss - 21.2, 8.9);
    float view_part = 1.0 - 0.75 * fifth_power(1.0 - cosine);
    float rough_albedo = 0.70712 + cosine * (0.18899 + cosine * (0.03262 + cosine * -0.01830));
    float retro_albedo = table_at(sqrt(cosine), (p.sharpness - 8.9) * (1.0 / 21.9)).w * (1.0 / 32.0);
    float model_albedo = mix(rough_albedo, (27.0 / 28.0) * view_part, glossiness) + retro * retro_albedo;
    p.chan = vec3(1.0 - glossiness, glossiness * view_part, retro) * (one_over_pi / model_albedo);
    p.diffuse = albedo * (1.0 - reflected);
    return p;
}

// For a light above the surface.
vec3 evaluate(Prepared p, vec3 light) {
    vec3 sum = p.view + light;
    float length_squared = dot(sum, sum);
    float inverse_length = inversesqrt(length_squared);
    vec3 h = sum * inverse_length;
    float c = min(0.5 * length_squared * inverse_length, 1.0);
    float rest = fifth_power(1.0 - c);

    float light_length = sqrt(p.alpha2 * dot(light.xy, light.xy) + light.z * light.z);
    float k = dot(h.xy, h.xy) + p.alpha2 * (h.z * h.z);
    float lobe = p.alpha2 * light.z / (k * k * (light.z * p.view_length + p.view.z * light_length));

    float glossy = 1.0 - 0.75 * fifth_power(1.0 - light.z);
    float retro = c * exp2(-p.sharpness * sqrt(h.z));
    float diffuse = (p.chan.x * (c + rest) + p.chan.y * glossy + p.chan.z * retro) * light.z;
    return (p.f0 + p.rise * rest) * lobe + p.diffuse * diffuse;
}
