// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "tests/backends/cpu/images/test_image.h"

/// @file
/// Texture sampling written down a second time, one point after the other in double precision, as the Vulkan
/// specification has it (chapter "Image Operations"). Nothing is shared with the code under test but the decoding of
/// texels, which has its own tests.

namespace nacre::cpu::test {

struct ReferenceResult {
    std::array<double, 4> value{};
    /// A decision (which texel, which mip, which face) hangs on the last bits of a float: another result is as right.
    bool is_ambiguous = false;
};

class ReferenceSampler {
  public:
    ReferenceSampler(const TestImage& image, const rhi::SamplerDesc& sampler) : image_(image), sampler_(sampler) {}

    /// `quad`: the four points of the quad, which an implicit level of detail depends on; `index`: which of them.
    ReferenceResult sample(std::uint32_t flags, std::span<const Point, 4> quad, std::size_t index);
    /// Mip and unclamped level of detail (textureQueryLod).
    ReferenceResult query(std::uint32_t flags, std::span<const Point, 4> quad, std::size_t index);

  private:
    using Vector = std::array<double, 3>;
    struct Detail {
        double unclamped = 0.0, lambda = 0.0;
        int samples = 1;
        std::array<double, 2> axis{};
    };
    struct FaceCoordinates {
        int face = 0;
        double s = 0.0, t = 0.0;
    };
    FaceCoordinates project(const Vector& direction);
    Detail detail(std::uint32_t flags, std::span<const Point, 4> quad, std::size_t index);
    std::array<double, 4> level(std::uint32_t flags, const Point& point, const Detail& detail, int mip, bool is_linear);
    std::array<double, 4> once(std::uint32_t flags, const Point& point, const Vector& at, int mip, bool is_linear);
    std::array<double, 4> texel(std::uint32_t flags, const Point& point, int mip, int layer, std::array<int, 3> at);
    std::array<double, 4> cube_texel(std::uint32_t flags, const Point& point, int mip, int first_layer, int face, int i,
                                     int j, bool& exists);
    /// floor, and a mark where the value is close to a whole number.
    int decide(double value);

    const TestImage& image_;
    const rhi::SamplerDesc& sampler_;
    bool is_ambiguous_ = false;
};

}  // namespace nacre::cpu::test
