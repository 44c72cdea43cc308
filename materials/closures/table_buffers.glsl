// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_TABLE_BUFFERS
#define NACRE_CLOSURES_TABLE_BUFFERS
// The tables that the closures ask for, out of buffers that hold their words as they are, two in each uint. Who
// includes this has declared uint interface_words[] and, where slabs have the features, anisotropy_words[] and
// medium_words[]. Reading them interpolated is the same on every device, which a texture's filter is not.
#ifndef interface_pair
#define interface_pair(entry, column, row) \
    uvec2(interface_words[(entry).y * 128 + (entry).x * 2 + ((row) * 128 + (column) * 2)], \
          interface_words[(entry).y * 128 + (entry).x * 2 + ((row) * 128 + (column) * 2 + 1)])
#define anisotropy_word(at) anisotropy_words[at]
#define medium_word(at) medium_words[at]
#endif

vec4 interface_entry(uvec2 pair) { return vec4(unpackUnorm2x16(pair.x), unpackUnorm2x16(pair.y)); }

vec4 interface_table(vec2 at) {
    vec2 place = clamp(at, vec2(0.0), vec2(1.0)) * vec2(63.0, 95.0);
    ivec2 entry = min(ivec2(place), ivec2(62, 94));
    vec2 part = place - vec2(entry);
    return mix(mix(interface_entry(interface_pair(entry, 0, 0)), interface_entry(interface_pair(entry, 1, 0)), part.x),
               mix(interface_entry(interface_pair(entry, 0, 1)), interface_entry(interface_pair(entry, 1, 1)), part.x),
               part.y);
}

#ifdef NACRE_SLAB_MEDIUM
vec2 medium_row(ivec3 at, vec3 part) {
    int word = (at.z * 41 + at.y) * 16 + at.x;
    return mix(unpackUnorm2x16(medium_word(word)), unpackUnorm2x16(medium_word(word + 1)), part.x);
}

vec2 medium_slice(ivec3 at, vec3 part) {
    return mix(medium_row(at, part), medium_row(ivec3(at.x, at.y + 1, at.z), part), part.y);
}

vec2 medium_table(vec3 at) {
    vec3 place = clamp(at, vec3(0.0), vec3(1.0)) * vec3(15.0, 40.0, 23.0);
    ivec3 entry = min(ivec3(place), ivec3(14, 39, 22));
    vec3 part = place - vec3(entry);
    return mix(medium_slice(entry, part), medium_slice(ivec3(entry.x, entry.y, entry.z + 1), part), part.z);
}
#endif

#ifdef NACRE_SLAB_ANISOTROPY
vec2 anisotropy_table(vec4 at) {
    vec4 place = clamp(at, vec4(0.0), vec4(1.0));
    vec3 scaled = vec3(place.x, place.y, place.z) * vec3(17.0, 14.0, 14.0);
    ivec3 entry = min(ivec3(scaled), ivec3(16, 13, 13));
    vec3 part = scaled - vec3(entry);
    float w = 3.0 * place.w;
    vec4 curve = vec4((1.0 - w) * (2.0 - w) * (3.0 - w) / 6.0, 0.5 * w * (2.0 - w) * (3.0 - w),
                      0.5 * w * (w - 1.0) * (3.0 - w), w * (w - 1.0) * (w - 2.0) / 6.0);
    vec2 sum = vec2(0.0);
    for (int corner = 0; corner < 8; ++corner) {
        ivec3 offset = ivec3(corner & 1, corner >> 1 & 1, corner >> 2);
        vec3 weight = mix(vec3(1.0) - part, part, vec3(offset));
        ivec3 index = entry + offset;
        int word = (index.z * 15 + index.y) * 18 + index.x;
        sum += weight.x * weight.y * weight.z *
               (curve.x * unpackUnorm2x16(anisotropy_word(word)) +
                curve.y * unpackUnorm2x16(anisotropy_word(word + 4050)) +
                curve.z * unpackUnorm2x16(anisotropy_word(word + 8100)) +
                curve.w * unpackUnorm2x16(anisotropy_word(word + 12150)));
    }
    return sum;
}
#endif

#endif
