// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "tests/backends/cpu/differential/generator.h"

namespace nacre::differential {

namespace {

const char* const shared_text = R"(
struct Mixed { int a; vec3 b; uint c[3]; mat2x3 d; float e; ivec2 f; };
struct Item { Mixed s; mat4x3 m; mat2x4 k[2]; int x[5]; vec3 y; uvec2 z; mat3 n; };
layout(set = 0, binding = 0, std430) readonly buffer Input { uint words[256]; };
layout(set = 0, binding = 1, std140) uniform Numbers { uvec4 w; ivec3 i; int one; int list[4]; uvec2 pairs[3]; } numbers_block;
layout(set = 0, binding = 2, std140) uniform Reals { float f; vec3 v; layout(row_major) mat3x4 m; mat2x3 n; Mixed s[3];
    layout(row_major) mat2x3 q[2]; vec2 list[3]; layout(row_major) mat3x2 r; vec4 last; } reals_block;
layout(set = 0, binding = 3) uniform usampler2D numbers;
)";

const char* const compute_text = R"(
layout(set = 0, binding = 4, std430) buffer Result { uint result[]; };
layout(set = 0, binding = 5, std430) buffer Items { uint head; layout(row_major) Item items[]; };
layout(set = 0, binding = 6, std430) buffer Counters { uint counters[24]; };
layout(set = 0, binding = 7, std430) buffer Pairs { vec2 pairs[]; };
layout(set = 0, binding = 8, r32ui) uniform uimage2D texels;
)";

/// Numbers that are neither tiny nor huge, infinite, zero or not a number; small whole ones; matrices of those.
std::string helpers() {
    std::string text;
    text += "float keep(float x) { return abs(x) < 1000000.0 && abs(x) > 0.000001 ? x : 0.25; }\n";
    text += "vec2 keep(vec2 v) { return vec2(keep(v.x), keep(v.y)); }\n";
    text += "vec3 keep(vec3 v) { return vec3(keep(v.x), keep(v.y), keep(v.z)); }\n";
    text += "vec4 keep(vec4 v) { return vec4(keep(v.x), keep(v.y), keep(v.z), keep(v.w)); }\n";
    text += "float whole(float x) { return float(int(keep(x)) & 63); }\n";
    for (int size = 2; size <= 4; ++size)
        text += fmt::format("vec{0} whole(vec{0} x) {{ return vec{0}(ivec{0}(keep(x)) & 63); }}\n", size);
    for (int columns = 2; columns <= 4; ++columns)
        for (int rows = 2; rows <= 4; ++rows) {
            std::string parts;
            // Products and sums of such matrices are far from what no int can hold.
            for (int i = 0; i < columns; ++i)
                parts += fmt::format("{}vec{}(ivec{}(x[{}]) & 63)", i ? ", " : "", rows, rows, i);
            text += fmt::format("mat{0}x{1} fold(mat{0}x{1} x) {{ return mat{0}x{1}({2}); }}\n", columns, rows, parts);
        }
    return text;
}

constexpr GlslType real(int size) { return {Kind::real, size, 1}; }
constexpr GlslType integer(int size) { return {Kind::integer, size, 1}; }
constexpr GlslType natural(int size) { return {Kind::natural, size, 1}; }
constexpr GlslType matrix(int columns, int rows) { return {Kind::matrix, rows, columns}; }

std::vector<Place> members_of_mixed(const std::string& text, int count, bool writable, bool is_uniform) {
    return {
        {.text = text + ".a", .type = integer(1), .count = count, .writable = writable, .is_uniform = is_uniform},
        {.text = text + ".b", .type = real(3), .count = count, .writable = writable, .is_uniform = is_uniform},
        {.text = text + ".c[#]",
         .type = natural(1),
         .count = count,
         .inner_count = 3,
         .writable = writable,
         .is_uniform = is_uniform},
        {.text = text + ".d", .type = matrix(2, 3), .count = count, .writable = writable, .is_uniform = is_uniform},
        {.text = text + ".e", .type = real(1), .count = count, .writable = writable, .is_uniform = is_uniform},
        {.text = text + ".f", .type = integer(2), .count = count, .writable = writable, .is_uniform = is_uniform},
    };
}

}  // namespace

Generator::Generator(std::uint64_t seed) : random_(seed) { shader_.seed = seed; }

void Generator::declarations() {
    shader_.text = std::string(loop_guard) + "\n";
    if (shader_.stage == Stage::compute) {
        struct Size {
            int x, y, z;
        };
        const Size size = random_.pick({Size{64, 1, 1}, Size{16, 1, 1}, Size{32, 2, 1}, Size{8, 4, 2}, Size{12, 1, 1},
                                        Size{5, 3, 3}, Size{20, 2, 1}, Size{1, 1, 1}, Size{3, 11, 1}, Size{128, 1, 1},
                                        Size{8, 1, 1}, Size{16, 4, 1}});
        shader_.invocations = static_cast<std::uint32_t>(size.x * size.y * size.z);
        line(
            fmt::format("layout(local_size_x = {}, local_size_y = {}, local_size_z = {}) in;", size.x, size.y, size.z));
        uses_barriers_ = random_.chance(50);
    } else if (shader_.stage == Stage::fragment) {
        line("layout(location = 0) out uvec4 color;");
        line("layout(location = 0) flat in uvec4 flat_input;");
        line("layout(location = 1) in vec2 ramp;");
    } else {
        line("layout(location = 0) flat out uvec4 color;");
        line("layout(location = 0) in uvec4 per_vertex;");
    }
    shader_.text += shared_text;
    if (shader_.stage == Stage::compute) shader_.text += compute_text;
    if (uses_barriers_) {
        line(fmt::format("shared uint shown[{}];", shader_.invocations));
        line(fmt::format("shared Mixed own[{}];", shader_.invocations));
        line("shared uint tallies[6];");
    }
    shader_.text += helpers();
    line("uint identity = 0u;");
    line("uint hash = 2166136261u;");
    if (shader_.stage == Stage::compute) line("ivec2 place = ivec2(0);");

    const auto add = [&](std::string text, GlslType type, int count, bool is_uniform) {
        places_.push_back(
            {.text = std::move(text), .type = type, .count = count, .writable = false, .is_uniform = is_uniform});
    };
    add("identity", natural(1), 0, false);
    add("words[(identity + @) & 255u]", natural(1), 200, false);
    add("words[@]", natural(1), 256, true);
    add("numbers_block.w", natural(4), 0, true);
    add("numbers_block.i", integer(3), 0, true);
    add("numbers_block.one", integer(1), 0, true);
    add("numbers_block.list[@]", integer(1), 4, true);
    add("numbers_block.pairs[@]", natural(2), 3, true);
    add("reals_block.f", real(1), 0, true);
    add("reals_block.v", real(3), 0, true);
    add("reals_block.m", matrix(3, 4), 0, true);
    add("reals_block.n", matrix(2, 3), 0, true);
    add("reals_block.q[@]", matrix(2, 3), 2, true);
    add("reals_block.list[@]", real(2), 3, true);
    add("reals_block.r", matrix(3, 2), 0, true);
    add("reals_block.last", real(4), 0, true);
    const auto add_all = [&](const std::vector<Place>& members) {
        places_.insert(places_.end(), members.begin(), members.end());
    };
    add_all(members_of_mixed("reals_block.s[@]", 3, false, true));
    structures_.push_back("reals_block.s[@]");
    if (shader_.stage == Stage::compute) {
        add("gl_LocalInvocationID", natural(3), 0, false);
        add("gl_GlobalInvocationID", natural(3), 0, false);
        add("gl_WorkGroupID", natural(3), 0, true);
        add("gl_LocalInvocationIndex", natural(1), 0, false);
    } else if (shader_.stage == Stage::fragment) {
        add("flat_input", natural(4), 0, true);
        add("ivec2(gl_FragCoord.xy)", integer(2), 0, false);
        add("floor(ramp)", real(2), 0, false);
    } else {
        add("per_vertex", natural(4), 0, false);
        add("gl_VertexIndex", integer(1), 0, false);
        add("gl_InstanceIndex", integer(1), 0, true);
    }
    // Private variables.
    for (int i = random_.between(1, 4); i > 0; --i) {
        const GlslType type = random_type();
        const std::string name = fmt::format("g{}", names_++);
        if (random_.chance(30) && type.kind != Kind::matrix) {
            line(fmt::format("{0} {1}[4] = {0}[4]({2}, {3}, {2}, {2});", type.name(), name, literal(type),
                             literal(type)));
            places_.push_back({.text = name + "[@]", .type = type, .count = 4, .is_uniform = random_.chance(50)});
        } else {
            line(fmt::format("{} {} = {};", type.name(), name, literal(type)));
            places_.push_back({.text = name, .type = type, .is_uniform = random_.chance(50), .is_plain = true});
        }
    }
    if (random_.chance(50)) {
        const std::string name = fmt::format("g{}", names_++);
        line(fmt::format("Mixed {}[3];", name));
        initial_.push_back(fmt::format("for (int i = 0; i < 3; ++i) {}[i] = reals_block.s[i];", name));
        add_all(members_of_mixed(name + "[@]", 3, true, true));
        structures_.push_back(name + "[@]");
    }
}

void Generator::local_variables(int count) {
    for (int i = 0; i < count; ++i) declare();
}

void Generator::function(int number) {
    GlslFunction made;
    made.name = fmt::format("f{}", number);
    made.has_result = random_.chance(80);
    made.result = random_type();
    made.is_pure = random_.chance(50) && made.has_result;
    const std::size_t places = places_.size(), structures = structures_.size();
    std::vector<Place> hidden;
    if (made.is_pure) {
        // Nothing outside of it is written.
        hidden = places_;
        for (Place& place : places_) place.writable = false;
    }
    std::string list;
    std::vector<std::string> first;
    const int count = random_.between(1, 3);
    for (int i = 0; i < count; ++i) {
        Parameter parameter;
        parameter.type = random_type();
        const int way = made.is_pure ? 0 : random_.below(3);
        parameter.way = static_cast<Parameter::Way>(way);
        const std::string name = fmt::format("p{}", names_++);
        list += fmt::format("{}{} {} {}", i ? ", " : "",
                            way == 0   ? "in"
                            : way == 1 ? "out"
                                       : "inout",
                            parameter.type.name(), name);
        if (way == 1) first.push_back(fmt::format("{} = {};", name, literal(parameter.type)));
        places_.push_back({.text = name, .type = parameter.type, .is_plain = true});
        made.parameters.push_back(parameter);
    }
    current_ = &made;
    const bool was_divergent = is_divergent_;
    is_divergent_ = true;
    open(fmt::format("{} {}({})", made.has_result ? made.result.name() : "void", made.name, list));
    for (const std::string& text : first) line(text + first_value_mark);
    budget_ = random_.between(3, 7);
    local_variables(random_.between(0, 2));
    const bool pure = made.is_pure;
    structures_.resize(pure ? 0 : structures_.size());
    const auto saved = structures_;
    block(random_.between(2, 5));
    if (made.has_result) line(fmt::format("return {};", expression(made.result, 2)));
    close();
    current_ = nullptr;
    is_divergent_ = was_divergent;
    places_.resize(places);
    if (pure) places_ = hidden;
    structures_ = saved;
    structures_.resize(std::min(structures_.size(), structures));
    functions_.push_back(made);
}

void Generator::write_result() {
    if (shader_.stage == Stage::compute) {
        line(fmt::format("result[identity * {}u] = hash;", result_words));
        return;
    }
    std::string sum = "hash";
    line("color = uvec4(hash, hash * 3u + 1u, identity, 7u);");
}

void Generator::main_function() {
    open("void main()");
    if (shader_.stage == Stage::compute) {
        line("uvec3 grid = gl_WorkGroupID;");
        line(fmt::format("identity = gl_WorkGroupID.x * {}u + gl_LocalInvocationIndex;{}", shader_.invocations,
                         first_value_mark));
        line(fmt::format("place = ivec2(identity & 15u, identity >> 4);{}", first_value_mark));
    } else if (shader_.stage == Stage::fragment) {
        line("identity = uint(gl_FragCoord.x) + 16u * uint(gl_FragCoord.y);");
    } else {
        line("identity = uint(gl_VertexIndex);");
        line("gl_Position = vec4((vec2(identity & 15u, identity >> 4) + 0.5) / 8.0 - 1.0, 0.5, 1.0);");
        line("gl_PointSize = 1.0;");
    }
    for (const std::string& text : initial_) line(text + first_value_mark);
    if (uses_barriers_) {
        for (const char* text :
             {"own[gl_LocalInvocationIndex] = reals_block.s[identity % 3u];", "shown[gl_LocalInvocationIndex] = 99u;",
              "for (int i = 0; i < 6; ++i) if (gl_LocalInvocationIndex == 0u) tallies[i] = 1000u * uint(i) + 77u;",
              "barrier();"})
            line(text + std::string(first_value_mark));
        for (Place& place : members_of_mixed("own[gl_LocalInvocationIndex]", 1, true, false)) places_.push_back(place);
        structures_.push_back("own[gl_LocalInvocationIndex]");
    }
    if (shader_.stage == Stage::compute) {
        for (Place& place : members_of_mixed("items[identity].s", 1, true, false)) places_.push_back(place);
        structures_.push_back("items[identity].s");
        places_.push_back({.text = "items[identity].m", .type = matrix(4, 3)});
        places_.push_back({.text = "items[identity].n", .type = matrix(3, 3)});
        places_.push_back({.text = "items[identity].k[@]", .type = matrix(2, 4), .count = 2});
        places_.push_back({.text = "items[identity].x[@]", .type = integer(1), .count = 5});
        places_.push_back({.text = "items[identity].y", .type = real(3)});
        places_.push_back({.text = "items[identity].z", .type = natural(2)});
    }
    const std::size_t first_local = places_.size();
    local_variables(random_.between(2, 4));
    // Most are short, since compilers take their time by the line; a few are not.
    budget_ = random_.chance(95) ? random_.between(5, 15) : random_.between(20, 40);
    depth_ = 0;
    ++depth_;
    while (budget_ > 0) statement();
    --depth_;
    if (uses_barriers_ && !left_) {
        line("barrier();");
        line("hash = (hash ^ tallies[gl_LocalInvocationIndex % 6u]) * 16777619u;");
    }
    std::uint32_t word = 1;
    for (std::size_t i = first_local; i < places_.size() && word < result_words; ++i) {
        const Place place = places_[i];
        std::string text;
        for (const char letter : place.text) text += letter == '@' || letter == '#' ? "1" : std::string(1, letter);
        if (shader_.stage == Stage::compute)
            line(fmt::format("result[identity * {}u + {}u] = {};", result_words, word++, as_bits(text, place.type)));
        else
            line(fmt::format("hash = (hash ^ {}) * 16777619u;", as_bits(text, place.type)));
    }
    write_result();
    close();
}

GeneratedShader Generator::make() {
    shader_.stage = shader_.seed % 5 == 3 ? Stage::fragment : shader_.seed % 5 == 4 ? Stage::vertex : Stage::compute;
    declarations();
    for (int i = random_.between(0, 3), number = 0; number < i; ++number) function(number);
    main_function();
    return shader_;
}

GeneratedShader generate(std::uint64_t seed) { return Generator(seed).make(); }

}  // namespace nacre::differential
