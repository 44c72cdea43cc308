// SPDX-License-Identifier: Apache-2.0
#include "materials/tables/medium_table.h"

namespace nacre::materials {
namespace {

constexpr std::uint16_t table[] = {
#include "materials/tables/medium_table_data.inc"
};
static_assert(sizeof(table) == 2 * 2 * medium_table_columns * medium_table_rows * medium_table_slices);

}  // namespace

std::span<const std::uint16_t> medium_table() { return table; }

}  // namespace nacre::materials
