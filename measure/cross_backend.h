// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "measure/frame_times.h"
#include "measure/image_metrics.h"
#include "measure/numerical_error.h"
#include "measure/texture_comparison.h"
#include "measure/tolerance.h"
#include "passes/renderer.h"

/// @file
/// One scene on several backends: do they agree?
///
///     std::vector<Contestant> contestants = {{"vulkan", "llvmpipe", *renderer_a}, {"gl", "llvmpipe", *renderer_b}};
///     NACRE_TRY(SceneComparison result, compare_backends("builtin:spheres", contestants));
///     for (const std::string& violation : violations_of(result, Tolerance{})) print(violation);
///
/// The first contestant is the reference. Every texture that passes hand on is compared texel by texel, every layer and
/// mip of it, and then the final picture.

namespace nacre::measure {

/// A renderer to compare, made with `RenderOptions::keep_intermediates`. All must show the same scene at one size.
struct Contestant {
    std::string backend;  ///< As written on the command line: "gl", "cpu:double".
    std::string device;   ///< For people.
    passes::Renderer& renderer;
    /// The renderer's, to find out where errors begin; null: that is left out.
    rhi::Device* rhi_device = nullptr;
};

/// What a texture looked like on both sides, for people.
struct TexturePictures {
    std::string name;
    Image reference;   ///< 3 channels, linear.
    Image difference;  ///< White where texels count as different.
};

/// One contestant's frame, and how far it is from the reference (all zero for the reference itself).
struct BackendResult {
    std::string backend;
    std::string device;
    FrameTimes times;
    passes::FinalPicture picture;
    ValueScan radiance_scan;                   ///< Of the linear radiance.
    std::vector<std::string> warnings;         ///< Of the renderer.
    std::vector<TextureDifference> textures;   ///< In the order in which they are first written.
    std::vector<std::string> missing;          ///< Textures of the reference that this backend lacks.
    std::vector<std::string> added;            ///< Textures that the reference lacks.
    PictureDifference final;
    /// Where the reference is in double precision (Capabilities::float_bits) and this backend is not: of every texture
    /// of numbers in `textures` (of stored closures, "material.slices", of every kind of field), and where the largest
    /// of them begins.
    std::vector<NumericalError> errors;
    std::optional<ErrorOrigin> origin;
    std::string origin_of;  ///< The texture whose error that is: the largest that can be traced.
    /// Where the origin is a value that came in: where that begins, in the pass that made it.
    std::optional<ErrorOrigin> earlier_origin;
    std::string earlier_origin_of;
    std::string no_origin;  ///< Why it is not the largest of all.
    std::vector<TexturePictures> texture_pictures;
};

struct SceneComparison {
    std::string scene;
    std::vector<BackendResult> backends;  ///< The reference first.
    /// Of a reference in double precision: what went through single precision all the same.
    std::vector<rhi::NarrowedOperation> narrowed;

    /// The error of `result` that is the largest part of its texture's largest value; null where there is none.
    [[nodiscard]] static const NumericalError* largest_error(const BackendResult& result);
};

struct ComparisonOptions {
    std::uint32_t frames = 1;       ///< See `time_frames`; the last is compared.
    bool textures = true;           ///< false: only the final picture.
    std::string only_texture;       ///< Compare this one alone; empty: all that are readable.
    bool texture_pictures = false;  ///< Fill `BackendResult::texture_pictures` for textures that differ.
};

/// Renders and compares. Errors: those of the renderers, named by backend; invalid_argument (fewer than one contestant,
/// textures that cannot be compared).
Expected<SceneComparison> compare_backends(std::string scene, std::span<const Contestant> contestants,
                                           const ComparisonOptions& options = {});

/// Everything that is over the tolerance, one sentence each; empty: the backends agree.
std::vector<std::string> violations_of(const SceneComparison& comparison, const Tolerance& tolerance);

/// {"scene", "reference", "results": [{"backend", "textures": [{"name", "texels", "differing", "fields_differing",
/// "max_abs", "max_rel"}], "final": {"psnr_db", "flip_mean", "max_abs_8bit", "share_above_1"}}]}. With a
/// reference in double precision each result also has "numerical_errors" (of each texture), "largest_error" and
/// "origin", and the whole "narrowed". JSON has no infinity: 1.7976931348623157e308 stands for it.
std::string to_json(const SceneComparison& comparison);

/// A texture as `read_intermediate` gives it.
TextureData texture_data_of(passes::IntermediateContent content);

}  // namespace nacre::measure
