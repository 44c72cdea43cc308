// SPDX-License-Identifier: Apache-2.0
#include "measure/tolerance.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/text_position.h"

namespace nacre::measure {
namespace {

using nlohmann::json;

class ToleranceReader {
  public:
    explicit ToleranceReader(std::string_view source) : source_(source) {}

    std::unexpected<Error> wrong(std::string reason) const {
        return fail(ErrorCode::parse, "read tolerance", fmt::format("'{}'", source_), std::move(reason),
                    "`nacre compare --help` shows the format.");
    }

    /// Stores a number; says in the error where it stands.
    template <typename Target>
    Expected<void> number(const json& value, const std::string& path, Target& target) const {
        if (!value.is_number()) return wrong(fmt::format("{} is {}, not a number", path, value.type_name()));
        const double figure = value.get<double>();
        if (!std::isfinite(figure) || figure < 0) return wrong(fmt::format("{} is {}", path, figure));
        target = figure;
        return {};
    }

    Expected<void> object(const json& value, const std::string& path) const {
        if (value.is_object()) return {};
        return wrong(fmt::format("{} is {}, not an object", path, value.type_name()));
    }

    std::unexpected<Error> unknown(const std::string& path, std::string_view known) const {
        return wrong(fmt::format("{} is unknown; known here: {}", path, known));
    }

    Expected<TextureTolerance> texture(const json& value, const std::string& path) const {
        TextureTolerance result;
        NACRE_CHECK(object(value, path));
        for (const auto& [key, member] : value.items()) {
            const std::string at = path + "." + key;
            if (key == "fields_differing") NACRE_CHECK(number(member, at, result.fields_differing));
            else if (key == "differing") NACRE_CHECK(number(member, at, result.differing));
            else if (key == "max_abs") NACRE_CHECK(number(member, at, result.max_abs));
            else if (key == "max_rel") NACRE_CHECK(number(member, at, result.max_rel));
            else return unknown(at, "fields_differing, differing, max_abs, max_rel");
        }
        return result;
    }

    Expected<void> final_picture(const json& value, Tolerance& result) const {
        NACRE_CHECK(object(value, "final"));
        for (const auto& [key, member] : value.items()) {
            const std::string at = "final." + key;
            if (key == "psnr_db") NACRE_CHECK(number(member, at, result.psnr_db));
            else if (key == "flip_mean") NACRE_CHECK(number(member, at, result.flip_mean));
            else if (key == "share_above_1") NACRE_CHECK(number(member, at, result.share_above_1));
            else if (key == "max_abs_8bit") NACRE_CHECK(number(member, at, result.max_abs_8bit));
            else return unknown(at, "psnr_db, flip_mean, share_above_1, max_abs_8bit");
        }
        return {};
    }

  private:
    std::string_view source_;
};

}  // namespace

Expected<Tolerance> parse_tolerance(std::string_view text, std::string_view source) {
    const ToleranceReader reader(source);
    json value;
    try {
        value = json::parse(text);
    } catch (const json::parse_error& error) {
        // The parser counts bytes from 1.
        const TextPosition at = text_position(text, error.byte > 0 ? error.byte - 1 : 0);
        return reader.wrong(fmt::format("the text is no JSON from line {}, column {}, on", at.line, at.column));
    } catch (const json::exception& error) {
        return reader.wrong(error.what());
    }
    Tolerance result;
    NACRE_CHECK(reader.object(value, "the file"));
    for (const auto& [key, member] : value.items()) {
        if (key == "fields_differing") NACRE_CHECK(reader.number(member, key, result.fields_differing));
        else if (key == "final") NACRE_CHECK(reader.final_picture(member, result));
        else if (key == "textures") {
            NACRE_CHECK(reader.object(member, "textures"));
            for (const auto& [name, texture] : member.items()) {
                NACRE_TRY(result.textures[name], reader.texture(texture, "textures." + name));
            }
        } else {
            return reader.unknown(key, "fields_differing, final, textures");
        }
    }
    return result;
}

}  // namespace nacre::measure
