// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/instance.h"

#include <algorithm>
#include <cstring>

#include "backends/vulkan/result.h"
#include "core/log.h"

namespace nacre::vulkan {
namespace {

constexpr const char* validation_layer = "VK_LAYER_KHRONOS_validation";

bool has_layer(const GlobalFunctions& vk, const char* name) {
    std::uint32_t count = 0;
    vk.EnumerateInstanceLayerProperties(&count, nullptr);
    std::vector<VkLayerProperties> layers(count);
    vk.EnumerateInstanceLayerProperties(&count, layers.data());
    return std::ranges::any_of(layers, [&](const auto& layer) { return std::strcmp(layer.layerName, name) == 0; });
}

bool has_extension(const GlobalFunctions& vk, const char* layer, const char* name) {
    std::uint32_t count = 0;
    vk.EnumerateInstanceExtensionProperties(layer, &count, nullptr);
    std::vector<VkExtensionProperties> extensions(count);
    vk.EnumerateInstanceExtensionProperties(layer, &count, extensions.data());
    return std::ranges::any_of(extensions,
                               [&](const auto& each) { return std::strcmp(each.extensionName, name) == 0; });
}

VKAPI_ATTR VkBool32 VKAPI_CALL receive_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                               VkDebugUtilsMessageTypeFlagsEXT types,
                                               const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
    const auto& options = *static_cast<const InstanceOptions*>(user);
    const char* text = data->pMessage ? data->pMessage : "";
    // General messages are the loader's own (a driver of another architecture that it skipped, say): not about us.
    if (!(types & VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT)) {
        log_message(LogLevel::debug, text);
        return VK_FALSE;
    }
    if (options.report)
        options.report({.severity = severity >= VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT
                                        ? rhi::MessageSeverity::error
                                        : rhi::MessageSeverity::warning,
                        .source = rhi::MessageSource::driver,
                        .code = data->pMessageIdName ? data->pMessageIdName : "",
                        .text = text});
    return VK_FALSE;
}

}  // namespace

Expected<std::shared_ptr<const Instance>> Instance::create(std::shared_ptr<const Library> library,
                                                           InstanceOptions options) {
    const GlobalFunctions& global = library->vk;
    std::vector<const char*> layers;
    std::vector<const char*> extensions;
    if (options.validation) {
        if (!has_layer(global, validation_layer))
            return nacre::fail(ErrorCode::not_found, "create Vulkan instance with driver validation", validation_layer,
                               "the layer is not installed",
                               "Install the package vulkan-validationlayers, or turn driver validation off.");
        layers.push_back(validation_layer);
    }
    std::shared_ptr<Instance> instance(new Instance);
    instance->library_ = library;
    instance->options_ = std::move(options);
    instance->version_ = std::min(library->version, instance->options_.highest_version);
    instance->has_debug_utils_ = has_extension(global, nullptr, VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    if (instance->has_debug_utils_) extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);

    const VkValidationFeatureEnableEXT enabled[] = {VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
    VkValidationFeaturesEXT validation{VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT};
    validation.enabledValidationFeatureCount = 1;
    validation.pEnabledValidationFeatures = enabled;
    VkDebugUtilsMessengerCreateInfoEXT messenger{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    messenger.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    messenger.messageType =
        VK_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    messenger.pfnUserCallback = receive_message;
    messenger.pUserData = &instance->options_;

    VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
    application.pEngineName = "Nacre";
    application.apiVersion = instance->version_;
    VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    info.pApplicationInfo = &application;
    if (instance->options_.validation) {
        if (has_extension(global, validation_layer, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME)) {
            extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
            info.pNext = &validation;
        }
        // Chained in, the messenger also sees the creation and the destruction of the instance.
        if (instance->has_debug_utils_) {
            messenger.pNext = info.pNext;
            info.pNext = &messenger;
        }
    }
    info.enabledLayerCount = static_cast<std::uint32_t>(layers.size());
    info.ppEnabledLayerNames = layers.data();
    info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    if (VkResult result = global.CreateInstance(&info, nullptr, &instance->handle_); result != VK_SUCCESS) {
        instance->handle_ = VK_NULL_HANDLE;
        if (result == VK_ERROR_INCOMPATIBLE_DRIVER)
            return nacre::fail(ErrorCode::not_found, "create Vulkan instance", library->file.name(),
                               "no Vulkan driver is installed (VK_ERROR_INCOMPATIBLE_DRIVER)",
                               "Install the package mesa-vulkan-drivers or your graphics card's driver.");
        return fail(result, "create Vulkan instance", library->file.name());
    }
    // Without this function the instance could not be destroyed, whatever else is missing.
    instance->vk.DestroyInstance =
        reinterpret_cast<PFN_vkDestroyInstance>(global.GetInstanceProcAddr(instance->handle_, "vkDestroyInstance"));
    NACRE_TRY(instance->vk, InstanceFunctions::load(global, instance->handle_));
    if (instance->options_.validation && instance->vk.CreateDebugUtilsMessengerEXT) {
        messenger.pNext = nullptr;
        if (VkResult result = instance->vk.CreateDebugUtilsMessengerEXT(instance->handle_, &messenger, nullptr,
                                                                        &instance->messenger_);
            result != VK_SUCCESS)
            return fail(result, "create debug messenger", validation_layer);
    }
    return instance;
}

Instance::~Instance() {
    if (messenger_) vk.DestroyDebugUtilsMessengerEXT(handle_, messenger_, nullptr);
    if (handle_ && vk.DestroyInstance) vk.DestroyInstance(handle_, nullptr);
}

Expected<std::vector<VkPhysicalDevice>> Instance::physical_devices() const {
    std::uint32_t count = 0;
    VkResult result = vk.EnumeratePhysicalDevices(handle_, &count, nullptr);
    std::vector<VkPhysicalDevice> devices(count);
    if (result == VK_SUCCESS && count > 0) result = vk.EnumeratePhysicalDevices(handle_, &count, devices.data());
    if (result != VK_SUCCESS) return fail(result, "list Vulkan devices", library_->file.name());
    devices.resize(count);
    return devices;
}

}  // namespace nacre::vulkan
