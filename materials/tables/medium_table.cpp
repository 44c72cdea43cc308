// SPDX-License-Identifier: Apache-2.0
#include "materials/tables/medium_table.h"

namespace nacre::materials {
namespace {

constexpr std::uint16_t medium_words[] = {
#include "materials/tables/medium_table_data.inc"
};
static_assert(sizeof(medium_words) == 2 * 2 * medium_table_columns * medium_table_rows * medium_table_slices);

}  // namespace

std::span<const std::uint16_t> medium_table() { return medium_words; }

}  // namespace nacre::materials
