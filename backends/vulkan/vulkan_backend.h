// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "rhi/backend.h"

/// @file
/// The Vulkan backend: Vulkan 1.2 and later, opened at run time.
///
///     rhi::Instance instance({vulkan::make_backend()});
///     auto device = *instance.create_device({.backend = "vulkan"});
///
/// Modes of a backend spec: none (dynamic rendering and synchronization2 where the driver has them), `renderpass`
/// (VkRenderPass objects although dynamic rendering is there) and `legacy` (also without synchronization2).

namespace nacre::vulkan {

/// Opens nothing yet: the driver is loaded when devices are first asked for.
std::unique_ptr<rhi::Backend> make_backend();

}  // namespace nacre::vulkan
