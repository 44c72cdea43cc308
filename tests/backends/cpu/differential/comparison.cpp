// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/differential/comparison.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "tests/backends/cpu/differential/approximate.h"

namespace nacre::differential {

namespace {

constexpr std::string_view optimized_mark = " optimized", reshaped_mark = " reshaped";
constexpr const char* reference = "vulkan";

std::optional<std::string> difference_of(const Output& first, const Output& second, Stage stage) {
    for (std::size_t i = 0; i < first.words.size(); ++i)
        if (first.words[i] != second.words[i])
            return fmt::format("{}: {:#x} and {:#x}", Output::place_of(i, stage), first.words[i], second.words[i]);
    for (std::size_t i = 0; i < first.pairs.size(); i += 2)
        if (first.pairs[i] != second.pairs[i])
            return fmt::format("argument {} of approximate function: {} and {}", i / 2, first.pairs[i],
                               second.pairs[i]);
    return {};
}

std::optional<std::string> imprecision_of(const Output& output) {
    const auto functions = approximate_functions();
    for (std::size_t i = 0; i + 1 < output.pairs.size(); i += 2) {
        const std::size_t number = i / 2 % approximate_pairs;
        if (number >= functions.size() || (output.pairs[i] == 0 && output.pairs[i + 1] == 0)) continue;
        const double argument = output.pairs[i], found = output.pairs[i + 1];
        const double exact = functions[number].exact(argument);
        const double tolerance = functions[number].tolerance(argument, exact) + std::abs(exact) * 0x1p-24;
        if (!(std::abs(found - exact) <= tolerance))
            return fmt::format("{} of {:.9g} is {:.9g}, not {:.9g} +- {:.3g}", functions[number].glsl, argument, found,
                               exact, tolerance);
    }
    return {};
}

}  // namespace

Expected<Output> Comparison::run(const std::string& device, const std::string& text, Stage stage) {
    if (compared_ != text) outputs_.clear(), compared_ = text;
    if (const auto found = outputs_.find(device); found != outputs_.end()) return found->second;
    const bool is_optimized = device.ends_with(optimized_mark), is_reshaped = device.ends_with(reshaped_mark);
    const std::size_t mark = is_optimized ? optimized_mark.size() : is_reshaped ? reshaped_mark.size() : 0;
    const std::string spec = device.substr(0, device.size() - mark);
    std::string given = text;
    if (spec == reference && given.starts_with(loop_guard))
        given.replace(0, std::string_view(loop_guard).size(), loop_guard_for_lavapipe);
    NACRE_TRY(std::vector<std::uint32_t> words, compile(given, stage));
    if (mark) {
        before_run("SPIRV-Tools");
        words = optimized(words, is_optimized ? Passes::performance : Passes::control_flow);
    }
    before_run(device);
    auto& runner = runners_[spec];
    if (!runner) {
        NACRE_TRY(runner, DeviceRunner::create(spec));
    }
    auto output = runner->run(words, stage);
    if (!output) {
        if (output.error().code == ErrorCode::device_lost) runner.reset();
        return output;
    }
    outputs_[device] = *output;
    return output;
}

std::optional<Comparison::Difference> Comparison::compare(const std::string& first, const std::string& second,
                                                          const std::string& text, Stage stage) {
    const auto a = run(first, text, stage);
    if (!a) return Difference{first, second, first + ": " + a.error().message()};
    const auto b = run(second, text, stage);
    if (!b) return Difference{first, second, second + ": " + b.error().message()};
    if (const auto what = difference_of(*a, *b, stage)) return Difference{first, second, *what};
    return {};
}

std::optional<Comparison::Difference> Comparison::check(const GeneratedShader& shader) {
    // One device of several for each shader: most time is spent on compiling.
    static const std::vector<std::string> all{"cpu:consistent", "cpu:fast:lanes=8", "cpu:fast:lanes=4",
                                              "cpu:consistent optimized"};
    const std::string device = devices.empty() ? all[shader.seed % all.size()] : devices.front();
    const std::string other = !devices.empty() ? devices.back()
                              : has_vulkan     ? reference
                                               : all[(shader.seed + 1) % all.size()];
    if (const auto found = compare(device, other, shader.text, shader.stage)) return found;
    if (const auto output = run(device, shader.text, shader.stage))
        if (const auto what = imprecision_of(*output)) return Difference{device, device, *what};
    return {};
}

std::string Comparison::reduce(const GeneratedShader& shader, const Difference& difference) {
    std::vector<std::string> lines;
    for (std::size_t begin = 0; begin < shader.text.size();) {
        const std::size_t end = std::min(shader.text.find('\n', begin), shader.text.size());
        lines.push_back(shader.text.substr(begin, end - begin));
        begin = end + 1;
    }
    const auto joined = [](const std::vector<std::string>& all) {
        std::string text;
        for (const std::string& one : all) text += one + "\n";
        return text;
    };
    const bool is_error =
        difference.what.find(": ") != std::string::npos && difference.what.starts_with(difference.first + ": ");
    const auto still_differs = [&](const std::vector<std::string>& candidate) {
        const std::string text = joined(candidate);
        // Outputs that nothing writes would be undefined.
        for (const char* needed : {"\n  color = ", "\n  gl_Position = ", "\n  gl_PointSize = "})
            if (shader.text.find(needed) != std::string::npos && text.find(needed) == std::string::npos) return false;
        if (!compile(text, shader.stage)) return false;
        if (difference.first == difference.second) {
            const auto output = run(difference.first, text, shader.stage);
            return output && imprecision_of(*output).has_value();
        }
        const auto found = compare(difference.first, difference.second, text, shader.stage);
        return found && is_error == found->what.starts_with(difference.first + ": ");
    };
    // Last line of the block that begins in a line, itself where none does.
    const auto end_of = [&](std::size_t at) {
        int depth = 0;
        for (std::size_t i = at; i < lines.size(); ++i) {
            for (const char letter : lines[i]) depth += letter == '{' ? 1 : letter == '}' ? -1 : 0;
            if (depth <= 0) return i;
        }
        return at;
    };
    for (bool changed = true; changed;) {
        changed = false;
        for (std::size_t at = lines.size(); at-- > 0;) {
            if (at >= lines.size() || lines[at].find_first_not_of(" }") == std::string::npos) continue;
            if (lines[at].ends_with(first_value_mark)) continue;
            const std::size_t end = end_of(at);
            std::vector<std::string> without = lines;
            without.erase(without.begin() + static_cast<std::ptrdiff_t>(at),
                          without.begin() + static_cast<std::ptrdiff_t>(end) + 1);
            if (still_differs(without)) {
                lines = without, changed = true;
                continue;
            }
            if (end == at) continue;
            // The block's content without its head and end.
            without = lines;
            without.erase(without.begin() + static_cast<std::ptrdiff_t>(end));
            without.erase(without.begin() + static_cast<std::ptrdiff_t>(at));
            if (still_differs(without)) lines = without, changed = true;
        }
    }
    return joined(lines);
}

}  // namespace nacre::differential
