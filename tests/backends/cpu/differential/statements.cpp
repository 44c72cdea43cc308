// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "tests/backends/cpu/differential/approximate.h"
#include "tests/backends/cpu/differential/generator.h"

namespace nacre::differential {

namespace {

constexpr int deepest_nesting = 4;
const GlslType one_bool{Kind::boolean, 1, 1}, one_uint{Kind::natural, 1, 1}, one_int{Kind::integer, 1, 1},
    one_float{Kind::real, 1, 1};

}  // namespace

void Generator::line(const std::string& text) {
    shader_.text.append(static_cast<std::size_t>(indent_) * 2, ' ');
    shader_.text += text + "\n";
}

void Generator::open(const std::string& text) {
    line(text + " {");
    ++indent_;
}

void Generator::close(const std::string& text) {
    --indent_;
    line(text);
}

void Generator::block(int statements) {
    const std::size_t places = places_.size(), structures = structures_.size();
    ++depth_;
    for (int i = 0; i < statements; ++i) statement();
    --depth_;
    places_.resize(places);
    structures_.resize(structures);
}

const Place* Generator::writable_place(const GlslType* type, bool plain) {
    std::vector<const Place*> fitting;
    for (const Place& place : places_)
        if (place.writable && (!type || place.type == *type) && (!plain || place.is_plain)) fitting.push_back(&place);
    return fitting.empty() ? nullptr : random_.pick(fitting);
}

void Generator::statement() {
    if (--budget_ < 0) return;
    const bool may_nest = depth_ < deepest_nesting;
    const int which = random_.below(100);
    if (which < 10) declare();
    else if (which < 36) assign();
    else if (which < 44) note();
    else if (which < 56 && may_nest) if_statement();
    else if (which < 67 && may_nest) loop_statement();
    else if (which < 73 && may_nest) switch_statement();
    else if (which < 82) jump();
    else if (which < 87) call_statement();
    else if (which < 90) exchange();
    else if (which < 92) atomic();
    else if (which < 94) image();
    else if (which < 96) approximate();
    else if (which < 98) copy_structure();
    else assign();
}

void Generator::declare() {
    const GlslType type = random_type();
    const std::string name = fmt::format("v{}", names_++);
    Place place{.text = name, .type = type, .is_plain = true};
    if (random_.chance(20) && type.kind != Kind::matrix) {
        place.count = random_.between(2, 5), place.is_plain = false;
        std::string values;
        for (int i = 0; i < place.count; ++i) values += (i ? ", " : "") + expression(type, 1);
        line(fmt::format("{0} {1}[{2}] = {0}[{2}]({3});", type.name(), name, place.count, values));
        place.text += "[@]";
    } else {
        const bool was_uniform = only_uniform_;
        only_uniform_ = place.is_uniform = random_.chance(45);
        line(fmt::format("{} {} = {};", type.name(), name, expression(type, 2)));
        only_uniform_ = was_uniform;
    }
    places_.push_back(place);
}

void Generator::assign() {
    const Place* found = writable_place();
    if (!found) return declare();
    const Place place = *found;
    const bool was_uniform = only_uniform_;
    only_uniform_ = random_.chance(place.is_uniform ? 80 : 15);
    const std::string text = fill_indices(place);
    const GlslType& type = place.type;
    const bool is_number = type.kind == Kind::integer || type.kind == Kind::natural;
    if (type.kind == Kind::matrix && random_.chance(50)) {
        const std::string column = fmt::format("{}[{}]", text, index(type.columns));
        if (random_.chance(50)) line(fmt::format("{} = whole({});", column, expression({Kind::real, type.size, 1}, 2)));
        else line(fmt::format("{}[{}] = whole({});", column, index(type.size), expression(one_float, 2)));
    } else if (type.kind != Kind::matrix && type.size > 1 && random_.chance(35)) {
        if (random_.chance(50)) {
            line(fmt::format("{}[{}] = {};", text, index(type.size), expression({type.kind, 1, 1}, 2)));
        } else {
            const int size = random_.between(1, type.size);
            line(fmt::format("{}.{} = {};", text, swizzle(type.size, size, true), expression({type.kind, size, 1}, 2)));
        }
    } else if (is_number && random_.chance(30)) {
        line(fmt::format("{} {}= {};", text, random_.pick({"+", "-", "*", "^", "|", "&"}), expression(type, 2)));
    } else if (is_number && type.size == 1 && random_.chance(20)) {
        line(fmt::format("{}{};", text, random_.pick({"++", "--"})));
    } else if (type.kind == Kind::real) {
        line(fmt::format("{} = keep({});", text, expression(type, random_.between(1, 3))));
    } else {
        line(fmt::format("{} = {};", text, expression(type, random_.between(1, 3))));
    }
    only_uniform_ = was_uniform;
}

void Generator::note() {
    const GlslType type = random_type();
    line(fmt::format("hash = (hash ^ {}) * 16777619u;", as_bits(expression(type, 1), type)));
}

void Generator::if_statement() {
    const bool was_divergent = is_divergent_, was_uniform = only_uniform_;
    const bool is_uniform = random_.chance(30);
    only_uniform_ = is_uniform || was_uniform;
    const std::string condition = expression(one_bool, 2);
    only_uniform_ = was_uniform;
    is_divergent_ = true;
    open(fmt::format("if ({})", condition));
    block(random_.between(1, 4));
    while (random_.chance(40)) {
        if (random_.chance(50)) {
            close("} else {");
            ++indent_;
            block(random_.between(1, 3));
            break;
        }
        close(fmt::format("}} else if ({}) {{", expression(one_bool, 1)));
        ++indent_;
        block(random_.between(1, 2));
    }
    close();
    is_divergent_ = was_divergent || (!current_ && uses_barriers_ && left_);
}

void Generator::loop_statement() {
    const bool was_divergent = is_divergent_, was_uniform = only_uniform_;
    const std::string counter = fmt::format("i{}", names_++);
    // Barriers in a loop need all invocations in it: no way out but its end.
    const bool has_barriers = !is_divergent_ && uses_barriers_ && !current_ && random_.chance(50);
    const bool is_uniform = has_barriers || random_.chance(40);
    only_uniform_ = is_uniform || was_uniform;
    // Of which one only compiler and machine know; nested loops go round less often.
    const int most = depth_ < 2 ? random_.between(2, 7) : random_.between(1, 4);
    std::string bound = fmt::format("{}", most);
    if (random_.chance(70))
        bound = has_barriers ? fmt::format("int(numbers_block.w[{}] % {}u)", random_.below(4), most + 1)
                             : fmt::format("int({} % {}u)", expression(one_uint, 1), most + 1);
    only_uniform_ = was_uniform;
    const std::size_t places = places_.size();
    const int loops = loops_, switches = switches_;
    const bool could_leave = may_leave_;
    if (has_barriers) loops_ = switches_ = 0, may_leave_ = false;
    else ++loops_, is_divergent_ = true;
    const int switches_here = switches_;
    if (!has_barriers) switches_ = 0;
    const Place counted{.text = counter, .type = one_int, .writable = false, .is_uniform = is_uniform};
    const int form = has_barriers ? 0 : random_.below(4);
    if (form <= 1) {
        open(fmt::format("for (int {0} = 0; {0} < {1}; ++{0})", counter, bound));
        places_.push_back(counted);
        block(random_.between(1, 4));
        if (has_barriers) exchange();
        close();
        places_.resize(places);
    } else {
        line(fmt::format("int {} = 0;", counter));
        places_.push_back(counted);
        const std::string again = random_.chance(50)
                                      ? fmt::format("{}++ < {}", counter, bound)
                                      : fmt::format("{}++ < {} && {}", counter, most, expression(one_bool, 2));
        if (form == 2) open(fmt::format("while ({})", again));
        else open("do"), line("loop_guard");
        block(random_.between(1, 4));
        close(form == 2 ? "}" : fmt::format("}} while ({});", again));
        // The counter stays: what it held when the loop was left.
        places_.resize(places);
        places_.push_back(counted);
    }
    loops_ = loops, switches_ = has_barriers ? switches : switches_here;
    may_leave_ = could_leave;
    is_divergent_ = was_divergent || (!current_ && left_);
}

void Generator::switch_statement() {
    const bool was_divergent = is_divergent_;
    is_divergent_ = true;
    const bool is_signed = random_.chance(50);
    const int cases = random_.between(1, 4);
    const GlslType type = is_signed ? one_int : one_uint;
    open(fmt::format("switch ({} & {}{})", expression(type, 2), random_.pick({3, 7}), is_signed ? "" : "u"));
    ++switches_;
    const int default_at = random_.chance(70) ? random_.between(0, cases) : -1;
    std::vector<int> values{0, 1, 2, 3, 4, 5, 6, 7};
    const auto arm = [&](const std::string& label, bool is_last) {
        open(label);
        block(random_.between(0, 3));
        // A last arm needs something in it.
        if (is_last) note();
        close();
        if (!random_.chance(25) || is_last) line("break;");
    };
    for (int i = 0; i < cases; ++i) {
        if (i == default_at) arm("default:", false);
        if (random_.chance(20) && values.size() > 2) {
            line(fmt::format("case {}{}:", values.back(), is_signed ? "" : "u"));
            values.pop_back();
        }
        const std::size_t at = static_cast<std::size_t>(random_.below(static_cast<int>(values.size())));
        const int value = values[at];
        values.erase(values.begin() + static_cast<std::ptrdiff_t>(at));
        arm(fmt::format("case {}{}:", value, is_signed ? "" : "u"), i + 1 == cases && default_at != cases);
    }
    if (default_at == cases) arm("default:", true);
    --switches_;
    close();
    is_divergent_ = was_divergent || (!current_ && left_);
}

void Generator::jump() {
    std::vector<std::string> ways;
    if (loops_ > 0) ways.insert(ways.end(), {"break;", "continue;"});
    else if (switches_ > 0) ways.push_back("break;");
    if (current_ && depth_ > 1) ways.push_back("return");
    const bool from_main = !current_ && may_leave_ && depth_ > 1 && random_.chance(25);
    if (from_main) ways.push_back("leave");
    if (ways.empty()) return assign();
    std::string way = random_.pick(ways);
    const bool is_conditional = random_.chance(80);
    if (is_conditional) open(fmt::format("if ({})", expression(one_bool, 2)));
    if (way == "leave") {
        left_ = true;
        if (shader_.stage == Stage::fragment && random_.chance(50)) {
            line("discard;");
        } else {
            write_result();
            line("return;");
        }
    } else if (way == "return") {
        line(current_->has_result ? fmt::format("return {};", expression(current_->result, 2)) : "return;");
    } else {
        line(way);
    }
    if (is_conditional) close();
}

void Generator::call_statement() {
    std::vector<const GlslFunction*> callable;
    for (const GlslFunction& function : functions_)
        if (&function != current_) callable.push_back(&function);
    if (callable.empty()) return assign();
    const GlslFunction& function = *random_.pick(callable);
    std::string text = function.name + "(";
    std::vector<std::string> taken;
    for (std::size_t i = 0; i < function.parameters.size(); ++i) {
        const Parameter& parameter = function.parameters[i];
        if (i) text += ", ";
        if (parameter.way == Parameter::Way::in) {
            text += expression(parameter.type, 1);
            continue;
        }
        const Place* place = writable_place(&parameter.type, true);
        if (!place || std::ranges::find(taken, place->text) != taken.end()) return assign();
        taken.push_back(place->text);
        text += place->text;
    }
    text += ")";
    if (function.has_result) {
        if (const Place* place = writable_place(&function.result))
            return line(fmt::format("{} = {};", fill_indices(*place), text));
        const std::string name = fmt::format("v{}", names_++);
        line(fmt::format("{} {} = {};", function.result.name(), name, text));
        places_.push_back({.text = name, .type = function.result, .is_plain = true});
        return;
    }
    line(text + ";");
}

/// Invocations of a workgroup show each other a value.
void Generator::exchange() {
    if (is_divergent_ || !uses_barriers_ || current_) return note();
    line(std::string("barrier();") + first_value_mark);
    line(fmt::format("shown[gl_LocalInvocationIndex] = {};", expression(one_uint, 2)));
    line(std::string("barrier();") + first_value_mark);
    line(fmt::format("hash = (hash ^ shown[(gl_LocalInvocationIndex + {}u) % {}u]) * 16777619u;",
                     random_.between(1, 20), shader_.invocations));
}

void Generator::atomic() {
    if (shader_.stage != Stage::compute || (current_ && current_->is_pure)) return note();
    static const char* const names[] = {"atomicAdd", "atomicMin", "atomicMax", "atomicAnd", "atomicOr", "atomicXor"};
    const int operation = random_.below(6);
    const std::string value = expression(one_uint, 2);
    if (uses_barriers_ && random_.chance(50))
        line(fmt::format("{}(tallies[{}], {});", names[operation], operation, value));
    else
        line(fmt::format("{}(counters[{} + {}], {});", names[operation], operation * 4,
                         fmt::format("int({})", index(4)), value));
}

void Generator::image() {
    if (shader_.stage != Stage::compute || (current_ && current_->is_pure)) return note();
    if (random_.chance(50)) line(fmt::format("imageStore(texels, place, uvec4({}));", expression(one_uint, 2)));
    else line("hash = (hash ^ imageLoad(texels, place).x) * 16777619u;");
}

void Generator::approximate() {
    if (shader_.stage != Stage::compute || current_) return note();
    const auto functions = approximate_functions();
    const int number = random_.below(static_cast<int>(functions.size()));
    const ApproximateFunction& function = functions[static_cast<std::size_t>(number)];
    const std::string name = fmt::format("x{}", names_++);
    line(fmt::format("float {} = clamp(keep({}), {:.6f}, {:.6f});", name, expression(one_float, 2), function.low,
                     function.high));
    std::string text;
    for (const char letter : std::string(function.glsl)) text += letter == '$' ? name : std::string(1, letter);
    line(fmt::format("pairs[identity * {}u + {}u] = vec2({}, {});", approximate_pairs, number, name, text));
}

void Generator::copy_structure() {
    if (structures_.empty()) return assign();
    const auto filled = [&] {
        std::string text;
        for (const char letter : random_.pick(structures_)) text += letter == '@' ? index(3) : std::string(1, letter);
        return text;
    };
    const std::string to = filled();
    if (to.find("block") != std::string::npos) return assign();
    line(fmt::format("{} = {};", to, filled()));
}

}  // namespace nacre::differential
