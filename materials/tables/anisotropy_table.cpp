// SPDX-License-Identifier: Apache-2.0
#include "materials/tables/anisotropy_table.h"

namespace nacre::materials {
namespace {

constexpr std::uint16_t anisotropy_words[] = {
#include "materials/tables/anisotropy_table_data.inc"
};
static_assert(sizeof(anisotropy_words) == 2 * 2 * 18 * 15 * 15 * 4);

}  // namespace

std::span<const std::uint16_t> anisotropy_table() { return anisotropy_words; }

}  // namespace nacre::materials
