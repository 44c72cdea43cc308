// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <glm/vec4.hpp>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "materials/tree_shader.h"
#include "rhi/device.h"

/// @file
/// Runs the shader of a tree on a device for many views and lights.

namespace nacre::materials {

/// Tests that run on each of `backends`; skipped where there is no such device, failed where it does not work.
class TreeDeviceTest : public testing::TestWithParam<const char*> {
  public:
    static constexpr const char* backends[] = {"cpu:consistent", "vulkan", "gl"};
    /// Without the mode.
    static std::string name_of(const testing::TestParamInfo<const char*>& backend);

  protected:
    void SetUp() override;

    std::unique_ptr<rhi::Device> device_;
};

inline constexpr std::uint32_t direction_pairs = 256;

/// direction_pairs views, each followed by a light, at all angles; some of them grazing.
[[nodiscard]] std::vector<glm::vec4> random_directions(std::mt19937& random);

/// Compiles `text` behind the tree's defines and declarations of its parameters, textures (four different values, the
/// same for all), tables and of `vec4 directions[]`; dispatches one invocation for each pair and returns the buffer of
/// set 0, binding 2, which the text declares.
[[nodiscard]] Expected<std::vector<std::byte>> run_tree(rhi::Device& device, const TreeShader& tree,
                                                        const std::string& text,
                                                        const std::vector<glm::vec4>& directions,
                                                        std::size_t result_bytes);

}  // namespace nacre::materials
