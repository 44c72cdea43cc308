// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/loader.h"

#include <fmt/format.h>

#include "backends/vulkan/quirks.h"

namespace nacre::vulkan {
namespace {

std::unexpected<Error> missing_function(const char* name) {
    return fail(ErrorCode::unsupported, "load the Vulkan driver", fmt::format("function '{}'", name),
                "the driver says that it has this version of Vulkan, but does not have this function",
                "Update the graphics driver.");
}

}  // namespace

Expected<InstanceFunctions> InstanceFunctions::load(const GlobalFunctions& global, VkInstance instance) {
    InstanceFunctions result;
#define NACRE_LOAD(name)                                                                            \
    result.name = reinterpret_cast<PFN_vk##name>(global.GetInstanceProcAddr(instance, "vk" #name)); \
    if (!result.name) return missing_function("vk" #name);
    NACRE_VULKAN_INSTANCE_FUNCTIONS(NACRE_LOAD)
#undef NACRE_LOAD
#define NACRE_LOAD(name) result.name = reinterpret_cast<PFN_vk##name>(global.GetInstanceProcAddr(instance, "vk" #name));
    NACRE_VULKAN_OPTIONAL_INSTANCE_FUNCTIONS(NACRE_LOAD)
#undef NACRE_LOAD
    return result;
}

Expected<DeviceFunctions> DeviceFunctions::load(const InstanceFunctions& functions, VkDevice device) {
    DeviceFunctions result;
#define NACRE_LOAD(name)                                                                           \
    result.name = reinterpret_cast<PFN_vk##name>(functions.GetDeviceProcAddr(device, "vk" #name)); \
    if (!result.name) return missing_function("vk" #name);
    NACRE_VULKAN_DEVICE_FUNCTIONS(NACRE_LOAD)
#undef NACRE_LOAD
#define NACRE_LOAD(name)                                                                           \
    result.name = reinterpret_cast<PFN_vk##name>(functions.GetDeviceProcAddr(device, "vk" #name)); \
    if (!result.name)                                                                              \
        result.name = reinterpret_cast<PFN_vk##name>(functions.GetDeviceProcAddr(device, "vk" #name "KHR"));
    NACRE_VULKAN_PROMOTED_DEVICE_FUNCTIONS(NACRE_LOAD)
#undef NACRE_LOAD
#define NACRE_LOAD(name) result.name = reinterpret_cast<PFN_vk##name>(functions.GetDeviceProcAddr(device, "vk" #name));
    NACRE_VULKAN_OPTIONAL_DEVICE_FUNCTIONS(NACRE_LOAD)
    NACRE_VULKAN_RAY_DEVICE_FUNCTIONS(NACRE_LOAD)
#undef NACRE_LOAD
    return result;
}

Expected<std::shared_ptr<const Library>> Library::open() {
    prepare_for_drivers();
    auto library = std::make_shared<Library>();
    NACRE_TRY(library->file,
              DynamicLibrary::open({"libvulkan.so.1", "libvulkan.so"}, "libvulkan1", LibraryLifetime::resident));
    NACRE_TRY(library->vk.GetInstanceProcAddr,
              library->file.symbol<PFN_vkGetInstanceProcAddr>("vkGetInstanceProcAddr"));
#define NACRE_LOAD(name)                                                                                     \
    library->vk.name = reinterpret_cast<PFN_vk##name>(library->vk.GetInstanceProcAddr(nullptr, "vk" #name)); \
    if (!library->vk.name) return missing_function("vk" #name);
    NACRE_VULKAN_GLOBAL_FUNCTIONS(NACRE_LOAD)
#undef NACRE_LOAD
    library->vk.EnumerateInstanceVersion(&library->version);
    if (library->version < VK_API_VERSION_1_2)
        return fail(ErrorCode::unsupported, "open the Vulkan library", "'" + library->file.name() + "'",
                    fmt::format("it is of version {}.{}, and 1.2 is needed", VK_API_VERSION_MAJOR(library->version),
                                VK_API_VERSION_MINOR(library->version)),
                    "Update the package libvulkan1.");
    return library;
}

}  // namespace nacre::vulkan
