// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/hostile/seed_shaders.h"

#include "rhi/shader_compiler.h"
#include "tests/rhi/assembly.h"

namespace nacre::hostile {
namespace {

struct GlslSeed {
    const char* path;
    const char* text;
};

const GlslSeed glsl_seeds[] = {
    {"arithmetic.comp", R"(
layout(local_size_x = 32) in;
layout(set = 0, binding = 0) buffer Result { uvec4 result[]; };
layout(set = 0, binding = 1) readonly buffer Numbers { ivec4 numbers[]; };
layout(set = 0, binding = 2) uniform Reals { vec4 reals[8]; mat3 matrix; };
void main() {
    uint id = gl_GlobalInvocationID.x;
    ivec4 n = numbers[id & 7u];
    vec4 r = reals[id & 7u] * vec4(n) + vec4(0.5);
    int q = n.x / n.y + n.z % (n.w + 1);
    uint s = uint(n.x) << (n.y & 31);
    r.xyz = matrix * r.xyz;
    vec3 c = cross(r.xyz, normalize(r.zyx)) + mix(r.xyz, r.yzw, 0.25);
    bool any_small = any(lessThan(r, vec4(3.0)));
    int folded = bitfieldExtract(n.x, 3, 7) + findMSB(uint(n.y)) + bitCount(n.z);
    result[id] = uvec4(uint(q), s, floatBitsToUint(sin(c.x) + exp2(c.y) * sqrt(abs(c.z))), any_small ? uint(folded) : packHalf2x16(r.xy));
}
)"},
    {"memory.comp", R"(
layout(local_size_x = 16) in;
struct Inner { vec3 a; int b[3]; mat2x3 m; };
struct Outer { Inner inner[2]; uint count; };
layout(set = 0, binding = 0, std430) buffer Result { uint first; Outer items[4]; uint rest[]; } result;
layout(set = 0, binding = 1, std140) uniform Constants { Outer fixed_items[3]; int selected; };
layout(push_constant) uniform Push { vec4 color; int index[4]; } push;
shared Inner together[16];
Inner kept[2];
const int table[6] = int[](5, 3, 8, 1, 9, 2);
void main() {
    uint id = gl_LocalInvocationIndex;
    int i = push.index[id & 3u] + selected;
    kept[0] = fixed_items[id % 3u].inner[i & 1];
    kept[1].b[i % 3] = table[i % 6];
    together[id] = kept[i & 1];
    barrier();
    vec3 local[4];
    for (int j = 0; j < 4; ++j) local[j] = together[(int(id) + j) & 15].a + vec3(push.color[j]);
    result.items[id & 3u].inner[1] = kept[1];
    result.items[id & 3u].inner[0].m[1][i] = local[i & 3].y;
    result.rest[id] = uint(local[i].x) + result.items[i].count + uint(result.rest.length());
    result.items[1].inner[1].b[i] = i;
}
)"},
    {"texels.comp", R"(
#extension GL_EXT_nonuniform_qualifier : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Result { uvec4 result[]; };
layout(set = 0, binding = 1) uniform samplerBuffer reals;
layout(set = 0, binding = 2) uniform usamplerBuffer words[3];
layout(set = 0, binding = 3, r32ui) uniform uimageBuffer counters;
layout(set = 0, binding = 4, rgba16f) uniform imageBuffer halves;
layout(set = 0, binding = 5, r32i) uniform readonly iimageBuffer numbers;
void main() {
    uint id = gl_LocalInvocationIndex;
    int at = imageLoad(numbers, int(id)).x;
    vec4 real = texelFetch(reals, at) + texelFetch(reals, textureSize(reals) - 1 - int(id));
    uvec4 word = texelFetch(words[nonuniformEXT(id % 3u)], int(id)) + texelFetch(words[1], at & 15);
    uint old = imageAtomicAdd(counters, int(id) & 3, word.x) + imageAtomicCompSwap(counters, at, 2u, word.y);
    if ((id & 1u) == 0u) imageStore(halves, int(id) / 2, real * 0.5);
    imageStore(counters, imageSize(counters) - 1, uvec4(old));
    result[id] = floatBitsToUint(imageLoad(halves, int(id))) + uvec4(old);
}
)"},
    {"flow.comp", R"(
layout(local_size_x = 24) in;
layout(set = 0, binding = 0) buffer Result { int result[]; };
layout(set = 0, binding = 1) readonly buffer Numbers { int n[]; };
int step_of(int x, inout int state) {
    for (int i = 0; i < 5; ++i) {
        if ((x & 1) == 0) { x = x / 2 + state; continue; }
        x = 3 * x + 1;
        state ^= x;
        if (x > 200) return x;
        switch (x % 5) { case 0: x += 1; case 1: x ^= state; break; case 2: state += x; default: x -= 3; }
    }
    return x ^ state;
}
void main() {
    int id = int(gl_GlobalInvocationID.x), state = n[id & 63], sum = 0;
    do {
        sum += step_of(state + sum, state);
        if (sum == 77) break;
        for (int i = 0; i < (id & 3); ++i) { sum += i; if (sum > 1000) break; }
        --state;
    } while (state > 0 && sum < 5000);
    if (id == 13) return;
    result[id] = sum;
}
)"},
    {"barriers.comp", R"(
layout(local_size_x = 48) in;
layout(set = 0, binding = 0) buffer Result { uint result[]; };
shared uint values[48];
shared uint total;
void main() {
    uint id = gl_LocalInvocationIndex;
    if (id == 0u) total = 0u;
    values[id] = id * id;
    barrier();
    for (uint step = 1u; step < 48u; step *= 2u) {
        uint other = id + step < 48u ? values[id + step] : 0u;
        barrier();
        values[id] += other;
        barrier();
    }
    atomicAdd(total, values[id]);
    memoryBarrierShared();
    barrier();
    result[gl_WorkGroupID.x * 48u + id] = values[id] ^ total;
    atomicMax(result[id & 7u], total);
}
)"},
    {"atomics.comp", R"(
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Result { uint sums[16]; int least[16]; uint old[]; };
shared int shared_sum[4];
void main() {
    uint id = gl_LocalInvocationIndex;
    shared_sum[id & 3u] = 0;
    barrier();
    atomicAdd(shared_sum[id % 5u], int(id));
    uint before = atomicAdd(sums[id & 7u], id);
    before ^= atomicExchange(sums[8u + (id & 3u)], before);
    before += atomicCompSwap(sums[12], id, before);
    atomicMin(least[id], int(before));
    atomicOr(sums[id], 1u << (id & 31u));
    barrier();
    old[id] = before + uint(shared_sum[id & 3u]);
}
)"},
    {"subgroups.comp", R"(
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_clustered : require
#extension GL_KHR_shader_subgroup_quad : require
layout(local_size_x = 32) in;
layout(set = 0, binding = 0) buffer Result { uint result[]; };
layout(set = 0, binding = 1) readonly buffer Numbers { uint n[]; };
void main() {
    uint id = gl_LocalInvocationIndex, x = n[id];
    uint sum = subgroupAdd(x) + subgroupExclusiveMul(x | 1u);
    if ((x & 1u) != 0u) sum += subgroupMax(x) ^ subgroupInclusiveAdd(id);
    uvec4 ballot = subgroupBallot(x > 5u);
    sum += subgroupBallotBitCount(ballot) + subgroupShuffle(x, x) + subgroupShuffleUp(x, x & 3u);
    sum ^= subgroupClusteredXor(x, 4u) + subgroupQuadBroadcast(x, 2u) + subgroupQuadSwapHorizontal(x);
    float f = subgroupMin(float(x)) + subgroupBroadcast(float(id), 3u);
    result[id] = subgroupAll(sum > 3u) ? sum : uint(f) + gl_SubgroupInvocationID + gl_NumSubgroups;
}
)"},
    {"widths.comp", R"(
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_8bit_storage : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Result { int64_t wide[16]; double reals[16]; int16_t shorts[16]; uint8_t bytes[32]; float16_t halves[]; };
void main() {
    uint id = gl_LocalInvocationIndex;
    int64_t w = wide[id] * int64_t(id) + (wide[(id + 1u) & 15u] >> id);
    double d = sqrt(reals[id] * 2.0lf) + double(w);
    int16_t s = shorts[id] / int16_t(id | 1u) + int16_t(w);
    uint8_t b = bytes[id] << uint8_t(id & 7u);
    float16_t h = halves[id] * float16_t(0.5) + float16_t(d);
    f16vec4 hv = f16vec4(h, h + float16_t(1), float16_t(s), float16_t(b));
    wide[id] = w + int64_t(s);
    reals[id] = min(d, double(dot(hv, hv)));
    shorts[id] = s + int16_t(b);
    bytes[id + 16u] = b;
    halves[id] = max(h, hv.z);
}
)"},
    {"images.comp", R"(
layout(local_size_x = 8, local_size_y = 4) in;
layout(set = 0, binding = 0, rgba8) uniform image2D target;
layout(set = 0, binding = 1, r32ui) uniform uimage2DArray counters;
layout(set = 0, binding = 2, r32f) uniform image3D volume;
layout(set = 0, binding = 3) uniform sampler2D picture;
layout(set = 0, binding = 4) uniform samplerCube sky;
layout(set = 0, binding = 5) uniform usampler2DArray layers;
layout(set = 0, binding = 6) uniform sampler2DShadow depth;
layout(set = 0, binding = 7) uniform sampler1D line;
layout(set = 1, binding = 0) uniform texture3D solid;
layout(set = 1, binding = 1) uniform sampler how;
layout(set = 1, binding = 2) buffer Result { vec4 result[]; };
void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    vec4 c = textureLod(picture, vec2(p) * 0.13, 0.5) + texelFetch(picture, p, 1);
    c += textureLod(sky, vec3(p, 1.0) - 3.0, 1.0) + vec4(texelFetch(layers, ivec3(p, 1), 0));
    c += textureLod(depth, vec3(p, 0.5) * 0.1, 0.0) + textureLod(line, c.x, 0.0);
    c += textureLod(sampler3D(solid, how), vec3(p, 2.0) * 0.2, 0.0) + textureGather(picture, vec2(p) * 0.1, 1);
    c += textureGrad(picture, vec2(p), vec2(0.1, 0.0), vec2(0.0, 0.3)) + textureLodOffset(picture, vec2(0.4), 0.0, ivec2(1, -2));
    uint before = imageAtomicAdd(counters, ivec3(p, p.x & 1), uint(p.y));
    imageAtomicMax(counters, ivec3(p.yx, 5), before);
    imageStore(target, p - 2, c + imageLoad(target, p.yx));
    imageStore(volume, ivec3(p, p.x), vec4(float(before)));
    result[p.x] = vec4(vec2(textureSize(picture, 0)), vec2(imageSize(volume).xy)) + float(textureQueryLevels(sky));
}
)"},
    {"bindless.comp", R"(
#extension GL_EXT_nonuniform_qualifier : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) uniform sampler2D pictures[];
layout(set = 1, binding = 0) buffer Item { uint values[4]; } items[4];
layout(set = 1, binding = 1) uniform Block { vec4 value; } blocks[3];
layout(set = 1, binding = 2) uniform texture2D few[4];
layout(set = 1, binding = 3) uniform sampler hows[2];
layout(set = 1, binding = 4, rgba32f) uniform image2D targets[2];
layout(set = 1, binding = 5) buffer Result { vec4 result[]; };
void main() {
    uint id = gl_LocalInvocationIndex;
    uint which = items[id & 3u].values[id & 3u];
    vec4 c = textureLod(pictures[nonuniformEXT(which)], vec2(0.3), 0.0) + blocks[id % 3u].value;
    c += textureLod(sampler2D(few[nonuniformEXT(which & 3u)], hows[id & 1u]), vec2(0.7), 0.0);
    c += imageLoad(targets[id & 1u], ivec2(id));
    items[nonuniformEXT(which)].values[id] = id;
    imageStore(targets[which & 1u], ivec2(id, which), c);
    result[id] = c;
}
)"},
    {"rays.comp", R"(
#extension GL_EXT_ray_query : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1) buffer Result { vec4 result[]; };
void main() {
    float x = float(gl_LocalInvocationIndex) * 0.2 - 1.5;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, vec3(x, 0.1, -3.0), 0.01, vec3(0.05, 0.0, 1.0), 100.0);
    int candidates = 0;
    while (rayQueryProceedEXT(query)) {
        ++candidates;
        if (rayQueryGetIntersectionBarycentricsEXT(query, false).x > 0.2) rayQueryConfirmIntersectionEXT(query);
    }
    vec4 found = vec4(candidates);
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT)
        found = vec4(rayQueryGetIntersectionTEXT(query, true), rayQueryGetIntersectionPrimitiveIndexEXT(query, true),
                     rayQueryGetIntersectionObjectToWorldEXT(query, true)[3].xy);
    result[gl_LocalInvocationIndex] = found;
}
)"},
    {"matrices.comp", R"(
layout(local_size_x = 8) in;
layout(set = 0, binding = 0, row_major) buffer Matrices { mat4 a; mat3x2 b[3]; mat2x4 c; } m;
layout(set = 0, binding = 1) buffer Result { mat4 result[]; };
void main() {
    uint id = gl_LocalInvocationIndex;
    mat4 x = m.a * transpose(m.a) + outerProduct(vec4(id), m.c[id & 1u]);
    x[id & 3u] = vec4(m.b[id % 3u] * vec3(1.0, 2.0, 3.0), m.c[1].xy);
    x[2][id & 3u] += determinant(m.a);
    mat3 y = inverse(mat3(x));
    m.b[id % 3u][1] = y[0].xy;
    result[id] = x * y[1].x;
}
)"},
    {"specialized.comp", R"(
layout(local_size_x_id = 0, local_size_y = 2) in;
layout(constant_id = 0) const uint width = 8;
layout(constant_id = 1) const int count = 5;
layout(constant_id = 2) const bool doubles = true;
layout(set = 0, binding = 0) buffer Result { int result[]; };
int numbers[count];
void main() {
    for (int i = 0; i < count; ++i) numbers[i] = i * int(gl_LocalInvocationIndex) * (doubles ? 2 : 1);
    result[gl_LocalInvocationIndex] = numbers[int(width) % count];
}
)"},
    {"shading.frag", R"(
layout(location = 0) in vec4 color;
layout(location = 1) in vec2 place;
layout(location = 2) flat in uint material;
layout(location = 0) out vec4 target;
layout(location = 1) out uvec2 identifiers;
layout(set = 0, binding = 0) uniform sampler2D picture;
layout(set = 0, binding = 1) readonly buffer Materials { vec4 tints[]; };
void main() {
    vec4 c = texture(picture, place) * color + tints[material & 7u];
    if (c.a < 0.1) discard;
    vec2 d = vec2(dFdx(place.x), dFdy(place.y)) + fwidth(c.xy);
    for (int i = 0; i < int(material & 3u); ++i) { c = c.yzwx + d.xyxy; if (c.x > 9.0) break; }
    target = vec4(c.rgb, gl_FrontFacing ? 1.0 : 0.5) + gl_FragCoord * 0.01;
    identifiers = uvec2(material, uint(gl_FragCoord.x));
}
)"},
    {"depth.frag", R"(
layout(location = 0) in vec3 normal;
layout(location = 0) out ivec4 target;
layout(set = 0, binding = 0) buffer Count { uint fragments; uint words[]; };
layout(set = 0, binding = 1, r32ui) uniform uimage2D seen;
void main() {
    uint before = atomicAdd(fragments, 1u);
    gl_FragDepth = normal.x * 0.1;
    if ((before & 3u) == 1u) { imageStore(seen, ivec2(gl_FragCoord.xy), uvec4(before)); discard; }
    words[before] = uint(gl_SampleMaskIn[0]) + uint(gl_HelperInvocation);
    target = ivec4(normal * 20.0, before);
}
)"},
    {"vertices.vert", R"(
layout(location = 0) in vec4 position;
layout(location = 1) in ivec3 numbers;
layout(location = 2) in mat2 turn;
layout(location = 0) out vec4 color;
layout(location = 1) flat out uint which;
layout(set = 0, binding = 0) uniform Camera { mat4 view_projection; vec4 planes[2]; };
layout(set = 0, binding = 1) readonly buffer Offsets { vec4 offsets[]; };
out gl_PerVertex { vec4 gl_Position; float gl_PointSize; float gl_ClipDistance[2]; };
void main() {
    vec4 p = position + offsets[gl_InstanceIndex & 3];
    p.xy = turn * p.xy;
    gl_Position = view_projection * p;
    gl_PointSize = float(numbers.x & 7);
    for (int i = 0; i < 2; ++i) gl_ClipDistance[i] = dot(p, planes[i]);
    color = normalize(p) + float(gl_VertexIndex);
    which = uint(numbers[gl_VertexIndex % 3]);
}
)"},
    {"calls.comp", R"(
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Result { uint result[]; };
struct State { uint a, b; vec2 c[2]; };
uint counter = 0u;
void mix_state(inout State s, const uint x, out uint last) {
    s.a = s.a * 1664525u + x;
    s.b ^= s.a >> 3;
    s.c[x & 1u] += vec2(s.a & 255u, s.b & 255u);
    last = s.b;
    ++counter;
}
State twice(State s) { uint last; mix_state(s, 1u, last); mix_state(s, last, last); s.a += last; return s; }
uint deep(uint x) { State s = State(x, x + 1u, vec2[2](vec2(0), vec2(1))); s = twice(twice(s)); return s.a ^ s.b ^ uint(s.c[0].x); }
void main() {
    uint id = gl_LocalInvocationIndex;
    uint a = deep(id);
    if (id > 4u) a += deep(a & 15u);
    result[id] = a + counter;
}
)"},
};

/// Control flow that no compiler of GLSL writes, and pointers that depend on it.
const char* const assembled_seed = R"(
OpCapability Shader
OpCapability VariablePointers
OpMemoryModel Logical GLSL450
OpEntryPoint GLCompute %main "main" %index
OpExecutionMode %main LocalSize 16 1 1
OpDecorate %index BuiltIn LocalInvocationIndex
OpDecorate %result DescriptorSet 0
OpDecorate %result Binding 0
OpDecorate %uints ArrayStride 4
OpDecorate %block Block
OpMemberDecorate %block 0 Offset 0
OpDecorate %pointer ArrayStride 4
%void = OpTypeVoid
%bool = OpTypeBool
%uint = OpTypeInt 32 0
%uints = OpTypeRuntimeArray %uint
%block = OpTypeStruct %uints
%block_pointer = OpTypePointer StorageBuffer %block
%pointer = OpTypePointer StorageBuffer %uint
%input_pointer = OpTypePointer Input %uint
%c0 = OpConstant %uint 0
%c1 = OpConstant %uint 1
%c2 = OpConstant %uint 2
%c7 = OpConstant %uint 7
%c16 = OpConstant %uint 16
%array = OpTypeArray %uint %c16
%array_pointer = OpTypePointer Workgroup %array
%shared_pointer = OpTypePointer Workgroup %uint
%local_array_pointer = OpTypePointer Function %array
%local_pointer = OpTypePointer Function %uint
%index = OpVariable %input_pointer Input
%result = OpVariable %block_pointer StorageBuffer
%shared = OpVariable %array_pointer Workgroup
%main_type = OpTypeFunction %void
%main = OpFunction %void None %main_type
%entry = OpLabel
%local = OpVariable %local_array_pointer Function
%id = OpLoad %uint %index
%a = OpAccessChain %pointer %result %c0 %id
%b = OpAccessChain %pointer %result %c0 %c7
%s = OpAccessChain %shared_pointer %shared %id
OpStore %s %id
%l = OpAccessChain %local_pointer %local %id
OpStore %l %c7
%odd = OpBitwiseAnd %uint %id %c1
%is_odd = OpINotEqual %bool %odd %c0
%chosen = OpSelect %pointer %is_odd %a %b
OpSelectionMerge %merge None
OpSwitch %id %default 0 %case0 1 %case1 2 %case1 5 %merge
%case0 = OpLabel
OpBranch %case1
%case1 = OpLabel
%in_case = OpPhi %uint %c1 %entry %c2 %case0
OpStore %chosen %in_case
OpBranch %default
%default = OpLabel
%in_default = OpPhi %uint %id %entry %in_case %case1
OpBranch %merge
%merge = OpLabel
%x = OpPhi %uint %c7 %entry %in_default %default
OpBranch %loop
%loop = OpLabel
%i = OpPhi %uint %c0 %merge %next %continue
%p = OpPhi %pointer %chosen %merge %moved %continue
OpLoopMerge %behind %continue None
OpBranch %body
%body = OpLabel
%v = OpLoad %uint %p
%w = OpIAdd %uint %v %x
%leave = OpUGreaterThan %bool %w %c16
OpSelectionMerge %inner None
OpBranchConditional %leave %break %inner
%break = OpLabel
OpBranch %behind
%inner = OpLabel
OpStore %p %w
OpBranch %continue
%continue = OpLabel
%next = OpIAdd %uint %i %c1
%moved = OpPtrAccessChain %pointer %p %c1
%again = OpULessThan %bool %next %c7
OpBranchConditional %again %loop %behind
%behind = OpLabel
%sum = OpPhi %uint %w %break %next %continue
%t = OpAccessChain %shared_pointer %shared %sum
%from = OpLoad %uint %t
OpStore %a %from
OpReturn
OpFunctionEnd
)";

}  // namespace

Expected<std::vector<SeedShader>> seed_shaders() {
    rhi::ShaderCompiler compiler({.debug_information = false});
    std::vector<SeedShader> made;
    for (const GlslSeed& seed : glsl_seeds) {
        NACRE_TRY(rhi::ShaderDesc desc, compiler.compile({.path = seed.path, .text = seed.text}));
        made.push_back({seed.path, desc.stage, std::move(desc.spirv)});
    }
    NACRE_TRY(std::vector<std::uint32_t> words, rhi::test::assemble(assembled_seed));
    made.push_back({"pointers.comp", rhi::ShaderStage::compute, std::move(words)});
    return made;
}

}  // namespace nacre::hostile
