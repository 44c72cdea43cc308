// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/result.h"

#include <fmt/format.h>

namespace nacre::vulkan {

std::string_view name_of(VkResult result) {
    switch (result) {
#define NACRE_CASE(name) \
    case name: return #name;
        NACRE_CASE(VK_SUCCESS)
        NACRE_CASE(VK_NOT_READY)
        NACRE_CASE(VK_TIMEOUT)
        NACRE_CASE(VK_INCOMPLETE)
        NACRE_CASE(VK_ERROR_OUT_OF_HOST_MEMORY)
        NACRE_CASE(VK_ERROR_OUT_OF_DEVICE_MEMORY)
        NACRE_CASE(VK_ERROR_INITIALIZATION_FAILED)
        NACRE_CASE(VK_ERROR_DEVICE_LOST)
        NACRE_CASE(VK_ERROR_MEMORY_MAP_FAILED)
        NACRE_CASE(VK_ERROR_LAYER_NOT_PRESENT)
        NACRE_CASE(VK_ERROR_EXTENSION_NOT_PRESENT)
        NACRE_CASE(VK_ERROR_FEATURE_NOT_PRESENT)
        NACRE_CASE(VK_ERROR_INCOMPATIBLE_DRIVER)
        NACRE_CASE(VK_ERROR_TOO_MANY_OBJECTS)
        NACRE_CASE(VK_ERROR_FORMAT_NOT_SUPPORTED)
        NACRE_CASE(VK_ERROR_FRAGMENTED_POOL)
        NACRE_CASE(VK_ERROR_OUT_OF_POOL_MEMORY)
        NACRE_CASE(VK_ERROR_FRAGMENTATION)
        NACRE_CASE(VK_ERROR_INVALID_SHADER_NV)
#undef NACRE_CASE
        default: return "an unknown VkResult";
    }
}

std::unexpected<Error> fail(VkResult result, std::string attempted, std::string subject) {
    const auto because = [&](std::string_view reason) { return fmt::format("{} ({})", reason, name_of(result)); };
    switch (result) {
        case VK_ERROR_OUT_OF_HOST_MEMORY:
            return nacre::fail(ErrorCode::out_of_memory, std::move(attempted), std::move(subject),
                               because("the driver ran out of host memory"), "Destroy objects or free memory.");
        case VK_ERROR_OUT_OF_DEVICE_MEMORY:
        case VK_ERROR_OUT_OF_POOL_MEMORY:
        case VK_ERROR_FRAGMENTED_POOL:
        case VK_ERROR_FRAGMENTATION:
        case VK_ERROR_TOO_MANY_OBJECTS:
            return nacre::fail(ErrorCode::out_of_memory, std::move(attempted), std::move(subject),
                               because("the driver ran out of device memory"), "Destroy objects or use smaller ones.");
        case VK_ERROR_DEVICE_LOST:
            return nacre::fail(ErrorCode::device_lost, std::move(attempted), std::move(subject),
                               because("the device was lost"), "Destroy the device and make a new one.");
        case VK_TIMEOUT:
            return nacre::fail(ErrorCode::timeout, std::move(attempted), std::move(subject),
                               because("the time limit passed"), "Wait longer; the work goes on.");
        case VK_ERROR_FEATURE_NOT_PRESENT:
        case VK_ERROR_EXTENSION_NOT_PRESENT:
        case VK_ERROR_LAYER_NOT_PRESENT:
        case VK_ERROR_FORMAT_NOT_SUPPORTED:
        case VK_ERROR_INCOMPATIBLE_DRIVER:
            return nacre::fail(ErrorCode::unsupported, std::move(attempted), std::move(subject),
                               because("the driver does not have what was asked for"), "Update the graphics driver.");
        default:
            return nacre::fail(ErrorCode::internal, std::move(attempted), std::move(subject),
                               because("the driver failed"),
                               "Run with driver validation on to see whether the call was wrong.");
    }
}

std::string in_quotes(std::string_view name) { return name.empty() ? "(unnamed)" : fmt::format("'{}'", name); }

}  // namespace nacre::vulkan
