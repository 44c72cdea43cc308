// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/tile_data.h"

/// @file
/// What tiles do on doubles, for devices in double precision: planes, depth, colors. One pixel after another; what is
/// covered, and what passes the tests of depth, is decided on the values rounded to float, as everywhere else.

namespace nacre::cpu::raster {

[[gnu::always_inline]] inline DoublePrimitive& double_primitive(PrimitiveData& primitive, const DrawPlan& draw) {
    return *reinterpret_cast<DoublePrimitive*>(reinterpret_cast<std::byte*>(&primitive) +
                                               double_primitive_offset(draw.input_count));
}
[[gnu::always_inline]] inline const DoublePrimitive& double_primitive(const PrimitiveData& primitive,
                                                                      const DrawPlan& draw) {
    return *reinterpret_cast<const DoublePrimitive*>(reinterpret_cast<const std::byte*>(&primitive) +
                                                     double_primitive_offset(draw.input_count));
}

/// The DoublePrimitive of a record, whose PrimitiveData is set up already.
void set_up_double_primitive(const DrawPlan& draw, DepthLayout layout, const Record& record,
                             const std::byte* vertex_memory, PrimitiveData& primitive);

/// gl_FragCoord.z before it is clamped.
double depth_at(const DoublePrimitive& primitive, double x, double y);

/// Keeps the depth that a sample of the target now has.
void store_depth(const TargetSet& targets, std::uint32_t sample, std::int32_t x, std::int32_t y, double depth);

/// Colors of the lanes in `mask`, one after another, over what the target holds: blended, masked, stored with their
/// doubles.
void write_double_colors(const DrawPlan& draw, const ColorPlan& plan, const ColorTarget& target,
                         const FragmentBatch& batch, std::uint32_t sample, std::uint32_t mask);

}  // namespace nacre::cpu::raster
