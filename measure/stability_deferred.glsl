// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_STABILITY_DEFERRED
#define NACRE_STABILITY_DEFERRED
#include "materials/closures/blending.glsl"
// Stands before the text of a tree (materials/tree_shader.h) where a driver puts every function in the place of its
// calls: a tree of 16 layers has 49 calls of what makes three thousand instructions.
//
// The text runs round by round. In each the call whose turn it is keeps its operands only; it is computed behind the
// text, where each function stands once, and has its result from the next round on. Calls before it have theirs; what
// those after it give does not count yet. Defined before: DEFERRED_CALLS, how many
// there are.

// A closure that is yet to be prepared.
struct Unprepared {
    Slab slab;
    vec3 view;
    float footprint;
};

ClosureValue evaluate_closure(Unprepared closure, vec3 light) {
    return evaluate_closure(prepare_closure(closure.slab, closure.view, closure.footprint), light);
}

const uint slab_call = 1u;
const uint layer_call = 2u;
const uint path_call = 3u;

Matter deferred_matters[DEFERRED_CALLS];
Path deferred_paths[DEFERRED_CALLS];
uint deferred_turn;  // the call that is computed in this round
uint deferred_call;  // the one that the text comes to next

// Operands of the call whose turn it is.
uint turn_kind;
Unprepared turn_closure;
Path turn_path;
Matter turn_top;
Matter turn_base;
Widening turn_widening;

// 1 where the text has come to the call whose turn it is. For a loop where a condition would do: what has no loop in it
// is one block to these drivers, and parts of their compilers take longer than in proportion to a block's length.
uint is_turn() { return deferred_call == deferred_turn ? 1u : 0u; }

Matter deferred_slab_matter(Unprepared closure) {
    for (uint turns = is_turn(); turns > 0u; --turns) {
        turn_kind = slab_call;
        turn_closure = closure;
    }
    return deferred_matters[deferred_call++];
}

Matter deferred_layer_matter(Matter top, Matter base) {
    for (uint turns = is_turn(); turns > 0u; --turns) {
        turn_kind = layer_call;
        turn_top = top;
        turn_base = base;
    }
    return deferred_matters[deferred_call++];
}

Path deferred_path_through_layer(Path path, Matter top, Matter base, Widening widening) {
    for (uint turns = is_turn(); turns > 0u; --turns) {
        turn_kind = path_call;
        turn_path = path;
        turn_top = top;
        turn_base = base;
        turn_widening = widening;
    }
    return deferred_paths[deferred_call++];
}

void take_turn() {
    Matter matter = no_matter();
    Path path = open_path();
    if (turn_kind == slab_call)
        matter = slab_matter(turn_closure.slab,
                             prepare_closure(turn_closure.slab, turn_closure.view, turn_closure.footprint));
    if (turn_kind == layer_call) matter = layer_matter(turn_top, turn_base);
    if (turn_kind == path_call) path = path_through_layer(turn_path, turn_top, turn_base, turn_widening);
    deferred_matters[deferred_turn] = matter;
    deferred_paths[deferred_turn] = path;
}

// `count`, in a way that no compiler sees through: loops that count so far are not unrolled.
uint unknown(uint count) { return points.length() > 0 ? count : 0u; }

void begin_rounds() {
    for (uint i = 0u; i < unknown(DEFERRED_CALLS); ++i) {
        deferred_matters[i] = no_matter();
        deferred_paths[i] = open_path();
    }
    deferred_turn = 0u;
    turn_kind = 0u;
}

#define prepare_closure(slab, view, footprint) Unprepared(slab, view, footprint)
#define slab_matter(slab, closure) deferred_slab_matter(closure)
#define layer_matter(top, base) deferred_layer_matter(top, base)
#define path_through_layer(path, top, base, widening) deferred_path_through_layer(path, top, base, widening)

#endif
