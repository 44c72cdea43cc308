// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_CLOSURE
#define NACRE_CLOSURES_CLOSURE
#include "materials/closures/prepared_closure.glsl"
#ifdef NACRE_SLAB_EDGE_COVERAGE
#include "materials/closures/conversions.glsl"
#endif
#ifdef NACRE_CLOSURE_COVERED
#include "materials/closures/covered_closure.glsl"
#endif
#ifdef NACRE_SLAB_GLINTS
#include "materials/closures/glints.glsl"
#endif
// A slab seen from one direction: everything that depends on slab and view is computed once, lights follow.
//
// All vectors are unit and in the local frame: z is the normal, x the tangent, y the bitangent; they point away from
// the surface. Light directions below the surface (z < 0) ask for what the medium scatters through. Values include the
// cosine to the light. Angles down to 1e-7 rad above the surface are handled; a view below that is moved there.
//
//     Closure prepare_closure(Slab slab, vec3 view, float footprint)
//         footprint: meters that a pixel (or ray cone) covers on the surface; tells what the medium scatters within it
//     Closure prepare_closure_under(Slab slab, Fresnel bare, vec3 view, float footprint)
//         bare: the interface without a film, where it is not the slab's (slab_fresnel)
//     ClosureValue evaluate_closure(Closure closure, vec3 light)
//     ClosureValue evaluate_closure_above(Closure closure, vec3 light)
//     ClosureSample sample_closure(Closure closure, vec3 random)      random: [0, 1)^3
//     float closure_pdf(Closure closure, vec3 light)                  solid angle, of sample_closure without mirrors
//     ClosureAlbedo closure_albedo(Closure closure)                   to the view, under white light from everywhere
//     vec3 closure_transmittance(Closure closure, float cos_theta)    straight through the medium, by outer direction
//     vec3 closure_throughput(Closure closure)                        of the view: through fuzz, interface and medium
//     float slab_coverage(Slab slab, float cos_theta)                 where a slab may have slab_edge_coverage
//     float slab_bare(Slab slab, float cos_theta)                     the rest of the surface
//     vec3 internal_transmittance(Slab slab)                          of diffuse light from the medium's side
//     vec3 internal_reflectance(Slab slab)                            the rest of that
//
// With NACRE_CLOSURE_COVERED (materials/closures/operators.glsl defines it) closures may be seen through layers. They
// are prepared for the view as it goes on inside; the lights are those outside, as ever:
//     Closure cover_closure(Closure closure, Cover cover)
//
// Who includes this provides the tables (materials/closures/tables.glsl, medium.glsl) and, where a slab may have
// slab_specular_lut, vec3 specular_lut(uint index, vec2 at): the tint by the cosines of view and light to the normal.
//
// What is not reciprocal: compensation, fuzz, thin film and what the interface leaves to the medium are computed
// towards the view only. Energy is kept exactly that way (up to the error of the tables), and nothing but the lobes is
// computed for each light.

// Of a light above the surface, by its half vector with the view and the cosine of the two.
vec3 specular_lobe_value(Closure closure, SpecularLobe lobe, vec3 light, vec3 h, float half_cosine) {
#ifdef NACRE_SLAB_ANISOTROPY
    if ((closure.features & slab_anisotropy) != 0u)
        return lobe_reflectance(lobe, half_cosine) *
               ggx_value(closure.view, lobe.view_length, light, h, lobe.alpha);
#endif
    return lobe_reflectance(lobe, half_cosine) *
           round_ggx_value(closure.view.z, lobe.view_length, light, h, lobe.area);
}

float specular_lobe_pdf(SpecularLobe lobe, vec3 view, vec3 light, vec3 h) {
    if (lobe.is_mirror) return 0.0;
    return ggx_pdf(view, lobe.view_length, light, h, lobe.alpha);
}

// The same where the light is known to be above the surface.
ClosureValue evaluate_closure_above(Closure closure, vec3 outside) {
    ClosureValue value;
    value.subsurface = vec3(0.0);
#ifdef NACRE_CLOSURE_COVERED
    vec3 light = refracted_direction(outside, closure.ior_excess);
#else
    vec3 light = outside;
#endif
    // Both are above the surface: their sum has a length. Half of it is the cosine to their half vector.
    vec3 sum = closure.view + light;
    float length_squared = dot(sum, sum);
    float inverse_length = inversesqrt(length_squared);
    vec3 h = sum * inverse_length;
    float half_cosine = min(0.5 * length_squared * inverse_length, 1.0);
    value.specular = specular_lobe_value(closure, closure.specular, light, h, half_cosine);
#ifdef NACRE_SLAB_GLINTS
    // The second lobe stays smooth: it is the haze around the facets.
    if ((closure.features & slab_glints) != 0u && !closure.specular.is_mirror)
        value.specular *= glint_factor(h, closure.specular.alpha, closure.glint_density, closure.glint_position,
                                       closure.glint_dx, closure.glint_dy);
#endif
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u)
        value.specular += specular_lobe_value(closure, closure.second, light, h, half_cosine);
#endif
#ifdef NACRE_CLOSURE_COVERED
    float leaving = 1.0;
    float diffuse_scale = 1.0;
    float lambert_scale = 1.0;
    if (closure.ior_excess > 0.0) {
        leaving = leaving_density(outside.z, light.z, 1.0 + closure.ior_excess);
        value.specular = (value.specular + again_value(closure, light)) * leaving;
        diffuse_scale = leaving * closure.diffuse_scale;
        lambert_scale = leaving * closure.lambert_scale;
        value.specular += closure.ring * (lambert_scale * light.z * inverse_pi *
                                          ring_density(outside, closure.ring_spread, closure.ring_lean));
    }
    if (closure.is_veiled) value.specular *= veil_transmittance(closure, outside.z);
#endif
#ifdef NACRE_SLAB_SPECULAR_LUT
    if ((closure.features & slab_specular_lut) != 0u)
        value.specular *= specular_tint(closure.specular_lut, closure.view.z, light.z);
#endif
#ifdef NACRE_SLAB_FUZZ
#if NACRE_FUZZ_MODEL == 0
    if ((closure.features & slab_fuzz) != 0u) value.specular += closure.fuzz * sheen_density(closure.fuzz_map, outside);
#else
#ifdef NACRE_CLOSURE_COVERED
    // Fuzz is no lobe below an interface: its lights are those outside.
    vec3 fuzz_half = half_vector(closure.view, outside);
#else
    vec3 fuzz_half = h;
#endif
    if ((closure.features & slab_fuzz) != 0u)
        value.specular += closure.fuzz * charlie_value(closure.fuzz_lobe, outside.z, fuzz_half);
#endif
#endif
    value.diffuse = closure.diffuse * diffuse_lobe(closure, light, half_cosine, h.z);
#ifdef NACRE_CLOSURE_COVERED
    value.diffuse *= diffuse_scale;
    if (closure.is_veiled) {
        value.diffuse += (closure.upward + closure.upward_rise * (power5(1.0 - light.z) - 1.0 / 21.0)) *
                         (lambert_scale * light.z * inverse_pi);
        value.diffuse += closure.scattered * (outside.z * inverse_pi * closure.scattered_scale *
                                              thin_density(outside.z, closure.veil_bend, closure.scattered_way));
    }
#endif
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) {
        float lambert = light.z * inverse_pi;
#ifdef NACRE_CLOSURE_COVERED
        lambert *= lambert_scale;
#endif
        value.diffuse += closure.thin * (lambert * closure.thin_scale *
                                         thin_density(light.z, closure.bend, closure.thin_way));
        value.subsurface = closure.subsurface * lambert;
    }
#endif
    return value;
}

// One way out: a function that returns early costs more where lanes part.
ClosureValue evaluate_closure(Closure closure, vec3 light) {
    ClosureValue value;
    value.specular = vec3(0.0);
    value.diffuse = vec3(0.0);
    value.subsurface = vec3(0.0);
#ifdef NACRE_SLAB_MEDIUM
    if (light.z < 0.0 && (closure.features & slab_medium) != 0u)
        value.diffuse = closure.transmission * (-light.z * inverse_pi);
#endif
    if (light.z > 0.0) value = evaluate_closure_above(closure, light);
    return value;
}

float closure_pdf(Closure closure, vec3 light) {
#ifdef NACRE_SLAB_MEDIUM
    if (light.z < 0.0 && (closure.features & slab_medium) != 0u)
        return closure.transmission_probability * (-light.z * inverse_pi);
#endif
    if (light.z <= 0.0) return 0.0;
#ifdef NACRE_CLOSURE_COVERED
    vec3 inner = refracted_direction(light, closure.ior_excess);
#else
    vec3 inner = light;
#endif
    vec3 h = half_vector(closure.view, inner);
    float pdf = closure.specular_probability * specular_lobe_pdf(closure.specular, closure.view, inner, h);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u)
        pdf += closure.second_probability * specular_lobe_pdf(closure.second, closure.view, inner, h);
#endif
#ifdef NACRE_CLOSURE_COVERED
    if (closure.ior_excess > 0.0) {
        pdf += closure.again_probability * specular_lobe_pdf(closure.again, closure.again_view, inner,
                                                             half_vector(closure.again_view, inner));
        // Solid angle inside to that outside.
        pdf *= light.z / (square(1.0 + closure.ior_excess) * inner.z);
    }
#endif
#ifdef NACRE_SLAB_FUZZ
#if NACRE_FUZZ_MODEL == 0
    if ((closure.features & slab_fuzz) != 0u) pdf += closure.fuzz_probability * sheen_density(closure.fuzz_map, light);
#else
    // Directions are uniform.
    if ((closure.features & slab_fuzz) != 0u) pdf += closure.fuzz_probability * (0.5 * inverse_pi);
#endif
#endif
    return pdf + closure.diffuse_probability * light.z * inverse_pi;
}

ClosureSample sample_specular_lobe(Closure closure, SpecularLobe lobe, vec3 view, float probability, float random_x,
                                   float random_y) {
    ClosureSample result;
    result.is_mirror = lobe.is_mirror;
    result.pdf = 0.0;
    result.weight = vec3(0.0);
    if (lobe.is_mirror) {
        result.direction = vec3(-view.x, -view.y, view.z);
        result.pdf = probability;
        result.weight = lobe.albedo / probability;
    } else {
        result.direction = ggx_sample(view, lobe.view_length, lobe.alpha, random_x, random_y);
    }
#ifdef NACRE_CLOSURE_COVERED
    if (closure.ior_excess > 0.0) {
        // What is totally reflected is lost: the other lobe has it.
        vec3 inside = result.direction;
        float ior = 1.0 + closure.ior_excess;
        float tangential = ior * ior * (inside.x * inside.x + inside.y * inside.y);
        float outside = inside.z > 0.0 ? sqrt(max(1.0 - tangential, 0.0)) : inside.z;
        if (lobe.is_mirror) outside = closure.view_cosine;
        result.direction = vec3(ior * inside.x, ior * inside.y, outside);
    }
#endif
    return result;
}

ClosureSample sample_closure(Closure closure, vec3 random) {
    ClosureSample result;
    result.pdf = 0.0;
    result.weight = vec3(0.0);
    result.is_mirror = false;
    result.direction = vec3(0.0, 0.0, 1.0);
    float left = random.x - closure.diffuse_probability;
    bool chosen = left < 0.0;
    if (chosen) result.direction = cosine_direction(random.y, random.z);
#ifdef NACRE_SLAB_FUZZ
    if (!chosen && (closure.features & slab_fuzz) != 0u) {
        left -= closure.fuzz_probability;
        chosen = left < 0.0;
#if NACRE_FUZZ_MODEL == 0
        if (chosen) result.direction = sheen_sample(closure.fuzz_map, random.y, random.z);
#else
        if (chosen) result.direction = uniform_direction(random.y, random.z);
#endif
    }
#endif
#ifdef NACRE_SLAB_MEDIUM
    if (!chosen && (closure.features & slab_medium) != 0u) {
        left -= closure.transmission_probability;
        chosen = left < 0.0;
        if (chosen) {
            vec3 above = cosine_direction(random.y, random.z);
            result.direction = vec3(above.x, above.y, -above.z);
        }
    }
    bool is_through = chosen && result.direction.z < 0.0;
#else
    bool is_through = false;
#endif
#ifdef NACRE_SLAB_SECOND_LOBE
    if (!chosen && (closure.features & slab_second_lobe) != 0u) {
        left -= closure.second_probability;
        chosen = left < 0.0;
        if (chosen)
            result = sample_specular_lobe(closure, closure.second, closure.view, closure.second_probability, random.y,
                                          random.z);
    }
#endif
#ifdef NACRE_CLOSURE_COVERED
    if (!chosen && closure.ior_excess > 0.0) {
        left -= closure.again_probability;
        chosen = left < 0.0;
        if (chosen)
            result = sample_specular_lobe(closure, closure.again, closure.again_view, closure.again_probability,
                                          random.y, random.z);
    }
#endif
    if (!chosen && closure.specular_probability <= 0.0) return result;
    if (!chosen)
        result = sample_specular_lobe(closure, closure.specular, closure.view, closure.specular_probability, random.y,
                                      random.z);
    // Microfacets also send light below the surface, where it is lost.
    if (result.is_mirror || (!is_through && result.direction.z <= 0.0)) return result;
    result.pdf = closure_pdf(closure, result.direction);
    if (result.pdf > 0.0) {
        ClosureValue value = evaluate_closure(closure, result.direction);
        result.weight = (value.specular + value.diffuse + value.subsurface) / result.pdf;
    }
    return result;
}

ClosureAlbedo closure_albedo(Closure closure) {
    ClosureAlbedo albedo;
    albedo.specular = closure.specular.albedo;
    albedo.fuzz = vec3(0.0);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u) albedo.specular += closure.second.albedo;
#endif
#ifdef NACRE_SLAB_FUZZ
    if ((closure.features & slab_fuzz) != 0u) albedo.fuzz = closure.fuzz;
#endif
#ifdef NACRE_CLOSURE_COVERED
    if (closure.ior_excess > 0.0) albedo.specular += closure.again.albedo;
#endif
    albedo.diffuse = closure.diffuse;
#ifdef NACRE_CLOSURE_COVERED
    // Surroundings look like diffuse light to it.
    albedo.diffuse += closure.scattered + closure.upward;
    if (closure.ior_excess > 0.0) albedo.diffuse += closure.ring_albedo;
#endif
    albedo.transmission = vec3(0.0);
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) {
        albedo.diffuse += closure.thin + closure.subsurface;
        albedo.transmission = closure.transmission;
    }
#endif
    return albedo;
}

vec3 closure_transmittance(Closure closure, float cos_theta) {
    vec3 transmittance = vec3(0.0);
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u)
        transmittance = exp(-closure.depth / max(refracted_cosine(cos_theta, closure.reflectance), smallest_cosine));
#endif
    return transmittance;
}

vec3 closure_throughput(Closure closure) {
    vec3 throughput = vec3(0.0);
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) throughput = closure.straight;
#endif
    return throughput;
}

#ifdef NACRE_SLAB_EDGE_COVERAGE
// Coverage of a slab seen from a cosine to its normal.
float slab_coverage(Slab slab, float cos_theta) {
    if ((slab.features & slab_edge_coverage) == 0u) return slab.coverage;
    return view_dependent_coverage(slab.coverage, slab.edge_coverage, slab.edge_exponent, cos_theta);
}

// 1 - slab_coverage, with all digits where that is near 1.
float slab_bare(Slab slab, float cos_theta) {
    if ((slab.features & slab_edge_coverage) == 0u) return max(1.0 - slab.coverage, 0.0);
    return max((1.0 - slab.coverage) * facing_share(cos_theta, slab.edge_exponent) +
                   (1.0 - slab.edge_coverage) * grazing_share(cos_theta, slab.edge_exponent),
               0.0);
}
#endif

#endif
