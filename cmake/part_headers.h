// SPDX-License-Identifier: Apache-2.0
#pragma once

// What most sources include, compiled once for all parts that use fmt. Sources include what they use all the same.
#include <algorithm>
#include <array>
#include <cstdint>
#include <expected>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
