// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "rhi/resources.h"

/// @file
/// Shaders and pipelines. Every default is the one that changes nothing: no culling, no blending, no depth
/// test, one sample.

namespace nacre::rhi {

/// SPIR-V of one entry point, usually from `ShaderCompiler` (rhi/shader_compiler.h). It is validated and
/// reflected on creation; invalid SPIR-V is an error that names the word where it goes wrong.
struct ShaderDesc {
    std::vector<std::uint32_t> spirv;
    ShaderStage stage = ShaderStage::none;  ///< Exactly one.
    std::string entry_point = "main";
    std::string name;                       ///< For messages; usually the path of the GLSL file.
};

/// Value for `layout(constant_id = id)`.
struct SpecializationConstant {
    std::uint32_t id = 0;
    std::variant<bool, std::int32_t, std::uint32_t, float> value;
};

enum class Topology : std::uint8_t { point_list, line_list, line_strip, triangle_list, triangle_strip };
enum class CullMode : std::uint8_t { none, front, back };
/// Seen on the finished picture (row 0 on top).
enum class FrontFace : std::uint8_t { counter_clockwise, clockwise };
enum class FillMode : std::uint8_t { fill, line };
enum class StencilOperation : std::uint8_t {
    keep, zero, replace, increment_clamp, decrement_clamp, invert, increment_wrap, decrement_wrap,
};
enum class BlendFactor : std::uint8_t {
    zero, one,
    source_color, one_minus_source_color, source_alpha, one_minus_source_alpha,
    destination_color, one_minus_destination_color, destination_alpha, one_minus_destination_alpha,
    constant_color, one_minus_constant_color, source_alpha_saturated,
    source1_color, one_minus_source1_color, source1_alpha, one_minus_source1_alpha,
};
enum class BlendOperation : std::uint8_t { add, subtract, reverse_subtract, minimum, maximum };
enum class IndexType : std::uint8_t { uint16, uint32 };

struct VertexAttribute {
    std::uint32_t location = 0;
    std::uint32_t buffer = 0;  ///< Index into GraphicsPipelineDesc::vertex_buffers.
    std::uint32_t offset = 0;  ///< Bytes.
    Format format = Format::undefined;
};

struct VertexBufferLayout {
    std::uint32_t stride = 0;   ///< Bytes between two vertices or instances; 0 repeats one value.
    bool per_instance = false;
};

struct StencilFace {
    StencilOperation fail = StencilOperation::keep;
    StencilOperation depth_fail = StencilOperation::keep;
    StencilOperation pass = StencilOperation::keep;
    CompareOperation compare = CompareOperation::always;
    std::uint8_t read_mask = 0xff;
    std::uint8_t write_mask = 0xff;
};

struct DepthStencilState {
    Format format = Format::undefined;  ///< undefined: the pipeline is used without a depth target.
    bool depth_test = false;
    bool depth_write = false;
    CompareOperation depth_compare = CompareOperation::less_or_equal;
    bool stencil_test = false;
    StencilFace front{}, back{};
    float depth_bias = 0.0f;            ///< In units of the smallest resolvable difference.
    float depth_bias_slope = 0.0f;
    float depth_bias_clamp = 0.0f;      ///< 0: off.
    bool depth_clamp = false;
};

struct BlendState {
    bool enabled = false;
    BlendFactor source_color = BlendFactor::one, destination_color = BlendFactor::zero;
    BlendOperation color_operation = BlendOperation::add;
    BlendFactor source_alpha = BlendFactor::one, destination_alpha = BlendFactor::zero;
    BlendOperation alpha_operation = BlendOperation::add;
    friend bool operator==(const BlendState&, const BlendState&) = default;
};

struct ColorTargetState {
    Format format = Format::undefined;
    BlendState blend{};
    std::uint8_t write_mask = 0xf;  ///< Bit 0 red to bit 3 alpha.
};

struct GraphicsPipelineDesc {
    Shader vertex;
    Shader fragment{};  ///< May be empty: depth only.
    std::vector<SpecializationConstant> specialization;
    std::vector<VertexBufferLayout> vertex_buffers;
    std::vector<VertexAttribute> vertex_attributes;
    Topology topology = Topology::triangle_list;
    CullMode cull = CullMode::none;
    FrontFace front_face = FrontFace::counter_clockwise;
    FillMode fill = FillMode::fill;
    std::uint32_t samples = 1;
    bool alpha_to_coverage = false;
    DepthStencilState depth_stencil{};
    std::vector<ColorTargetState> color_targets;
    std::vector<BindGroupLayout> bind_group_layouts;  ///< Empty: all by reflection.
    std::string name;
};

struct ComputePipelineDesc {
    Shader shader;
    std::vector<SpecializationConstant> specialization;
    std::vector<BindGroupLayout> bind_group_layouts;  ///< Empty: all by reflection.
    std::string name;
};

}  // namespace nacre::rhi
