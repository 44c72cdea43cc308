// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "rhi/device.h"
#include "samples/nacre/backends.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"

namespace nacre::command {
namespace {

using Json = nlohmann::ordered_json;

Expected<std::vector<rhi::CapabilityEntry>> capabilities_of(const rhi::Instance& instance,
                                                           const rhi::AdapterInfo& adapter) {
    NACRE_TRY(const auto device, instance.create_device({.backend = adapter.backend, .adapter = adapter.index}));
    return rhi::list_capabilities(device->capabilities());
}

}  // namespace

Outcome run(const DevicesArguments& arguments) {
    const auto instance = make_instance();
    TextTable table({"backend", "device", "name", "interface", "driver", "kind"});
    std::string details;
    Json devices = Json::array();
    Json unavailable = Json::array();
    for (const rhi::AdapterInfo& adapter : instance->adapters()) {
        const std::string kind = adapter.is_software ? "software" : "hardware";
        table.add({adapter.backend, fmt::format("{}", adapter.index), adapter.name, adapter.api_version, adapter.driver,
                   kind});
        Json entry{{"backend", adapter.backend},         {"index", adapter.index},
                   {"name", adapter.name},               {"driver", adapter.driver},
                   {"api_version", adapter.api_version}, {"is_software", adapter.is_software}};
        if (arguments.capabilities) {
            NACRE_TRY(const auto entries, capabilities_of(*instance, adapter));
            TextTable list({"capability", "value"});
            for (const rhi::CapabilityEntry& capability : entries) {
                list.add({capability.name, capability.value});
                entry["capabilities"][capability.name] = capability.value;
            }
            details += fmt::format("\n{} {}: {}\n{}", adapter.backend, adapter.index, adapter.name, list.text());
        }
        devices.push_back(std::move(entry));
    }
    std::string text = devices.empty() ? "No device can be used here.\n" : table.text();
    for (const rhi::UnavailableBackend& backend : instance->unavailable()) {
        text += fmt::format("{} cannot be used: {}\n", backend.backend, backend.error.message());
        unavailable.push_back({{"backend", backend.backend}, {"reason", backend.error.message()}});
    }
    print_result(arguments.json, text + details);
    NACRE_CHECK(
        write_json(arguments.json, Json{{"devices", std::move(devices)}, {"unavailable", std::move(unavailable)}}.dump(
                                       2, ' ', false, Json::error_handler_t::replace) +
                                       "\n"));
    return ExitCode::success;
}

}  // namespace nacre::command
