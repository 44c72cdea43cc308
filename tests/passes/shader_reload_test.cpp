// SPDX-License-Identifier: Apache-2.0
// Shaders that are edited while a renderer runs: the picture follows; a broken one leaves the picture as it is.
#include <gmock/gmock.h>

#include <algorithm>

#include "core/file.h"
#include "scene/shapes.h"
#include "tests/core/temporary_folder.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

using ::testing::HasSubstr;

/// A source folder with a few of the program's shaders, to be edited.
class SourceFolder {
  public:
    explicit SourceFolder(const std::vector<std::string>& paths) {
        for (const std::string& path : paths) {
            for (const EmbeddedFile& file : passes::embedded_files()) {
                if (file.path == path) write(path, std::string(file.text));
            }
        }
    }
    [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }

    void write(const std::string& file, const std::string& text) {
        const auto written = write_file_atomically(path() / file, text);
        if (!written) ADD_FAILURE() << written.error().message();
    }
    /// Puts `after` in the place of `before`, which the file must hold once. Returns the line.
    std::size_t edit(const std::string& file, const std::string& before, const std::string& after) {
        auto text = read_text_file(path() / file);
        if (!text) ADD_FAILURE() << text.error().message();
        const std::size_t at = text->find(before);
        if (at == std::string::npos || text->find(before, at + 1) != std::string::npos) {
            ADD_FAILURE() << file << " does not hold '" << before << "' once";
            return 0;
        }
        text->replace(at, before.size(), after);
        write(file, *text);
        return 1 + static_cast<std::size_t>(
                       std::count(text->begin(), text->begin() + static_cast<std::ptrdiff_t>(at), '\n'));
    }

  private:
    TemporaryFolder folder_;
};

class ShaderReload : public RendererTest {
  public:
    /// A diffuse square that fills the picture, under an environment of radiance 1: its radiance is its albedo.
    Shot first_shot(const SourceFolder& folder) {
        scene::Scene scene = empty_scene();
        scene.environment = uniform_environment(glm::vec3(1.0f));
        place(scene, scene::parallelogram({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}),
              add_material(scene, matte({0.8f, 0.4f, 0.2f})));
        return render(scene, {.width = 16,
                              .height = 16,
                              .exposure_ev = 0.0f,
                              .tone_mapping = passes::ToneMapping::linear,
                              .shader_folder = folder.path()});
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ShaderReload);
INSTANTIATE_TEST_SUITE_P(Passes, ShaderReload, ::testing::ValuesIn(render_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

void next_frame(Shot& shot) {
    ASSERT_TRUE(shot.renderer->render_frame());
    auto picture = shot.renderer->read_final();
    ASSERT_TRUE(picture) << picture.error().message();
    shot.picture = *std::move(picture);
}

void expect_radiance(const Shot& shot, const glm::vec3& expected) {
    const glm::vec3 found = shot.radiance_at(8, 8);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], 6e-3f) << "channel " << c;
}

constexpr const char* base_pass = "passes/base_pass/base_pass.frag";
constexpr const char* tone_mapping = "passes/tonemap/tonemap.comp";
constexpr const char* prefilter = "passes/environment_preparation/prefilter.comp";

TEST_P(ShaderReload, ThePictureFollowsADrawingPass) {
    SourceFolder folder({base_pass});
    Shot shot = first_shot(folder);
    expect_radiance(shot, {0.8f, 0.4f, 0.2f});
    EXPECT_TRUE(shot.renderer->reload_shaders().empty());

    folder.edit(base_pass, "base_color().rgb", "base_color().bgr");
    const auto reloads = shot.renderer->reload_shaders();
    ASSERT_EQ(reloads.size(), 1u);
    EXPECT_EQ(reloads[0].pipeline, "base pass");
    EXPECT_FALSE(reloads[0].error) << reloads[0].error->message();
    next_frame(shot);
    expect_radiance(shot, {0.2f, 0.4f, 0.8f});
    EXPECT_TRUE(shot.renderer->reload_shaders().empty());
}

TEST_P(ShaderReload, ThePictureFollowsAComputingPass) {
    SourceFolder folder({tone_mapping});
    Shot shot = first_shot(folder);
    const glm::ivec3 before = shot.bytes_at(8, 8);
    folder.edit(tone_mapping, "exposure.x;", "exposure.x; color = color.gbr;");
    const auto reloads = shot.renderer->reload_shaders();
    ASSERT_EQ(reloads.size(), 1u);
    EXPECT_EQ(reloads[0].pipeline, tone_mapping);
    EXPECT_FALSE(reloads[0].error) << reloads[0].error->message();
    next_frame(shot);
    EXPECT_EQ(shot.bytes_at(8, 8), glm::ivec3(before.y, before.z, before.x));
    expect_radiance(shot, {0.8f, 0.4f, 0.2f});
}

TEST_P(ShaderReload, ABrokenShaderKeepsThePictureAndIsReportedOnce) {
    SourceFolder folder({base_pass, tone_mapping});
    Shot shot = first_shot(folder);
    const ImageBytes before = shot.picture.tone_mapped;
    const std::size_t line = folder.edit(base_pass, "base_color().rgb", "base_colour().rgb");
    folder.edit(tone_mapping, "void main()", "layout(set = 0, binding = 7) uniform Tint { vec4 tint; };\nvoid main()");

    const auto reloads = shot.renderer->reload_shaders();
    ASSERT_EQ(reloads.size(), 2u);
    ASSERT_TRUE(reloads[0].error);
    EXPECT_EQ(reloads[0].error->code, ErrorCode::shader_compile);
    EXPECT_THAT(reloads[0].error->message(), HasSubstr(std::string(base_pass) + ":" + std::to_string(line) + ": "));
    EXPECT_THAT(reloads[0].error->message(), HasSubstr("base_colour"));
    ASSERT_TRUE(reloads[1].error) << "bind groups in use do not fit";
    EXPECT_THAT(reloads[1].error->message(), HasSubstr("set 0"));
    next_frame(shot);
    EXPECT_EQ(shot.picture.tone_mapped.bytes, before.bytes);
    EXPECT_TRUE(shot.renderer->reload_shaders().empty());

    // Mended, and changed so that it shows.
    folder.edit(base_pass, "base_colour().rgb", "base_color().ggg");
    ASSERT_EQ(shot.renderer->reload_shaders().size(), 1u);
    next_frame(shot);
    expect_radiance(shot, {0.4f, 0.4f, 0.4f});
}

TEST_P(ShaderReload, WhatRunsOnceSaysThatItsChangeDoesNotShow) {
    SourceFolder folder({prefilter});
    Shot shot = first_shot(folder);
    folder.edit(prefilter, "void main()", "const float unused = 1.0;\nvoid main()");
    const auto reloads = shot.renderer->reload_shaders();
    ASSERT_EQ(reloads.size(), 1u);
    ASSERT_TRUE(reloads[0].error);
    EXPECT_EQ(reloads[0].error->code, ErrorCode::unsupported);
    EXPECT_THAT(reloads[0].error->message(), HasSubstr("Start the program again"));
    EXPECT_TRUE(shot.renderer->reload_shaders().empty());
}

TEST_P(ShaderReload, AFolderWithoutShadersIsAnError) {
    const TemporaryFolder empty;
    for (const std::filesystem::path& folder : {empty.path(), empty.path() / "missing"}) {
        const auto renderer = passes::Renderer::create(device(), empty_scene(), {.shader_folder = folder});
        ASSERT_FALSE(renderer);
        EXPECT_EQ(renderer.error().code, ErrorCode::not_found);
        EXPECT_THAT(renderer.error().message(), HasSubstr(folder.string()));
    }
}

}  // namespace
}  // namespace nacre::test
