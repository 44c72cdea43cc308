// SPDX-License-Identifier: Apache-2.0
#include "measure/cross_backend.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <ranges>

#include "measure/closure_comparison.h"

namespace nacre::measure {
namespace {

using passes::IntermediateDescription;

FieldKind kind_of(passes::FieldKind kind) {
    switch (kind) {
        case passes::FieldKind::identifier: return FieldKind::uint;
        case passes::FieldKind::unorm: return FieldKind::unorm;
        case passes::FieldKind::squared: return FieldKind::squared;
        case passes::FieldKind::octahedral: return FieldKind::octahedral;
    }
    return FieldKind::uint;
}

// Backends may store a texture in different formats where a profile leaves it open; its numbers are compared then.
TextureData as_floats(const TextureData& texture) {
    TextureData result{.name = texture.name, .format = rhi::Format::rgba32_float, .width = texture.width,
                       .height = texture.height, .layers = texture.layers};
    result.bytes.resize(texture.texels() * 16);
    for (std::uint64_t i = 0; i < texture.texels(); ++i) {
        double values[4];
        decode_texel(texture, i, values);
        float floats[4];
        for (int c = 0; c < 4; ++c) floats[c] = static_cast<float>(values[c]);
        std::memcpy(result.bytes.data() + i * 16, floats, 16);
    }
    return result;
}

Expected<TextureDifference> compare_contents(const TextureData& a, const TextureData& b) {
    if (a.format == b.format) return compare_textures(a, b);
    return compare_textures(as_floats(a), as_floats(b));
}

void accumulate(TextureDifference& sum, const TextureDifference& part) {
    sum.texels += part.texels;
    sum.differing += part.differing;
    sum.fields_differing += part.fields_differing;
    sum.max_abs = std::max(sum.max_abs, part.max_abs);
    sum.max_rel = std::max(sum.max_rel, part.max_rel);
    if (sum.fields.empty()) sum.fields = part.fields;
    else {
        for (std::size_t f = 0; f < sum.fields.size(); ++f) {
            sum.fields[f].differing += part.fields[f].differing;
            sum.fields[f].max_abs = std::max(sum.fields[f].max_abs, part.fields[f].max_abs);
        }
    }
}

// Errors of a device do not know on whose behalf it works.
Error named(Error error, const std::string& backend) {
    error.attempted = fmt::format("backend '{}': {}", backend, error.attempted);
    return error;
}

bool is_more_precise(const Contestant& reference, const Contestant& test) {
    return reference.rhi_device && test.rhi_device &&
           reference.rhi_device->capabilities().float_bits > test.rhi_device->capabilities().float_bits;
}

// What the invocation of a shader that made a texel computed on one device; the last one counts.
Expected<rhi::InvocationTrace> trace_texel(const Contestant& contestant, const std::string& shader,
                                           const WrongValue& texel) {
    rhi::TraceRequest request{.shader = shader, .x = texel.x, .y = texel.y, .z = texel.layer};
    const auto run = [&]() -> Expected<rhi::Trace> {
        NACRE_CHECK(contestant.rhi_device->start_trace(request));
        auto frame = contestant.renderer.render_frame();
        auto trace = contestant.rhi_device->finish_trace();
        if (!frame) return std::unexpected(frame.error());
        return trace;
    };
    NACRE_TRY(rhi::Trace trace, run());
    if (!trace.writers.empty()) {
        request.invocation = trace.writers.back();
        NACRE_TRY(trace, run());
    }
    if (trace.invocations.empty())
        return fail(ErrorCode::not_found, "trace texel", fmt::format("({}, {})", texel.x, texel.y),
                    fmt::format("'{}' did not make it", shader));
    return std::move(trace.invocations.back());
}

Expected<ErrorOrigin> origin_of(const rhi::InvocationTrace& from, const rhi::InvocationTrace& to,
                                const WrongValue& texel) {
    const auto untold = [&](std::string reason) {
        return fail(ErrorCode::not_found, "trace texel", fmt::format("({}, {})", texel.x, texel.y), std::move(reason));
    };
    if (from.shader != to.shader)
        return untold(
            fmt::format("'{}' made it in double precision, '{}' in single precision", from.shader, to.shader));
    std::optional<ErrorOrigin> origin = find_error_origin(from, to, texel.stored);
    if (!origin)
        return untold(fmt::format("both precisions compute the same in '{}', up to where they part", to.shader));
    return *std::move(origin);
}

/// @param made_by  set to the pass that made the texel
Expected<ErrorOrigin> origin_of(const Contestant& reference, const Contestant& test, const NumericalError& error,
                                std::string& made_by) {
    std::string writers;
    for (const IntermediateDescription& description : test.renderer.intermediates())
        if (description.name == error.texture) writers = description.written_by;
    // The last pass that made the texel counts, and in it the shader that is bound last.
    Expected<ErrorOrigin> result =
        fail(ErrorCode::not_found, "trace texel", fmt::format("'{}'", error.texture), "no shader makes it");
    while (!writers.empty()) {
        const std::size_t comma = writers.rfind(", ");
        const std::string last = comma == std::string::npos ? writers : writers.substr(comma + 2);
        writers.resize(comma == std::string::npos ? 0 : comma);
        std::vector<std::string> shaders;
        for (const passes::PlannedPass& pass : test.renderer.plan().passes)
            if (pass.name == last)
                for (const passes::PlannedShader& shader : pass.shaders)
                    if (!shader.path.ends_with(".vert") && std::ranges::find(shaders, shader.path) == shaders.end())
                        shaders.push_back(shader.path);
        for (const std::string& shader : shaders | std::views::reverse) {
            const auto from = trace_texel(reference, shader, error.largest);
            const auto to = from ? trace_texel(test, shader, error.largest) : from;
            if (to) {
                made_by = last;
                return origin_of(*from, *to, error.largest);
            }
            result = std::unexpected(to.error());
        }
    }
    return result;
}

/// What came in wrong was made by an earlier pass: looks for it at the same pixel of the textures that the pass reads.
void find_earlier_origin(const Contestant& reference, const Contestant& test, WrongValue at, std::string pass,
                         BackendResult& result) {
    constexpr int most_passes = 4;
    ErrorOrigin origin = *result.origin;
    for (int step = 0; step < most_passes && origin.came_in; ++step) {
        std::vector<std::string> reads;
        for (const passes::PlannedPass& planned : test.renderer.plan().passes)
            if (planned.name == pass) reads = planned.reads;
        at.stored = origin.value;
        bool is_found = false;
        for (const std::string& name : reads) {
            const bool is_wrong = std::ranges::any_of(result.errors, [&](const NumericalError& error) {
                return error.texture == name && error.largest.error > 0.0;
            });
            if (!is_wrong) continue;
            NumericalError there{.texture = name, .largest = at};
            auto found = origin_of(reference, test, there, pass);
            if (!found) continue;
            result.earlier_origin = origin = *std::move(found);
            result.earlier_origin_of = name;
            is_found = true;
            break;
        }
        if (!is_found) return;
    }
}

void find_origin(const Contestant& reference, const Contestant& test, BackendResult& result) {
    std::vector<const NumericalError*> ranked;
    for (const NumericalError& error : result.errors)
        if (error.largest.error > 0.0) ranked.push_back(&error);
    std::ranges::stable_sort(ranked, std::ranges::greater{}, &NumericalError::share);
    for (const NumericalError* error : ranked) {
        std::string pass;
        auto origin = origin_of(reference, test, *error, pass);
        if (origin) {
            result.origin = *std::move(origin);
            result.origin_of = error->texture;
            find_earlier_origin(reference, test, error->largest, std::move(pass), result);
            return;
        }
        if (result.no_origin.empty()) result.no_origin = origin.error().message();
    }
}

// The words of the texels, which say nothing by the fields of the texture, become 0.
void clear_texels(TextureData& data, const std::vector<bool>& which) {
    for (std::size_t i = 0; i < which.size() && 4 * (i + 1) <= data.bytes.size(); ++i) {
        if (which[i]) std::memset(data.bytes.data() + 4 * i, 0, 4);
    }
}

Expected<MaterialWords> material_words_of(const Contestant& contestant) {
    const auto read = [&](const char* name, std::uint32_t layer) -> Expected<TextureData> {
        auto content = contestant.renderer.read_intermediate(name, layer);
        if (!content) return std::unexpected(named(content.error(), contestant.backend));
        return texture_data_of(*std::move(content));
    };
    MaterialWords words;
    NACRE_TRY(words.material_0, read("material.0", 0));
    NACRE_TRY(words.material_1, read("material.1", 0));
    for (const IntermediateDescription& description : contestant.renderer.intermediates()) {
        if (description.name != "material.slices") continue;
        for (std::uint32_t layer = 0; layer < description.layers; ++layer) {
            NACRE_TRY(TextureData slice, read("material.slices", layer));
            words.slices.push_back(std::move(slice));
        }
    }
    return words;
}

// All layers and mips of one texture on two devices.
Expected<TextureDifference> compare_texture(const Contestant& reference, const Contestant& test,
                                            const IntermediateDescription& description, bool with_pictures,
                                            const std::vector<bool>& is_closure, BackendResult& result) {
    NumericalError error{.texture = description.name};
    const bool measures_error = is_more_precise(reference, test);
    TextureDifference sum{.name = description.name};
    std::optional<TexturePictures> pictures;
    for (std::uint32_t mip = 0; mip < description.mips; ++mip) {
        for (std::uint32_t layer = 0; layer < description.layers; ++layer) {
            auto a = reference.renderer.read_intermediate(description.name, layer, mip);
            if (!a) return std::unexpected(named(a.error(), reference.backend));
            auto b = test.renderer.read_intermediate(description.name, layer, mip);
            if (!b) return std::unexpected(named(b.error(), test.backend));
            TextureData data_a = texture_data_of(*std::move(a)), data_b = texture_data_of(*std::move(b));
            if (description.name == "material.0" || description.name == "material.1") {
                clear_texels(data_a, is_closure);
                clear_texels(data_b, is_closure);
            }
            NACRE_TRY(const TextureDifference part, compare_contents(data_a, data_b));
            accumulate(sum, part);
            if (measures_error && data_a.format == data_b.format) {
                // Packed words have no more than their bits.
                std::vector<double> exact;
                if (data_a.fields.empty() && !rhi::info(data_a.format).is_integer())
                    if (auto values = reference.renderer.read_exact_intermediate(description.name, layer, mip))
                        exact = *std::move(values);
                NACRE_CHECK(add_numerical_error(data_a, data_b, exact, layer, mip, error));
            }
            if (with_pictures && part.differing > 0 && !pictures && data_a.format == data_b.format) {
                NACRE_TRY(Image picture, picture_of(data_a));
                NACRE_TRY(Image mask, difference_mask(data_a, data_b));
                pictures = TexturePictures{description.name, std::move(picture), std::move(mask)};
            }
        }
    }
    if (error.values > 0) result.errors.push_back(std::move(error));
    if (pictures) result.texture_pictures.push_back(*std::move(pictures));
    return sum;
}

Expected<void> compare_all_textures(const Contestant& reference, const Contestant& test,
                                    const ComparisonOptions& options, BackendResult& result) {
    const std::vector<IntermediateDescription> wanted = reference.renderer.intermediates();
    const std::vector<IntermediateDescription> present = test.renderer.intermediates();
    const auto readable = [](const std::vector<IntermediateDescription>& list, const std::string& name) {
        return std::ranges::any_of(list, [&](const auto& d) { return d.name == name && d.is_readable; });
    };
    ClosureDifference closures;
    const bool has_words = std::ranges::all_of(std::array{"material.0", "material.1"}, [&](const char* name) {
        return readable(wanted, name) && readable(present, name);
    });
    if (has_words) {
        NACRE_TRY(const MaterialWords words_a, material_words_of(reference));
        NACRE_TRY(const MaterialWords words_b, material_words_of(test));
        NACRE_TRY(closures, compare_closures(words_a, words_b));
        const bool is_wanted = options.only_texture.empty() || options.only_texture == "material.slices";
        if (is_wanted && is_more_precise(reference, test)) {
            NACRE_TRY(result.errors, closure_errors(words_a, words_b));
        }
    }
    for (const IntermediateDescription& description : wanted) {
        if (!description.is_readable) continue;
        if (!options.only_texture.empty() && description.name != options.only_texture) continue;
        if (description.name == "material.slices" && has_words && readable(present, description.name)) {
            result.textures.push_back(closures.difference);
            continue;
        }
        if (!readable(present, description.name)) {
            result.missing.push_back(description.name);
            continue;
        }
        NACRE_TRY(TextureDifference difference,
                  compare_texture(reference, test, description, options.texture_pictures, closures.is_closure, result));
        result.textures.push_back(std::move(difference));
    }
    for (const IntermediateDescription& description : present) {
        if (!options.only_texture.empty() && description.name != options.only_texture) continue;
        if (description.is_readable && !readable(wanted, description.name)) result.added.push_back(description.name);
    }
    return {};
}

Expected<BackendResult> render(const Contestant& contestant, std::uint32_t frames) {
    BackendResult result{.backend = contestant.backend, .device = contestant.device};
    auto times = time_frames(contestant.renderer, frames);
    if (!times) return std::unexpected(named(times.error(), contestant.backend));
    result.times = *std::move(times);
    auto picture = contestant.renderer.read_final();
    if (!picture) return std::unexpected(named(picture.error(), contestant.backend));
    result.picture = *std::move(picture);
    result.radiance_scan = scan_values(result.picture.radiance);
    result.warnings = contestant.renderer.warnings();
    return result;
}

double finite(double value) { return std::isinf(value) ? std::numeric_limits<double>::max() : value; }

double share(std::uint64_t part, std::uint64_t whole) { return whole == 0 ? 0.0 : double(part) / double(whole); }

using Json = nlohmann::ordered_json;

Json error_json(const NumericalError& error) {
    const WrongValue& at = error.largest;
    return Json{{"texture", error.texture},
                {"values", error.values},
                {"exact", error.is_exact},
                {"flips", error.flips},
                {"max_abs", finite(at.error)},
                {"max_rel", finite(error.max_rel)},
                {"rms", finite(error.rms)},
                {"share", finite(error.share())},
                {"pixel", {at.x, at.y}},
                {"layer", at.layer},
                {"mip", at.mip},
                {"field", at.name},
                {"reference", finite(at.reference)},
                {"value", finite(at.value)}};
}

void add_errors(const BackendResult& result, Json& json) {
    for (const NumericalError& error : result.errors) json["numerical_errors"].push_back(error_json(error));
    const NumericalError* const largest = SceneComparison::largest_error(result);
    json["largest_error"] = largest ? error_json(*largest) : Json(nullptr);
    const auto origin_json = [](const std::string& texture, const ErrorOrigin& origin) {
        return Json{{"texture", texture},
                    {"shader", origin.shader},
                    {"line", origin.line},
                    {"operation", origin.operation},
                    {"came_in", origin.came_in},
                    {"reference", finite(origin.reference)},
                    {"value", finite(origin.value)},
                    {"growth", finite(origin.growth)}};
    };
    json["origin"] = result.origin ? origin_json(result.origin_of, *result.origin) : Json(nullptr);
    if (result.earlier_origin) json["earlier_origin"] = origin_json(result.earlier_origin_of, *result.earlier_origin);
}

void judge_texture(const std::string& backend, const TextureDifference& texture, const Tolerance& tolerance,
                   std::vector<std::string>& violations) {
    TextureTolerance bounds;
    if (const auto found = tolerance.textures.find(texture.name); found != tolerance.textures.end()) {
        bounds = found->second;
    }
    if (!bounds.fields_differing) bounds.fields_differing = tolerance.fields_differing;
    const auto judge = [&](std::string_view what, double found, const std::optional<double>& allowed) {
        // Not "found > allowed": a NaN must not pass.
        if (!allowed || found <= *allowed) return;
        violations.push_back(fmt::format("{}: texture '{}': {} is {:.6g}; at most {:.6g} is allowed", backend,
                                         texture.name, what, found, *allowed));
    };
    judge("the share of texels whose fields differ", share(texture.fields_differing, texture.texels),
          bounds.fields_differing);
    judge("the share of texels that are not bit-equal", share(texture.differing, texture.texels), bounds.differing);
    judge("the largest absolute difference", texture.max_abs, bounds.max_abs);
    judge("the largest relative difference", texture.max_rel, bounds.max_rel);
}

}  // namespace

TextureData texture_data_of(passes::IntermediateContent content) {
    const IntermediateDescription& description = content.description;
    TextureData result{.name = description.name, .format = description.format, .width = content.width,
                       .height = content.height, .bytes = std::move(content.bytes)};
    // Depth is handed out as floats, whatever the device stores.
    if (rhi::info(description.format).has_depth) result.format = rhi::Format::d32_float;
    for (const passes::Field& field : description.fields) {
        result.fields.push_back({std::string(field.name), 0, field.shift, field.bits, kind_of(field.kind)});
    }
    return result;
}

Expected<SceneComparison> compare_backends(std::string scene, std::span<const Contestant> contestants,
                                           const ComparisonOptions& options) {
    if (contestants.empty()) {
        return fail(ErrorCode::invalid_argument, "compare backends", scene, "there is no backend to compare");
    }
    SceneComparison comparison{.scene = std::move(scene)};
    for (const Contestant& contestant : contestants) {
        NACRE_TRY(BackendResult result, render(contestant, options.frames));
        comparison.backends.push_back(std::move(result));
        if (&contestant == &contestants.front()) continue;
        BackendResult& test = comparison.backends.back();
        if (options.textures) {
            NACRE_CHECK(compare_all_textures(contestants.front(), contestant, options, test));
            find_origin(contestants.front(), contestant, test);
        }
        NACRE_TRY(test.final,
                  compare_pictures(linear_from_srgb_bytes(comparison.backends.front().picture.tone_mapped),
                                   linear_from_srgb_bytes(test.picture.tone_mapped)));
    }
    if (contestants.front().rhi_device) comparison.narrowed = contestants.front().rhi_device->narrowed_operations();
    return comparison;
}

const NumericalError* SceneComparison::largest_error(const BackendResult& result) {
    const auto found = std::ranges::max_element(result.errors, {}, &NumericalError::share);
    return found == result.errors.end() || found->largest.error == 0.0 ? nullptr : &*found;
}

std::vector<std::string> violations_of(const SceneComparison& comparison, const Tolerance& tolerance) {
    std::vector<std::string> violations;
    for (std::size_t b = 0; b < comparison.backends.size(); ++b) {
        const BackendResult& result = comparison.backends[b];
        if (!result.radiance_scan.clean()) {
            violations.push_back(fmt::format("{}: the radiance holds {} NaN, {} infinite and {} negative values",
                                             result.backend, result.radiance_scan.nan, result.radiance_scan.infinite,
                                             result.radiance_scan.negative));
        }
        if (b == 0) continue;
        for (const std::string& name : result.missing) {
            violations.push_back(fmt::format("{}: texture '{}' of the reference is missing", result.backend, name));
        }
        for (const std::string& name : result.added) {
            violations.push_back(fmt::format("{}: texture '{}' is not in the reference", result.backend, name));
        }
        for (const TextureDifference& texture : result.textures) {
            judge_texture(result.backend, texture, tolerance, violations);
        }
        const auto judge = [&](std::string_view what, double found, bool is_within, double allowed) {
            if (is_within) return;
            violations.push_back(fmt::format("{}: final picture: {} is {:.6g}; the bound is {:.6g}", result.backend,
                                             what, found, allowed));
        };
        const PictureDifference& final = result.final;
        judge("PSNR in dB", final.psnr_db, final.psnr_db >= tolerance.psnr_db, tolerance.psnr_db);
        judge("FLIP mean", final.flip_mean, final.flip_mean <= tolerance.flip_mean, tolerance.flip_mean);
        judge("the share of pixels above 1/255", final.share_above_1, final.share_above_1 <= tolerance.share_above_1,
              tolerance.share_above_1);
        if (tolerance.max_abs_8bit) {
            judge("the largest difference of a byte", final.max_abs_8bit, final.max_abs_8bit <= *tolerance.max_abs_8bit,
                  *tolerance.max_abs_8bit);
        }
    }
    return violations;
}

std::string to_json(const SceneComparison& comparison) {
    Json results = Json::array();
    for (std::size_t b = 1; b < comparison.backends.size(); ++b) {
        const BackendResult& result = comparison.backends[b];
        Json textures = Json::array();
        for (const TextureDifference& texture : result.textures) {
            textures.push_back(Json{{"name", texture.name},
                                    {"texels", texture.texels},
                                    {"differing", texture.differing},
                                    {"fields_differing", texture.fields_differing},
                                    {"max_abs", finite(texture.max_abs)},
                                    {"max_rel", finite(texture.max_rel)}});
        }
        results.push_back(Json{{"backend", result.backend},
                               {"textures", std::move(textures)},
                               {"final",
                                {{"psnr_db", result.final.psnr_db},
                                 {"flip_mean", result.final.flip_mean},
                                 {"max_abs_8bit", result.final.max_abs_8bit},
                                 {"share_above_1", result.final.share_above_1}}}});
        if (!result.errors.empty()) add_errors(result, results.back());
    }
    Json all{{"scene", comparison.scene},
             {"reference", comparison.backends.empty() ? "" : comparison.backends.front().backend},
             {"results", std::move(results)}};
    for (const rhi::NarrowedOperation& operation : comparison.narrowed)
        all["narrowed"].push_back(
            Json{{"shader", operation.shader}, {"line", operation.line}, {"operation", operation.operation}});
    return all.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace nacre::measure
