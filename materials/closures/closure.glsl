// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_CLOSURE
#define NACRE_CLOSURES_CLOSURE
#include "materials/closures/diffuse.glsl"
#include "materials/closures/fresnel.glsl"
#include "materials/closures/ggx.glsl"
#include "materials/closures/slab.glsl"
#include "materials/closures/tables.glsl"
#ifdef NACRE_SLAB_EDGE_COVERAGE
#include "materials/closures/conversions.glsl"
#endif
#ifdef NACRE_SLAB_FUZZ
#include "materials/closures/fuzz.glsl"
#endif
#ifdef NACRE_SLAB_GLINTS
#include "materials/closures/glints.glsl"
#endif
#ifdef NACRE_SLAB_MEDIUM
#include "materials/closures/medium.glsl"
#endif
#ifdef NACRE_SLAB_THIN_FILM
#include "materials/closures/thin_film.glsl"
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

// The shape of what fuzz reflects: 0 the mapped cosine lobe, 1 Charlie's. How much that is, is sheen_albedo either way.
// A shader's choice of cost against error.
#ifndef NACRE_FUZZ_MODEL
#define NACRE_FUZZ_MODEL 0
#endif
#if defined(NACRE_SLAB_FUZZ) && NACRE_FUZZ_MODEL == 1
#include "materials/closures/classic.glsl"
#endif

struct ClosureValue {
    vec3 specular;    // interface and fuzz
    vec3 diffuse;     // the medium, where the light entered
    vec3 subsurface;  // the medium, leaving elsewhere: to be spread by its mean free path
};

struct ClosureSample {
    vec3 direction;
    float pdf;       // solid angle; for a mirror the probability of that choice; 0: nothing was sampled
    vec3 weight;     // value times cosine over pdf
    bool is_mirror;  // evaluate_closure and closure_pdf do not see this direction
};

struct ClosureAlbedo {
    vec3 specular;
    vec3 fuzz;
    vec3 diffuse;       // and subsurface
    vec3 transmission;  // scattered through; what passes straight is closure_throughput
};

#if defined(NACRE_SLAB_F90) || defined(NACRE_SLAB_F82) || defined(NACRE_SLAB_THIN_FILM)
#define NACRE_CLOSURE_CURVES
#endif

// One lobe of the interface, seen from the view. What single scattering reflects by the half vector is scaled by the
// compensation for multiple, the share of the lobe and what fuzz lets through; a mirror, which lights do not meet, has
// 0.
struct SpecularLobe {
    vec2 alpha;
    float area;  // alpha.x alpha.y
    float view_length;
#ifdef NACRE_CLOSURE_CURVES
    Fresnel reflectance;
#else
    // Schlick's curve. No digits cancel, since no channel is darker along the surface.
    vec3 reflectance;
    vec3 rise;
#endif
    vec3 albedo;  // scaled alike
    vec3 passed;  // 1 - albedo of the lobe alone, with all its digits
    bool is_mirror;
};

// A lobe with a part of its light.
SpecularLobe scaled_lobe(SpecularLobe lobe, vec3 factor) {
    SpecularLobe scaled = lobe;
#ifdef NACRE_CLOSURE_CURVES
    scaled.reflectance = scaled_fresnel(lobe.reflectance, factor);
#else
    scaled.reflectance = lobe.reflectance * factor;
    scaled.rise = lobe.rise * factor;
#endif
    scaled.albedo = lobe.albedo * factor;
    return scaled;
}

vec3 lobe_reflectance(SpecularLobe lobe, float half_cosine) {
#ifdef NACRE_CLOSURE_CURVES
    return fresnel_reflectance(lobe.reflectance, half_cosine);
#else
    return lobe.reflectance + lobe.rise * power5(1.0 - half_cosine);
#endif
}

struct Closure {
    uint features;
    vec3 view;
    SpecularLobe specular;
#ifdef NACRE_SLAB_SECOND_LOBE
    SpecularLobe second;
    float second_probability;
#endif
#ifdef NACRE_SLAB_FUZZ
    vec3 fuzz;  // albedo
#if NACRE_FUZZ_MODEL == 0
    SheenMap fuzz_map;
#else
    CharlieLobe fuzz_lobe;
#endif
    float fuzz_probability;
#endif
#ifdef NACRE_SLAB_MEDIUM
    vec3 subsurface;    // albedo of what leaves beyond the footprint
    vec3 thin;          // albedo of what a medium that is not opaque scatters back
    float thin_way;     // shape of that: thin_density
    float thin_scale;
    float bend;         // 1 - 1 / index^2 of the medium
    vec3 transmission;  // what it scatters through
    vec3 straight;      // what passes it without an event
    vec3 depth;         // optical, along the normal
    float reflectance;  // of the interface at normal incidence, mean of the channels: tells how directions refract
    float transmission_probability;
#endif
#ifdef NACRE_SLAB_GLINTS
    float glint_density;
    vec2 glint_position;
    vec2 glint_dx;
    vec2 glint_dy;
#endif
#ifdef NACRE_SLAB_SPECULAR_LUT
    uint specular_lut;
#endif
#ifdef NACRE_CLOSURE_COVERED
    float ior_excess;       // index - 1 of what lies above; `view` and the lobes are inside it
    float view_cosine;      // outside
    SpecularLobe again;     // what the layers above have thrown back to the lobe, once or more often
    vec3 again_view;        // what that lobe is seen from
    vec3 ring_albedo;       // of what of it comes from all around
    vec3 ring;              // the same times what makes ring_density a density
    float ring_spread;      // squared width of the lobe in tangential components
    vec2 ring_lean;         // away from where it is bright
    vec3 entering;          // what the interface lets through to the medium
    float veil;             // what the medium above takes of a lobe's light on its way down: optical depth
    float veil_bend;        // 1 - 1 / index^2 of that medium
    vec3 scattered;         // albedo of what does not come along the lobes, for that
    float scattered_way;    // its shape: thin_density
    float scattered_scale;
    float diffuse_scale;    // one over the share of the diffuse light that leaves what lies above
    float lambert_scale;    // the same for the light of media
    float again_probability;
#endif
    float gloss;            // of the diffuse model
    ChanView chan;          // over its own albedo, where Chan's is the model
    vec3 diffuse;           // albedo of what leaves where it entered
    float specular_probability;
    float diffuse_probability;
};

// Source of the compensation: Turquin 2019, "Practical multiple scattering compensation for microfacet models".
SpecularLobe make_specular_lobe(Fresnel fresnel, vec3 view, float roughness, float anisotropy) {
    SpecularLobe lobe;
    lobe.is_mirror = ggx_is_mirror(roughness);
    lobe.alpha = ggx_alpha(roughness, anisotropy);
    lobe.area = lobe.alpha.x * lobe.alpha.y;
    lobe.view_length = ggx_stretched_length(view, lobe.alpha);
    float cosine = min(view.z, 1.0);
#ifdef NACRE_SLAB_ANISOTROPY
    GgxAlbedo albedo;
    if (lobe.alpha.x == lobe.alpha.y) {
        albedo = ggx_albedo(cosine, lobe.alpha.x);
    } else {
        albedo = stretched_ggx_albedo(view, lobe.alpha);
    }
#else
    GgxAlbedo albedo = ggx_albedo(cosine, lobe.alpha.x);
#endif
    float rest = 1.0 - albedo.schlick;
    if (lobe.is_mirror) {
        // All that it reflects comes along one direction.
        albedo.missing = 0.0;
        albedo.schlick = power5(1.0 - cosine);
#ifdef NACRE_SLAB_F82
        albedo.dip = cosine * albedo.schlick * (1.0 - cosine);
#endif
        rest = schlick_rest(cosine, 1.0 - cosine);
    }
    vec3 single = fresnel.normal * rest + fresnel.grazing * albedo.schlick;
    vec3 not_single = (vec3(1.0) - fresnel.normal) * rest + (vec3(1.0) - fresnel.grazing) * albedo.schlick;
#ifdef NACRE_SLAB_F82
    single = max(single - fresnel.dip * albedo.dip, vec3(0.0));
    not_single += fresnel.dip * albedo.dip;
#endif
    // Of what a facet sends on to others, these do not reflect.
    vec3 entering = fresnel_mean_transmittance(fresnel);
    vec3 lost = entering * albedo.missing;
    lobe.albedo = single * (vec3(1.0) - lost);
    lobe.passed = not_single + single * lost;
    // 1 + mean reflectance * missing / (1 - missing).
    float again = albedo.missing / (1.0 - albedo.missing);
    vec3 scale = vec3(1.0 + again) - entering * again;
    if (lobe.is_mirror) scale = vec3(0.0);
#ifdef NACRE_CLOSURE_CURVES
    lobe.reflectance = scaled_fresnel(fresnel, scale);
#else
    lobe.reflectance = fresnel.normal * scale;
    lobe.rise = (fresnel.grazing - fresnel.normal) * scale;
#endif
    return lobe;
}

#ifdef NACRE_SLAB_SPECULAR_LUT
// A tint never adds light; what it takes is absorbed, the medium gets no more for it.
vec3 specular_tint(uint index, float view_cosine, float light_cosine) {
    return clamp(specular_lut(index, vec2(saturated(view_cosine), saturated(light_cosine))), vec3(0.0), vec3(1.0));
}
#endif

// The model of the opaque medium: 0 Chan over its albedo, 1 Lambert, 2 renormalized Disney as published. A shader's
// choice of cost against error.
#ifndef NACRE_DIFFUSE_MODEL
#define NACRE_DIFFUSE_MODEL 0
#endif
#if NACRE_DIFFUSE_MODEL == 2
#include "materials/closures/classic.glsl"
#endif

float diffuse_lobe(Closure closure, vec3 light, float half_cosine, float normal_half) {
#if NACRE_DIFFUSE_MODEL == 0
    return chan_diffuse_of(closure.chan, light.z, half_cosine, normal_half);
#elif NACRE_DIFFUSE_MODEL == 1
    return lambert_diffuse(light);
#else
    return disney_diffuse(closure.view, light, closure.gloss);
#endif
}

// Of diffuse light, about half way between its mean cosine and its most frequent one.
const float mean_cosine = 0.6;

// Of the interface without a film.
Fresnel slab_fresnel(Slab slab) {
#if !defined(NACRE_SLAB_F90) && !defined(NACRE_SLAB_F82)
    return make_plain_fresnel(slab.f0);
#else
    vec3 f90 = vec3(1.0);
    vec3 f82 = vec3(1.0);
#ifdef NACRE_SLAB_F90
    if ((slab.features & slab_f90) != 0u) f90 = slab.f90;
#endif
#ifdef NACRE_SLAB_F82
    if ((slab.features & slab_f82) != 0u) f82 = slab.f82;
#endif
    Fresnel fresnel = make_fresnel(slab.f0, f90, f82);
#ifdef NACRE_SLAB_F90
    if ((slab.features & slab_f90) != 0u) fresnel = scaled_fresnel(fresnel, vec3(slab.specular_weight));
#endif
    return fresnel;
#endif
}

// Index of refraction of a slab's medium by the reflectance of its interface. What reflects more than diamond does is
// metal and hardly lets light through; how it would refract does not matter.
float medium_ior(float f0) { return reflectance_to_ior(min(f0, 0.2)); }

// medium_ior - 1, with all digits where the medium is hardly denser.
float medium_ior_excess(float f0) {
    float root = sqrt(clamp(f0, 0.0, 0.2));
    return 2.0 * root / (1.0 - root);
}

// Of diffuse light that hits the interface from the medium's side, what leaves: through a denser medium's surface as
// much as enters it, spread over index^2 times the angle. At least 0.05, which is less than any dielectric's, so that
// it may be divided by.
vec3 internal_transmittance(Slab slab) {
    vec3 mean = fresnel_mean_transmittance(slab_fresnel(slab));
    vec3 ior = vec3(medium_ior(slab.f0.x), medium_ior(slab.f0.y), medium_ior(slab.f0.z));
    return clamp(mean / (ior * ior), vec3(0.05), vec3(1.0));
}

// 1 - internal_transmittance, with all digits where the medium is hardly denser.
vec3 internal_reflectance(Slab slab) {
    Fresnel fresnel = slab_fresnel(slab);
    vec3 root = sqrt(clamp(slab.f0, vec3(0.0), vec3(0.2)));
    vec3 outside = (vec3(1.0) + root) * (vec3(1.0) + root);
    // 1 - 1 / ior^2 is 4 root / (1 + root)^2.
    return min(fresnel_mean(fresnel) + fresnel_mean_transmittance(fresnel) * 4.0 * root / outside, vec3(0.95));
}

#ifdef NACRE_SLAB_MEDIUM
// By how much more than Schlick's formula Fresnel's equations let through, where both count: for a dielectric's
// reflectance at normal incidence from 0.005, fading in, to 0.3.
float dielectric_excess(float f0, float cosine) {
    float dielectric = min(f0, 0.3);
    float exact =
        dielectric_transmittance(cosine, refracted_cosine(cosine, dielectric), reflectance_to_ior(dielectric));
    float share = saturated((f0 - 0.005) * (1.0 / 0.015)) * saturated((0.3 - f0) * 10.0);
    return mix(1.0, exact / ((1.0 - dielectric) * schlick_rest(cosine, 1.0 - cosine)), share);
}

// A lobe of a slab with a medium, whose interface is a dielectric's, as bright as Fresnel's equations say of the facets
// that reflect most. The curve within the lobe stays Schlick's.
SpecularLobe dielectric_lobe(SpecularLobe lobe, Slab slab, float view_cosine) {
    uint others = 0u;
#ifdef NACRE_SLAB_F90
    others |= slab_f90;
#endif
#ifdef NACRE_SLAB_F82
    others |= slab_f82;
#endif
#ifdef NACRE_SLAB_THIN_FILM
    others |= slab_thin_film;
#endif
    SpecularLobe result = lobe;
    if ((slab.features & others) == 0u) {
        float cosine = ggx_typical_cosine(min(view_cosine, 1.0), sqrt(lobe.area));
        vec3 excess = vec3(dielectric_excess(slab.f0.x, cosine), dielectric_excess(slab.f0.y, cosine),
                           dielectric_excess(slab.f0.z, cosine));
        // A medium that lets nothing through is no other than none.
        vec3 depth = vec3(optical_depth(slab.mean_free_path.x, slab.thickness),
                          optical_depth(slab.mean_free_path.y, slab.thickness),
                          optical_depth(slab.mean_free_path.z, slab.thickness));
        excess = mix(vec3(1.0), excess, vec3(1.0) / (vec3(1.0) + depth * (1.0 / 64.0)));
        // At least half of the light stays in rough lobes, whose facets are not all seen from one angle.
        vec3 albedo = max(lobe.albedo + lobe.passed * (vec3(1.0) - excess), 0.5 * lobe.albedo);
        result = scaled_lobe(lobe, albedo / max(lobe.albedo, vec3(1e-30)));
        result.albedo = albedo;
        result.passed = min(lobe.passed * excess, lobe.passed + 0.5 * lobe.albedo);
    }
    return result;
}

// What becomes of light inside the slab, for each channel.
struct MediumScattering {
    vec3 reflected;  // back to the interface
    vec3 through;    // scattered, out of the far side
    vec3 straight;   // out of the far side without an event
    vec3 absorbed;
    vec3 kept;  // what is not reflected: the sum of the three above
    vec3 opaque;
};

// Light that goes up from the medium to the interface in all, where what it throws back is reflected again, and again.
// kept_again: 1 - reflected_again.
vec3 upwards_in_medium(vec3 reflected, vec3 leaving, vec3 reflected_again, vec3 kept_again) {
    return reflected / max(kept_again + leaving * reflected_again, vec3(1e-9));
}

// One channel. The authored albedo has the interface's part in it, which lets `leaving` of diffuse light out and throws
// the rest back into the medium: the medium's own is higher.
Scattering channel_scattering(float albedo, float leaving, float mean_free_path, Slab slab, float cosine) {
    float sum = leaving + (1.0 - leaving) * albedo;
    return medium_scattering(albedo / sum, leaving * (1.0 - albedo) / sum,
                             optical_depth(mean_free_path, slab.thickness), slab.phase_anisotropy, cosine);
}

// cosine: inside the medium.
MediumScattering slab_scattering(Slab slab, float cosine) {
    vec3 leaving = internal_transmittance(slab);
    Scattering x = channel_scattering(slab.albedo.x, leaving.x, slab.mean_free_path.x, slab, cosine);
    Scattering y = channel_scattering(slab.albedo.y, leaving.y, slab.mean_free_path.y, slab, cosine);
    Scattering z = channel_scattering(slab.albedo.z, leaving.z, slab.mean_free_path.z, slab, cosine);
    MediumScattering medium;
    medium.reflected = vec3(x.reflected, y.reflected, z.reflected);
    medium.through = vec3(x.through, y.through, z.through);
    medium.straight = vec3(x.straight, y.straight, z.straight);
    medium.absorbed = vec3(x.absorbed, y.absorbed, z.absorbed);
    medium.kept = medium.through + medium.straight + medium.absorbed;
    medium.opaque = vec3(x.opaque, y.opaque, z.opaque);
    return medium;
}
#endif

// What a thin medium scatters once comes along the surface more than Lambert's: light and view cross it at
// their angles, (1 - exp(-d (1 / v + 1 / l))) l / (l + v) (Chandrasekhar 1960, "Radiative transfer"), with x / (1 + x)
// for 1 - exp(-x). Over Lambert's value, without its scale. way: by depth and cosine of the view.
float thin_density(float cosine, float bend, float way) {
    return 1.0 / (sqrt(bend + cosine * cosine * (1.0 - bend)) + way);
}

float thin_way(float depth, float view_cosine) { return depth * view_cosine / (depth + view_cosine) + 0.04; }

// One over the mean of thin_density over diffuse light.
float thin_scale(float bend, float way) {
    float least = 1.0 / (1.0 + sqrt(bend));
    return 0.5 / (least - way * minus_log_rest((1.0 - bend) * least / (1.0 + way)) / (1.0 - bend));
}

// The closure with the probabilities by which its lobes are sampled: by what each sends to the view.
Closure with_probabilities(Closure closure) {
    Closure result = closure;
    vec3 diffuse = closure.diffuse;
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) diffuse += closure.thin + closure.subsurface;
#endif
#ifdef NACRE_CLOSURE_COVERED
    diffuse += closure.scattered;
    if (closure.ior_excess > 0.0) diffuse += closure.ring_albedo;
#endif
    result.specular_probability = largest(closure.specular.albedo);
    result.diffuse_probability = largest(diffuse);
    float sum = result.specular_probability + result.diffuse_probability;
#ifdef NACRE_SLAB_SECOND_LOBE
    result.second_probability = (closure.features & slab_second_lobe) != 0u ? largest(closure.second.albedo) : 0.0;
    sum += result.second_probability;
#endif
#ifdef NACRE_SLAB_FUZZ
    result.fuzz_probability = (closure.features & slab_fuzz) != 0u ? largest(closure.fuzz) : 0.0;
    sum += result.fuzz_probability;
#endif
#ifdef NACRE_SLAB_MEDIUM
    result.transmission_probability = (closure.features & slab_medium) != 0u ? largest(closure.transmission) : 0.0;
    sum += result.transmission_probability;
#endif
#ifdef NACRE_CLOSURE_COVERED
    result.again_probability = closure.ior_excess > 0.0 ? largest(closure.again.albedo) : 0.0;
    sum += result.again_probability;
#endif
    // One over less would be infinite.
    float scale = sum > 1e-30 ? 1.0 / sum : 0.0;
    result.specular_probability *= scale;
    result.diffuse_probability *= scale;
#ifdef NACRE_SLAB_SECOND_LOBE
    result.second_probability *= scale;
#endif
#ifdef NACRE_SLAB_FUZZ
    result.fuzz_probability *= scale;
#endif
#ifdef NACRE_SLAB_MEDIUM
    result.transmission_probability *= scale;
#endif
#ifdef NACRE_CLOSURE_COVERED
    result.again_probability *= scale;
#endif
    return result;
}

Closure prepare_closure_under(Slab slab, Fresnel bare, vec3 view, float footprint) {
    Closure closure;
    closure.features = slab.features;
    closure.view = vec3(view.x, view.y, max(view.z, smallest_cosine));
    float anisotropy = 0.0;
#ifdef NACRE_SLAB_ANISOTROPY
    if ((slab.features & slab_anisotropy) != 0u) anisotropy = slab.anisotropy;
#endif
    Fresnel fresnel = bare;
#ifdef NACRE_SLAB_THIN_FILM
    if ((slab.features & slab_thin_film) != 0u) {
        float typical = ggx_typical_cosine(min(closure.view.z, 1.0), slab.roughness * slab.roughness);
        fresnel = make_film_fresnel(bare, slab.film_thickness, slab.film_ior, typical);
    }
#endif
    closure.specular = make_specular_lobe(fresnel, closure.view, slab.roughness, anisotropy);
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) closure.specular = dielectric_lobe(closure.specular, slab, closure.view.z);
#endif
    vec3 passed = closure.specular.passed;
#ifdef NACRE_SLAB_GLINTS
    closure.glint_density = slab.glint_density;
    closure.glint_position = slab.glint_position;
    closure.glint_dx = slab.glint_dx;
    closure.glint_dy = slab.glint_dy;
#endif
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((slab.features & slab_second_lobe) != 0u) {
        closure.second = make_specular_lobe(fresnel, closure.view, slab.second_roughness, anisotropy);
#ifdef NACRE_SLAB_MEDIUM
        if ((slab.features & slab_medium) != 0u) closure.second = dielectric_lobe(closure.second, slab, closure.view.z);
#endif
        closure.specular = scaled_lobe(closure.specular, vec3(1.0 - slab.second_weight));
        closure.second = scaled_lobe(closure.second, vec3(slab.second_weight));
        passed = mix(closure.specular.passed, closure.second.passed, slab.second_weight);
    }
#endif
    float uncovered = 1.0;
#ifdef NACRE_SLAB_FUZZ
    if ((slab.features & slab_fuzz) != 0u) {
        float reflected = slab.fuzz_amount * sheen_albedo(min(closure.view.z, 1.0), slab.fuzz_roughness);
        uncovered = 1.0 - reflected;
        closure.fuzz = reflected * slab.fuzz_color;
#if NACRE_FUZZ_MODEL == 0
        closure.fuzz_map = sheen_map(closure.view, slab.fuzz_roughness);
#else
        closure.fuzz_lobe = make_charlie_lobe(min(closure.view.z, 1.0), slab.fuzz_roughness);
#endif
        closure.specular = scaled_lobe(closure.specular, vec3(uncovered));
#ifdef NACRE_SLAB_SECOND_LOBE
        closure.second = scaled_lobe(closure.second, vec3(uncovered));
#endif
    }
#endif
#if NACRE_DIFFUSE_MODEL == 0
    closure.gloss = chan_gloss(slab.roughness);
    closure.chan = chan_view(closure.view.z, closure.gloss,
                             1.0 / chan_albedo_by_table(min(closure.view.z, 1.0), closure.gloss));
#else
    closure.gloss = slab.roughness;
#endif
    vec3 entering = passed * uncovered;
    closure.diffuse = slab.albedo * entering;
#ifdef NACRE_SLAB_SPECULAR_LUT
    closure.specular_lut = slab.specular_lut;
    if ((slab.features & slab_specular_lut) != 0u) {
        // Most of the light of a lobe comes from about the mirrored view.
        vec3 tint = specular_tint(slab.specular_lut, closure.view.z, closure.view.z);
        closure.specular.albedo *= tint;
#ifdef NACRE_SLAB_SECOND_LOBE
        if ((slab.features & slab_second_lobe) != 0u) closure.second.albedo *= tint;
#endif
    }
#endif
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) {
        closure.reflectance = dot(slab.f0, vec3(1.0 / 3.0));
        closure.depth = vec3(optical_depth(slab.mean_free_path.x, slab.thickness),
                             optical_depth(slab.mean_free_path.y, slab.thickness),
                             optical_depth(slab.mean_free_path.z, slab.thickness));
        float inside = refracted_cosine(closure.view.z, closure.reflectance);
        closure.bend = refraction_bend(medium_ior_excess(closure.reflectance));
        closure.thin_way = thin_way(dot(closure.depth, vec3(1.0 / 3.0)), inside);
        closure.thin_scale = thin_scale(closure.bend, closure.thin_way);
        vec3 leaving = internal_transmittance(slab);
        MediumScattering medium = slab_scattering(slab, inside);
        MediumScattering again = slab_scattering(slab, mean_cosine);
        vec3 upwards = upwards_in_medium(medium.reflected, leaving, again.reflected, again.kept);
        vec3 share = vec3(subsurface_share(slab.albedo.x, slab.mean_free_path.x, footprint),
                          subsurface_share(slab.albedo.y, slab.mean_free_path.y, footprint),
                          subsurface_share(slab.albedo.z, slab.mean_free_path.z, footprint));
        vec3 diffuse = entering * min(upwards * leaving, vec3(1.0));
        closure.thin = diffuse * (vec3(1.0) - medium.opaque);
        closure.subsurface = diffuse * medium.opaque * share;
        closure.diffuse = diffuse * medium.opaque * (vec3(1.0) - share);
        closure.transmission =
            entering * (medium.through + (vec3(1.0) - leaving) * upwards * (again.through + again.straight));
        closure.straight = entering * medium.straight;
    }
#endif
#ifdef NACRE_CLOSURE_COVERED
    closure.ior_excess = 0.0;
    closure.view_cosine = closure.view.z;
    closure.entering = entering;
    closure.veil = 0.0;
    closure.veil_bend = 0.0;
    closure.scattered = vec3(0.0);
    closure.scattered_way = 1.0;
    closure.scattered_scale = 1.0;
    closure.again = scaled_lobe(closure.specular, vec3(0.0));
    closure.again_view = closure.view;
    closure.ring_albedo = vec3(0.0);
    closure.ring = vec3(0.0);
    closure.ring_spread = 1.0;
    closure.ring_lean = vec2(0.0);
    closure.diffuse_scale = 1.0;
    closure.lambert_scale = 1.0;
#endif
    return with_probabilities(closure);
}

Closure prepare_closure(Slab slab, vec3 view, float footprint) {
    return prepare_closure_under(slab, slab_fresnel(slab), view, footprint);
}

#ifdef NACRE_CLOSURE_COVERED
// Of diffuse light inside a medium of index `ior`, what its surface lets out (d'Eon and Irving 2011, "A
// quantized-diffusion model for rendering translucent materials": a fit to Fresnel's equations).
float leaving_mean(float ior) {
    float inverse = 1.0 / ior;
    return (1.4399 * inverse - 0.7099) * inverse + 0.3319 - 0.0636 * ior;
}

// Of the light that a lobe mirrors inside a medium, what the medium's smooth surface lets out: by its first reflection,
// by the one after it was thrown back once, and by each of those that follow.
struct LeavingShares {
    float first;
    float second;
    float later;
    float partly;  // of what does not leave by the first, what was not reflected totally
};

// In the plane of tangential components a GGX lobe is about a distribution w^2 / (pi (w^2 + x^2)^2) around the mirrored
// view, and what leaves lies in a circle around 0. The distribution is an even one on a sphere, projected from the
// pole, so that the light in the circle has a closed form. The polynomial mends its logarithm of odds by what Fresnel's
// equations let through of sampled GGX lobes: within 0.01 at index 1.5 and alpha 0.1 to 0.4, within 0.03 for indices
// from 1.3 to 1.8. What was totally reflected comes back at such angles again: by random walks between a lobe and a
// smooth interface.
LeavingShares leaving_shares(float alpha, float view_cosine, float ior) {
    float f0 = ior_to_reflectance(ior);
    float sine2 = 1.0 - view_cosine * view_cosine;
    float width = 0.00176 +
                  square(2.0 * alpha * ior / (1.0 + 0.4408 * alpha)) * pow(max(1.0 - sine2 / (ior * ior), 0.0), 1.415);
    float around = width + sine2 - 0.9946;
    float side = around * inversesqrt(around * around + 3.9784 * width);
    float odds = log((1.0 - side) / (1.0 + side));
    float root = sqrt(alpha);
    float index = ior - 1.5;
    odds = -0.6978 + odds * (1.5657 - 0.1394 * odds + root * (-1.2699 + 0.0881 * odds) - 0.5125 * index) +
           root * (3.2543 - 2.6908 * root - 3.2969 * index) + index * (0.6742 + 0.4503 * index) -
           sine2 * (0.1998 + 0.2626 * odds + 0.1368 * root + 0.1544 * index + 0.0101 * sine2);
    // Where the medium is hardly denser all of it leaves.
    float dense = saturated(10.0 * (ior - 1.0));
    LeavingShares shares;
    shares.first = mix(1.0, max(1.0 / (1.0 + exp(-odds)), 0.02), dense);
    float wide = 0.88 * leaving_mean(ior);
    float returning = mix(1.0, mix(0.2, wide, 1.0 - exp(-square(4.0 * alpha))), dense);
    // What the surface reflects within the circle stays in the lobe.
    float cosine = max(view_cosine, 0.4);
    float partly = f0 + (1.0 - f0) * power5(1.0 - cosine);
    partly *= shares.first / (1.0 - partly);
    float back = max(1.0 - shares.first, 1e-6);
    shares.partly = min(partly / back, 1.0);
    shares.second = mix(returning, shares.first, shares.partly);
    shares.later = mix(1.0, mix(0.12, wide, 1.0 - exp(-pow(3.6 * alpha, 1.8))), dense);
    return shares;
}

// Mean of the diffuse model over the directions that leave a medium of index `ior`, against Lambert's.
float diffuse_below(Closure closure, float ior) {
#if NACRE_DIFFUSE_MODEL == 1
    return 1.0;
#else
    // Half of what leaves does so below, half above 45 degrees.
    float sine = 0.70710678 / ior;
    float cosine = sqrt(1.0 - sine * sine);
    vec3 along = vec3(sine, 0.0, cosine);
    vec3 across = vec3(0.0, sine, cosine);
    vec3 against = vec3(-sine, 0.0, cosine);
    float sum =
        diffuse_lobe(closure, along, half_vector_cosine(closure.view, along), half_vector(closure.view, along).z) +
        diffuse_lobe(closure, across, half_vector_cosine(closure.view, across), half_vector(closure.view, across).z) *
            2.0 +
        diffuse_lobe(closure, against, half_vector_cosine(closure.view, against), half_vector(closure.view, against).z);
    return pi * 0.25 * sum / cosine;
#endif
}

// The half of a lobe's light or of the diffuse light that leaves in a direction: what Fresnel's equations let through
// for unpolarized light, times the cosine outside over that inside and over ior^2. No term is negative.
float leaving_density(float cosine, float inner_cosine, float ior) {
    float across = cosine / (cosine + ior * inner_cosine);
    float along = cosine / (ior * cosine + inner_cosine);
    return 2.0 / ior * (across * across + along * along);
}

// Of a lobe that is seen from about the angle of total reflection or beyond it, by the squared sine that the view would
// have outside, from 0.81: the same closed form, mended for such views, within 0.01 at index 1.5 and alpha from 0.07.
float tilted_leaving_share(float alpha, float sine2, float ior) {
    float width = 0.00131 + square(2.0 * alpha * ior) * pow(max(1.0 - sine2 / (ior * ior), 0.0), 1.237);
    float around = width + sine2 - 0.9908;
    float side = around * inversesqrt(around * around + 3.9632 * width);
    float odds = log((1.0 - side) / (1.0 + side));
    float root = sqrt(alpha);
    float index = ior - 1.5;
    odds = 0.1141 + odds * (1.286 - 0.0295 * odds - 1.1831 * root - 0.2635 * sine2 - 0.3927 * index) +
           root * (2.8025 - 3.4367 * root + 0.7464 * sine2 - 3.5865 * index) + index * (0.87 - 0.3729 * sine2) -
           sine2 * (1.0435 + 0.0145 * sine2);
    return max(1.0 / (1.0 + exp(-odds)), 0.02);
}

// What was reflected totally comes from all around the directions that leave. If it lay there evenly, what a lobe sends
// into one of them were the part of the lobe that lies outside: (1 + s) / 2 by the closed form of leaving_shares. There is
// more of it where the lobe looks. Over Lambert's value; spread: squared width of the lobe; lean: of length 1 or less.
float ring_density(vec3 light, float spread, vec2 lean) {
    float around = spread - light.z * light.z;
    return (1.0 + around * inversesqrt(around * around + 4.0 * spread)) * max(1.0 - light.x * lean.x - light.y * lean.y, 0.0);
}

// One over the mean of ring_density over the diffuse light that leaves: in closed form without Fresnel's equations,
// which take more along the rim (a fit within 0.02).
float ring_scale(float width) {
    return (width + sqrt(width * width + 4.0)) * (1.0 + 0.018 / (width + 0.015)) / (4.0 * width);
}

// What lies above a closure, as the view sees it.
struct Cover {
    vec3 spread;        // share of what the lobes send that was scattered on its way down or up
    vec3 mean;          // what the closure's interface reflects of diffuse light
    vec3 kept;          // of light that goes up and down once more, what the medium above leaves
    float bend;         // 1 - 1 / index^2 of the medium that scatters
    float ior_excess;   // index - 1 of what lies directly above, against what the view and the lights outside are in
    float view_cosine;  // outside
};

// Of what light for a lobe is scattered on its way down and up, about this part of the depth is that of the way up: what
// is thrown back counts down alone.
const float upward_share = 0.35;

// Optical depth of both ways by the share that is scattered. Of what is nearly all, 32 bits do not know the rest.
float spread_depth(float spread) { return minus_log_rest(min(spread, 0.9998)); }

// The share that is scattered on its way up by that on both.
vec3 scattered_up(vec3 spread) {
    return vec3(exponential_rest(upward_share * spread_depth(spread.x)),
                exponential_rest(upward_share * spread_depth(spread.y)),
                exponential_rest(upward_share * spread_depth(spread.z)));
}

// What a scattering medium leaves of a lobe's light on its straight way down.
float veil_transmittance(Closure closure, float cosine) {
    return exp(-closure.veil *
               inversesqrt(max(closure.veil_bend + cosine * cosine * (1.0 - closure.veil_bend), 1e-4)));
}

// The same for all of a lobe. Lobes are wide outside, and none of their light comes from below.
float lobe_veil(Closure closure, SpecularLobe lobe, float view_cosine) {
    float width = lobe.is_mirror ? 0.0 : min(2.7 * sqrt(lobe.area) * (1.0 + closure.ior_excess), 0.55);
    float cosine2 = view_cosine * view_cosine;
    return veil_transmittance(closure,
                              sqrt(mix(cosine2, 0.45 - 1.1 * cosine2 * square(1.0 - cosine2), width)));
}

// A closure that is seen through layers, prepared for the view inside. What is scattered on its way does not come along
// the lobes, but as diffuse light does, and meets the interface like it.
Closure cover_closure(Closure closure, Cover cover) {
    Closure covered = closure;
    float ior_excess = cover.ior_excess;
    vec3 up = scattered_up(cover.spread);
    vec3 straight = vec3(1.0) - up;
    float bend = cover.bend;
    float slant = sqrt(bend + cover.view_cosine * cover.view_cosine * (1.0 - bend));
    covered.veil = (1.0 - upward_share) * spread_depth(dot(cover.spread, vec3(1.0 / 3.0))) * max(slant, 0.01);
    covered.veil_bend = bend;
    vec3 specular = closure.specular.albedo;
    covered.specular = scaled_lobe(closure.specular, straight);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u) {
        specular += closure.second.albedo;
        covered.second = scaled_lobe(closure.second, straight);
    }
#endif
    vec3 whole = specular + closure.entering;
    vec3 entering = mix(vec3(1.0), whole * (vec3(1.0) - cover.mean) / max(closure.entering, vec3(1e-30)), up);
    covered.diffuse = closure.diffuse * entering + up * whole * cover.mean;
    covered.scattered_way = covered.veil + 0.04;
    covered.scattered_scale = thin_scale(bend, covered.scattered_way);
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) {
        covered.thin *= entering;
        covered.subsurface *= entering;
        covered.transmission *= entering;
        covered.straight *= entering;
        covered.thin_scale = thin_scale(either(closure.bend, refraction_bend(ior_excess)), closure.thin_way);
    }
#endif
    covered.ior_excess = ior_excess;
    covered.view_cosine = max(cover.view_cosine, smallest_cosine);
    float again_cosine = covered.view_cosine;
    if (ior_excess > 0.0) {
        float ior = 1.0 + ior_excess;
        float alpha = sqrt(closure.specular.area);
        LeavingShares shares = leaving_shares(alpha, covered.view_cosine, ior);
        float once = shares.first;
        // Thrown back once, and again and again.
        vec3 reflected = min(specular, vec3(1.0)) * cover.kept;
        vec3 thrown = reflected * (1.0 - once);
        thrown *= vec3(shares.second) + reflected * ((1.0 - shares.second) * shares.later) /
                                            (vec3(1.0) - reflected * (1.0 - shares.later));
        vec3 sum = vec3(once) + thrown;
        vec3 share = thrown / sum;
        if (closure.specular.is_mirror) share = vec3(0.0);
        // What was reflected totally leaves by a lobe around what lies beyond that angle, and in a ring around the normal
        // that is brightest along its rim; the rest by a wider lobe around the mirrored view. Widths and shares by random
        // walks between a lobe and a smooth interface.
        float sine = ior * sqrt(closure.view.x * closure.view.x + closure.view.y * closure.view.y);
        float aside = saturated(4.5 * sine - 0.8) * saturated(2.0 - 3.3 * shares.partly);
        float tilt = mix(sine, 1.0 + min(1.4 * ior * alpha, 0.4 * ior_excess), aside);
        again_cosine = sqrt(max(1.0 - tilt * tilt, 0.0));
        float stretch = tilt / max(sine, 1e-6);
        float inside = tilt / ior;
        covered.again_view = vec3(closure.view.x * stretch, closure.view.y * stretch,
                                  sqrt(max(1.0 - inside * inside, 1e-6)));
        covered.again = covered.specular;
        covered.again.alpha = min(closure.specular.alpha * (0.95 + 1.1 * square(covered.view_cosine)), vec2(1.0));
        covered.again.area = covered.again.alpha.x * covered.again.alpha.y;
        covered.again.view_length = ggx_stretched_length(covered.again_view, covered.again.alpha);
        float area = alpha * alpha;
        float wide = sqrt(covered.again.area);
        float leaving = mix(leaving_shares(wide, again_cosine, ior).first,
                            tilted_leaving_share(wide, max(tilt * tilt, 0.81), ior), saturated(5.0 * tilt - 4.5));
        float ring = min(0.6 * area / (area + 0.017) +
                             0.6 * area / (area + 0.012) * square(square(square(covered.view_cosine))),
                         0.7);
        covered.again.albedo = covered.specular.albedo * share * (1.0 - ring);
        covered.ring_albedo = covered.specular.albedo * share * ring;
        covered.ring_spread = 1.7 * area * ior * ior;
        covered.ring_lean = vec2(closure.view.x, closure.view.y) * (ior * min(1.8, 1.0 / max(sine, 1e-6)));
        covered.ring = covered.ring_albedo * ring_scale(sqrt(covered.ring_spread));
        float single = 1.0 - ggx_albedo(covered.again_view.z, wide).missing;
        vec3 peak = covered.again.albedo / (single * leaving);
#ifdef NACRE_CLOSURE_CURVES
        covered.again.reflectance.normal = peak;
        covered.again.reflectance.grazing = peak;
        covered.again.reflectance.dip = vec3(0.0);
#else
        covered.again.reflectance = peak;
        covered.again.rise = vec3(0.0);
#endif
        vec3 first = vec3(1.0) / sum;
        vec3 own = covered.specular.albedo * (once * first);
        if (closure.specular.is_mirror) first = vec3(0.0);
        if (closure.specular.is_mirror) own = covered.specular.albedo;
        covered.specular = scaled_lobe(covered.specular, first);
        covered.specular.albedo = own;
#ifdef NACRE_SLAB_SECOND_LOBE
        if ((closure.features & slab_second_lobe) != 0u) {
            once = leaving_shares(sqrt(closure.second.area), covered.view_cosine, ior).first;
            own = covered.second.albedo;
            covered.second = scaled_lobe(covered.second, vec3(1.0 / once));
            covered.second.albedo = own;
        }
#endif
        covered.lambert_scale = 1.0 / leaving_mean(ior);
        covered.diffuse_scale =
            covered.lambert_scale / mix(1.0, diffuse_below(closure, ior), saturated(5.0 * ior_excess));
    }
    if (covered.veil > 0.0) {
        float down = lobe_veil(covered, covered.specular, cover.view_cosine);
        covered.scattered = covered.specular.albedo * (1.0 - down);
        covered.specular.albedo *= down;
        down = lobe_veil(covered, covered.again, again_cosine);
        covered.scattered += covered.again.albedo * (1.0 - down);
        covered.again.albedo *= down;
        // Most of the ring lies along the rim.
        down = veil_transmittance(covered, 0.45);
        covered.scattered += covered.ring_albedo * (1.0 - down);
        covered.ring_albedo *= down;
#ifdef NACRE_SLAB_SECOND_LOBE
        if ((closure.features & slab_second_lobe) != 0u) {
            down = lobe_veil(covered, covered.second, cover.view_cosine);
            covered.scattered += covered.second.albedo * (1.0 - down);
            covered.second.albedo *= down;
        }
#endif
    }
    return with_probabilities(covered);
}
#endif

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

#ifdef NACRE_CLOSURE_COVERED
vec3 again_value(Closure closure, vec3 light) {
#ifdef NACRE_CLOSURE_CURVES
    vec3 peak = closure.again.reflectance.normal;
#else
    vec3 peak = closure.again.reflectance;
#endif
    return peak * ggx_value(closure.again_view, closure.again.view_length, light,
                            half_vector(closure.again_view, light), closure.again.alpha);
}
#endif

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
    if (closure.veil > 0.0) value.specular *= veil_transmittance(closure, outside.z);
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
    if (closure.veil > 0.0)
        value.diffuse += closure.scattered * (outside.z * inverse_pi * closure.scattered_scale *
                                              thin_density(outside.z, closure.veil_bend, closure.scattered_way));
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
    albedo.diffuse += closure.scattered;
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
