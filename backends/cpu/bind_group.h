// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "backends/cpu/checks/checked_memory.h"
#include "backends/cpu/compiler/compiler.h"
#include "backends/cpu/image_view.h"
#include "backends/cpu/shader_interface.h"
#include "rhi/backend.h"

/// @file
/// Bind groups are flat arrays of descriptors, in the order of their layout: bindings in rising order, each with as
/// many descriptors as it has elements. Unbounded arrays come last whatever their number, since their length is that of
/// the group.

namespace nacre::cpu {

class CpuBindGroupLayout : public rhi::BackendBindGroupLayout {
  public:
    /// @param unbounded_capacity  most elements of an unbounded array
    CpuBindGroupLayout(const rhi::BindGroupLayoutDesc& desc, std::uint32_t unbounded_capacity);

    /// Where each binding lies; `set` is 0.
    [[nodiscard]] std::span<const BindingSlots> slots() const { return slots_; }
    /// Null where the layout does not have the binding.
    [[nodiscard]] const BindingSlots* find(std::uint32_t binding) const;
    /// Descriptors before the last unbounded array, or all where there is none.
    [[nodiscard]] std::uint32_t fixed_count() const { return fixed_count_; }

  private:
    std::vector<BindingSlots> slots_;
    std::uint32_t fixed_count_ = 0;
};

/// Slots of all groups of a pipeline, each with its set.
std::vector<BindingSlots> slots_of(std::span<rhi::BackendBindGroupLayout* const> layouts);

class CpuBindGroup : public rhi::BackendBindGroup {
  public:
    std::vector<Descriptor> descriptors;
    CheckedObjects checked;  ///< What lies behind each descriptor; empty on devices without checks.
    std::vector<std::unique_ptr<const ImageView>> texel_views;  ///< Of the texel buffers among the descriptors.

    static Expected<std::unique_ptr<rhi::BackendBindGroup>> create(rhi::BackendBindGroupLayout& layout,
                                                                   std::span<const rhi::BackendBinding> bindings,
                                                                   const std::string& name);
};

}  // namespace nacre::cpu
