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
// With NACRE_CLOSURE_COVERED (materials/closures/operators.glsl defines it) closures may be seen through layers:
//     Closure cover_closure(Closure closure, vec3 spread, float under_interface)
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
    float under_interface;  // share of the diffuse light that comes through a layer's interface; cover_closure
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

// The closure with the probabilities by which its lobes are sampled: by what each sends to the view.
Closure with_probabilities(Closure closure) {
    Closure result = closure;
    vec3 diffuse = closure.diffuse;
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) diffuse += closure.thin + closure.subsurface;
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
    closure.under_interface = 0.0;
#endif
    return with_probabilities(closure);
}

Closure prepare_closure(Slab slab, vec3 view, float footprint) {
    return prepare_closure_under(slab, slab_fresnel(slab), view, footprint);
}

#ifdef NACRE_CLOSURE_COVERED
// A closure that is seen through layers. spread: share of what its specular lobes send that does not come along them,
// but as diffuse light does, having been scattered or thrown back on its way. under_interface: share of its light that
// comes through an interface, which lets little in along the surface.
Closure cover_closure(Closure closure, vec3 spread, float under_interface) {
    Closure covered = closure;
    vec3 sharp = vec3(1.0) - spread;
    vec3 specular = closure.specular.albedo;
    covered.specular = scaled_lobe(closure.specular, sharp);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u) {
        specular += closure.second.albedo;
        covered.second = scaled_lobe(closure.second, sharp);
    }
#endif
    covered.diffuse += specular * spread;
    covered.under_interface = under_interface;
    return with_probabilities(covered);
}

// Of diffuse light under an interface by the direction that it comes from, relative to its mean: by Schlick's formula
// the same for all dielectrics. Over the mean of (1 - c)^5 over the lobe of Chan's model (a fit from below, so that no
// energy is made), or over Lambert's.
float interface_factor(Closure closure, vec3 light) {
#if NACRE_DIFFUSE_MODEL == 0
    float m = 1.0 - min(closure.view.z, 1.0);
    float mean = mix(0.042 + m * m * (0.03 + 0.0115 * square(square(m))), 0.0374, chan_glossiness(closure.gloss));
#else
    float mean = 0.037;
#endif
    return mix(1.0, schlick_rest(min(light.z, 1.0), 1.0 - min(light.z, 1.0)) / (1.0 - mean), closure.under_interface);
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

float specular_lobe_pdf(SpecularLobe lobe, vec3 view, vec3 light, vec3 h) {
    if (lobe.is_mirror) return 0.0;
    return ggx_pdf(view, lobe.view_length, light, h, lobe.alpha);
}

// The same where the light is known to be above the surface.
ClosureValue evaluate_closure_above(Closure closure, vec3 light) {
    ClosureValue value;
    value.subsurface = vec3(0.0);
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
#ifdef NACRE_SLAB_SPECULAR_LUT
    if ((closure.features & slab_specular_lut) != 0u)
        value.specular *= specular_tint(closure.specular_lut, closure.view.z, light.z);
#endif
#ifdef NACRE_SLAB_FUZZ
#if NACRE_FUZZ_MODEL == 0
    if ((closure.features & slab_fuzz) != 0u) value.specular += closure.fuzz * sheen_density(closure.fuzz_map, light);
#else
    if ((closure.features & slab_fuzz) != 0u)
        value.specular += closure.fuzz * charlie_value(closure.fuzz_lobe, light.z, h);
#endif
#endif
    value.diffuse = closure.diffuse * diffuse_lobe(closure, light, half_cosine, h.z);
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) {
        value.diffuse += closure.thin * (light.z * inverse_pi);
        value.subsurface = closure.subsurface * (light.z * inverse_pi);
    }
#endif
#ifdef NACRE_CLOSURE_COVERED
    if (closure.under_interface > 0.0) {
        float factor = interface_factor(closure, light);
        value.diffuse *= factor;
        value.subsurface *= factor;
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
    vec3 h = half_vector(closure.view, light);
    float pdf = closure.specular_probability * specular_lobe_pdf(closure.specular, closure.view, light, h);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u)
        pdf += closure.second_probability * specular_lobe_pdf(closure.second, closure.view, light, h);
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

ClosureSample sample_specular_lobe(SpecularLobe lobe, vec3 view, float probability, float random_x, float random_y) {
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
            result = sample_specular_lobe(closure.second, closure.view, closure.second_probability, random.y, random.z);
    }
#endif
    if (!chosen && closure.specular_probability <= 0.0) return result;
    if (!chosen)
        result = sample_specular_lobe(closure.specular, closure.view, closure.specular_probability, random.y, random.z);
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
    albedo.diffuse = closure.diffuse;
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
