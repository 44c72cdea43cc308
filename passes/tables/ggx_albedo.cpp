// SPDX-License-Identifier: Apache-2.0
#include "passes/tables/ggx_albedo.h"

namespace nacre::passes {
namespace {

constexpr std::uint16_t table[] = {
#include "passes/tables/ggx_albedo_data.inc"
};
static_assert(sizeof(table) == 2 * 2 * ggx_albedo_size * ggx_albedo_size);

}  // namespace

std::span<const std::uint16_t> ggx_albedo_table() { return table; }

}  // namespace nacre::passes
