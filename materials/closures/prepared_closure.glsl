// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_PREPARED_CLOSURE
#define NACRE_CLOSURES_PREPARED_CLOSURE
#include "materials/closures/diffuse.glsl"
#include "materials/closures/fresnel.glsl"
#include "materials/closures/ggx.glsl"
#include "materials/closures/slab.glsl"
#include "materials/closures/tables.glsl"
#ifdef NACRE_SLAB_FUZZ
#include "materials/closures/fuzz.glsl"
#endif
#ifdef NACRE_SLAB_MEDIUM
#include "materials/closures/medium.glsl"
#endif
#ifdef NACRE_SLAB_THIN_FILM
#include "materials/closures/thin_film.glsl"
#endif
// A closure as it is prepared for one view; see closure.glsl, which has what is asked of it for each light.

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
    bool is_veiled;         // by a medium above that scatters
    vec3 veil;              // what it takes of a lobe's light on its way down: optical depth
    vec3 veil_back;         // the part of that which is thrown back, counted already
    float veil_bend;        // 1 - 1 / index^2 of that medium
    vec3 upward;            // albedo of the interface for light that is scattered on its way up or thrown back
    vec3 upward_rise;       // how much more of it comes from along the surface
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
    diffuse += closure.scattered + closure.upward;
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
    closure.is_veiled = false;
    closure.veil = vec3(0.0);
    closure.veil_bend = 0.0;
    closure.veil_back = vec3(0.0);
    closure.upward = vec3(0.0);
    closure.upward_rise = vec3(0.0);
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

#endif
