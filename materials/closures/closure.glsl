// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_CLOSURE
#define NACRE_CLOSURES_CLOSURE
// A slab seen from one direction: everything that depends on slab and view is computed once, lights follow.
//
// All vectors are unit and in the local frame: z is the normal, x the tangent, y the bitangent; they point away from the
// surface. Light directions below the surface (z < 0) ask for what the medium scatters through. Values include the cosine to
// the light. Angles down to 1e-7 rad above the surface are handled; a view below that is moved there.
//
//     Closure prepare_closure(Slab slab, vec3 view, float footprint)
//         footprint: meters that a pixel (or ray cone) covers on the surface; decides what the medium scatters within it
//     ClosureValue evaluate_closure(Closure closure, vec3 light)
//     ClosureSample sample_closure(Closure closure, vec3 random)      random: [0, 1)^3
//     float closure_pdf(Closure closure, vec3 light)                  solid angle, of sample_closure without mirrors
//     ClosureAlbedo closure_albedo(Closure closure)                   towards the view, under white light from everywhere
//     vec3 closure_transmittance(Closure closure, float cos_theta)    straight through the medium, from an outer direction
//     vec3 closure_throughput(Closure closure)                        view: through fuzz, interface and medium, to what is below
//     vec3 internal_reflectance(Slab slab)                            of diffuse light that hits the interface from below
//     vec3 bounce_factor(vec3 internal, vec3 base_albedo)             (1 - K) / (1 - E_b K)

struct ClosureValue {
    vec3 specular;    // interface and fuzz
    vec3 diffuse;     // the medium, where the light entered
    vec3 subsurface;  // the medium, leaving elsewhere: to be spread by its mean free path
};

struct ClosureSample {
    vec3 direction;
    float pdf;     // solid angle; for a mirror the probability of that choice; 0: nothing was sampled
    vec3 weight;   // value times cosine over pdf
    bool is_mirror;  // evaluate_closure and closure_pdf do not see this direction
};

struct ClosureAlbedo {
    vec3 specular;
    vec3 fuzz;
    vec3 diffuse;       // and subsurface
    vec3 transmission;  // scattered through; what passes straight is closure_throughput
};

#endif
