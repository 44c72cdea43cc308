// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace nacre::measure {

/// Base64 of RFC 4648 with padding, for data URIs.
std::string base64(std::span<const std::byte> data);

}  // namespace nacre::measure
