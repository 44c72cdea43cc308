// SPDX-License-Identifier: Apache-2.0
#include "measure/numerical_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <unordered_set>

namespace nacre::measure {
namespace {

constexpr const char* channel_names[4] = {"r", "g", "b", "a"};

class Sum {
  public:
    Sum(NumericalError& total, std::uint32_t layer, std::uint32_t mip) : total_(total), layer_(layer), mip_(mip) {}

    void add(std::uint32_t x, std::uint32_t y, const std::string& name, double reference, double value, double error,
             std::optional<double> stored = {}) {
        add_wrong_value(total_, {x, y, layer_, mip_, name, reference, value, stored.value_or(value), error});
    }

  private:
    NumericalError& total_;
    std::uint32_t layer_, mip_;
};

double angle_between(const double (&a)[3], const double (&b)[3]) {
    double difference = 0.0, sum = 0.0;
    for (int i = 0; i < 3; ++i) difference += (a[i] - b[i]) * (a[i] - b[i]), sum += (a[i] + b[i]) * (a[i] + b[i]);
    return 2.0 * std::atan2(std::sqrt(difference), std::sqrt(sum));
}

/// Whether a value that is far off is rather that of a texel beside it.
bool shows_neighbor(const TextureData& reference, std::span<const double> exact, std::uint64_t index, double expected,
                    double found) {
    const double error = std::abs(found - expected);
    if (!(error > 1e-3 * std::max(std::abs(expected), std::abs(found)))) return false;
    const auto x = static_cast<std::int64_t>(index % reference.width);
    const auto y = static_cast<std::int64_t>(index / reference.width);
    for (std::int64_t j = y - 1; j <= y + 1; ++j)
        for (std::int64_t i = x - 1; i <= x + 1; ++i) {
            if (i < 0 || j < 0 || i >= reference.width || j >= reference.height || (i == x && j == y)) continue;
            const auto beside = static_cast<std::uint64_t>(j * reference.width + i);
            double value[4] = {};
            if (exact.empty()) decode_texel(reference, beside, value);
            if (std::abs(found - (exact.empty() ? value[0] : exact[beside * 4])) < 0.1 * error) return true;
        }
    return false;
}

/// What an instruction brought forth in its last execution before some event.
struct Pair {
    double error = 0.0, magnitude = 0.0, reference = 0.0, value = 0.0;
    std::size_t event = 0;
    [[nodiscard]] double relative() const { return magnitude > 0.0 ? error / magnitude : 0.0; }
};

/// Of a vector: the component that is off by most.
Pair pair_of(const rhi::TraceEvent& reference, const rhi::TraceEvent& test, std::size_t event) {
    Pair pair;
    pair.event = event;
    for (std::size_t i = 0; i < reference.values.size() && i < test.values.size(); ++i) {
        const double a = reference.values[i], b = test.values[i];
        const double error = a == b || (std::isnan(a) && std::isnan(b)) ? 0.0
                             : std::isfinite(a - b)                     ? std::abs(a - b)
                                                                        : std::numeric_limits<double>::max();
        if (i > 0 && error <= pair.error) continue;
        pair.error = error, pair.reference = a, pair.value = b;
        pair.magnitude = std::max(std::isfinite(a) ? std::abs(a) : 0.0, std::isfinite(b) ? std::abs(b) : 0.0);
    }
    return pair;
}

/// Moves numbers and rounds none.
bool only_moves(const std::string& operation) {
    for (const char* name : {"Store", "Phi", "Select", "CompositeConstruct", "CompositeExtract", "CompositeInsert",
                             "VectorShuffle", "CopyObject", "ImageWrite"})
        if (operation == name) return true;
    return false;
}

bool takes_over_absolute_errors(const std::string& operation) {
    if (only_moves(operation)) return true;
    for (const char* name : {"FAdd", "FSub", "FNegate", "Load", "MatrixTimesVector", "Dot"})
        if (operation == name) return true;
    return false;
}

}  // namespace

void add_wrong_value(NumericalError& sum, WrongValue value) {
    if (!std::isfinite(value.reference) && !std::isfinite(value.value)) return;
    if (!std::isfinite(value.error)) value.error = std::numeric_limits<double>::infinity();
    const double magnitude = std::max(std::abs(value.reference), std::abs(value.value));
    sum.rms = std::sqrt((sum.rms * sum.rms * static_cast<double>(sum.values) + value.error * value.error) /
                        static_cast<double>(sum.values + 1));
    ++sum.values;
    if (std::isfinite(value.reference)) sum.largest_value = std::max(sum.largest_value, std::abs(value.reference));
    if (magnitude > 0.0) sum.max_rel = std::max(sum.max_rel, value.error / magnitude);
    if (value.error > sum.largest.error) sum.largest = std::move(value);
}

Expected<void> add_numerical_error(const TextureData& reference, const TextureData& test, std::span<const double> exact,
                                   std::uint32_t layer, std::uint32_t mip, NumericalError& sum) {
    NACRE_CHECK(compare_textures(reference, test));
    Sum total(sum, layer, mip);
    const rhi::FormatInfo& format = rhi::info(reference.format);
    const bool is_exact = exact.size() >= reference.texels() * 4;
    sum.is_exact = sum.is_exact || is_exact;
    const auto word = [&](const TextureData& texture, std::uint64_t index, std::uint32_t channel) {
        std::uint32_t value = 0;
        std::memcpy(&value, texture.bytes.data() + index * format.block_bytes + std::size_t{4} * channel, 4);
        return value;
    };
    for (std::uint64_t index = 0; index < reference.texels(); ++index) {
        const auto x = static_cast<std::uint32_t>(index % reference.width),
                   y = static_cast<std::uint32_t>(index / reference.width);
        if (!reference.fields.empty()) {
            for (const BitField& field : reference.fields) {
                if (field.kind == FieldKind::uint) continue;
                const std::uint32_t a = word(reference, index, field.channel), b = word(test, index, field.channel);
                if (field.kind == FieldKind::octahedral) {
                    double from[3], to[3];
                    decode_octahedral(field, a, from), decode_octahedral(field, b, to);
                    total.add(x, y, field.name, 1.0, 1.0, angle_between(from, to), static_cast<std::int32_t>(b));
                    continue;
                }
                const double from = decode_field(field, a), to = decode_field(field, b);
                double error = std::abs(from - to);
                if (field.kind == FieldKind::circular) error = std::min(error, 1.0 - error);
                total.add(x, y, field.name, from, to, error, static_cast<std::int32_t>(b));
            }
            continue;
        }
        if (format.is_integer()) continue;
        double from[4], to[4];
        decode_texel(reference, index, from);
        decode_texel(test, index, to);
        for (std::uint32_t c = 0; c < format.channels && c < 4; ++c) {
            const double a = is_exact ? exact[index * 4 + c] : from[c];
            if (format.has_depth && shows_neighbor(reference, exact, index, a, to[c])) {
                ++sum.flips;
                continue;
            }
            total.add(x, y, format.has_depth ? "depth" : channel_names[c], a, to[c], std::abs(to[c] - a));
        }
    }
    return {};
}

std::optional<ErrorOrigin> find_error_origin(const rhi::InvocationTrace& reference, const rhi::InvocationTrace& test,
                                             std::optional<double> stored) {
    // Instructions are the same in both; events are until the two part.
    const std::size_t common = std::min(reference.events.size(), test.events.size());
    std::size_t end = 0;
    while (end < common && reference.events[end].instruction == test.events[end].instruction) ++end;
    const auto& instructions = test.instructions;
    std::unordered_set<std::uint32_t> is_floating;
    for (const rhi::TracedInstruction& instruction : instructions)
        if (instruction.is_floating && instruction.result != 0) is_floating.insert(instruction.result);
    // The latest execution of what makes each value, seen from each event.
    std::unordered_map<std::uint32_t, std::vector<Pair>> history;
    std::optional<Pair> last;
    std::size_t last_event = 0;
    double nearest = std::numeric_limits<double>::max();
    for (std::size_t i = 0; i < end; ++i) {
        const rhi::TracedInstruction& instruction = instructions[test.events[i].instruction];
        const Pair pair = pair_of(reference.events[i], test.events[i], i);
        if (instruction.result != 0) history[instruction.result].push_back(pair);
        const bool is_store = instruction.operation == "Store" || instruction.operation == "ImageWrite";
        double distance = std::numeric_limits<double>::max();
        for (const double value : test.events[i].values)
            distance = stored && is_store ? std::min(distance, std::abs(value - *stored)) : distance;
        if (pair.error > 0.0 && (!last || (is_store && distance <= nearest)))
            last = pair, last_event = i, nearest = distance;
    }
    if (!last) return std::nullopt;
    const auto before = [&](std::uint32_t value, std::size_t event) -> const Pair* {
        const auto found = history.find(value);
        if (found == history.end()) return nullptr;
        const Pair* latest = nullptr;
        for (const Pair& pair : found->second)
            if (pair.event < event) latest = &pair;
        return latest;
    };
    // From what was stored last back along the operands that bring most of the error.
    Pair at = *last, worst = *last;
    std::size_t event = last_event, worst_event = last_event;
    double growth = -1.0;
    for (;;) {
        const rhi::TracedInstruction& instruction = instructions[test.events[event].instruction];
        const bool is_absolute = takes_over_absolute_errors(instruction.operation) || !instruction.is_floating;
        const Pair* largest = nullptr;
        double most = -1.0, brought = 0.0;
        for (const std::uint32_t operand : instruction.operands) {
            const Pair* pair = before(operand, event);
            if (!pair || pair->error == 0.0) continue;
            brought = std::max(brought, pair->relative());
            const double contribution = is_absolute ? pair->error : pair->relative();
            if (contribution > most) most = contribution, largest = pair;
        }
        // What integers are made of integers says nothing about numbers: only where floats become codes it does.
        const bool becomes_code = std::ranges::any_of(
            instruction.operands, [&](std::uint32_t operand) { return is_floating.contains(operand); });
        const bool counts = !only_moves(instruction.operation) && (instruction.is_floating || becomes_code);
        if (counts && at.relative() - brought > growth)
            growth = at.relative() - brought, worst = at, worst_event = event;
        if (!largest) break;
        at = *largest;
        event = at.event;
    }
    const rhi::TracedInstruction& instruction = instructions[test.events[worst_event].instruction];
    ErrorOrigin origin{test.shader,
                       instruction.line,
                       instruction.operation,
                       worst.reference,
                       worst.value,
                       std::max(growth, 0.0),
                       false,
                       {}};
    const bool is_read = instruction.operation.starts_with("Image") || instruction.operation == "Load";
    const bool is_code = !instruction.is_floating;
    origin.came_in = is_read;
    origin.text = fmt::format("{} ({}){}: {:.9g}, not {:.9g}; the relative error grows by {:.2g} here",
                              origin.line.empty() ? origin.shader : origin.line, origin.operation,
                              is_read   ? ", a value that came in"
                              : is_code ? ", where it becomes a code of few bits"
                                        : "",
                              origin.value, origin.reference, origin.growth);
    return origin;
}

}  // namespace nacre::measure
