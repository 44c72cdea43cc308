// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>

#include "passes/gbuffer_layout.h"
#include "scene/builtin.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(CrossBackend);

/// What the first variant of a profile rendered, to compare the others with.
struct Reference {
    ImageBytes picture;
    std::map<std::string, std::vector<std::uint32_t>> words;
};

Reference take(const Shot& shot) {
    Reference reference{.picture = shot.picture.tone_mapped};
    for (const char* name : {"material.0", "material.1", "top_layer"}) {
        reference.words[name] = shot.intermediate<std::uint32_t>(name);
    }
    return reference;
}

// Every built-in scene on every backend against the first one: decoded fields and final picture.
TEST_P(CrossBackend, BuiltinScenesAgree) {
    static std::map<std::string, Reference> references;
    for (const std::string_view name : scene::builtin_scene_names()) {
        // Its words are streams of fields, which measure/closure_comparison.h compares.
        if (name == "builtin:materials") continue;
        auto scene = scene::make_builtin_scene(name);
        ASSERT_TRUE(scene);
        const std::string profile = GetParam().profile;
        const Shot shot = render(*scene, {.profile = profile, .width = 320, .height = 180, .keep_intermediates = true});
        const Reference mine = take(shot);
        const auto [known, is_first] = references.try_emplace(std::string(name) + profile, mine);
        if (is_first) continue;
        const Reference& first = known->second;
        for (const auto& [texture, words] : mine.words) {
            const auto& theirs = first.words.at(texture);
            ASSERT_EQ(words.size(), theirs.size());
            std::size_t differing = 0;
            for (std::size_t i = 0; i < words.size(); ++i) {
                for (const passes::Field& field : passes::fields_of(texture)) {
                    if (!passes::field_differs(field, words[i], theirs[i])) continue;
                    ++differing;
                    break;
                }
            }
            EXPECT_LT(static_cast<double>(differing), 5e-4 * static_cast<double>(words.size()))
                << name << " " << texture;
        }
        double sum = 0.0;
        for (std::size_t i = 0; i < mine.picture.bytes.size(); ++i) {
            const double d = (static_cast<double>(mine.picture.bytes[i]) - first.picture.bytes[i]) / 255.0;
            sum += d * d;
        }
        const double psnr =
            sum == 0.0 ? 200.0 : -10.0 * std::log10(sum / static_cast<double>(mine.picture.bytes.size()));
        EXPECT_GT(psnr, 50.0) << name;
        // A black or unlit picture is no evidence.
        std::size_t lit = 0;
        for (const std::uint8_t byte : mine.picture.bytes) lit += byte > 12 && byte < 250;
        EXPECT_GT(lit, mine.picture.bytes.size() / 4) << name;
    }
}

// The same frame twice is the same picture, bit for bit.
TEST_P(CrossBackend, FramesRepeat) {
    auto scene = scene::make_builtin_scene("builtin:lights");
    ASSERT_TRUE(scene);
    const Shot shot = render(*scene, {.width = 160, .height = 90});
    ASSERT_TRUE(shot.renderer->render_frame());
    auto again = shot.renderer->read_final();
    ASSERT_TRUE(again);
    EXPECT_EQ(shot.picture.radiance, again->radiance);
    EXPECT_EQ(shot.picture.tone_mapped, again->tone_mapped);
}

}  // namespace
}  // namespace nacre::test
