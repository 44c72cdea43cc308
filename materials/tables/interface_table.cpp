// SPDX-License-Identifier: Apache-2.0
#include "materials/tables/interface_table.h"

namespace nacre::materials {
namespace {

constexpr std::uint16_t interface_words[] = {
#include "materials/tables/interface_table_data.inc"
};
static_assert(sizeof(interface_words) == 2 * 4 * interface_table_columns * interface_table_rows);

}  // namespace

std::span<const std::uint16_t> interface_table() { return interface_words; }

}  // namespace nacre::materials
