// SPDX-License-Identifier: Apache-2.0
#include "passes/plan.h"

#include <fmt/format.h>
#include <iterator>
#include <nlohmann/json.hpp>

namespace nacre::passes {
namespace {

std::string size_text(std::uint64_t bytes) {
    if (bytes >= 1u << 20) return fmt::format("{:.2f} MiB", static_cast<double>(bytes) / (1u << 20));
    if (bytes >= 1u << 10) return fmt::format("{:.1f} KiB", static_cast<double>(bytes) / (1u << 10));
    return fmt::format("{} B", bytes);
}

std::string joined(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text.empty() ? "nothing" : text;
}

std::string features_of(const PlannedShader& shader) {
    std::string text;
    for (const rhi::ShaderDefine& define : shader.defines) {
        text += text.empty() ? "" : " ";
        text += define.value == "1" ? define.name : define.name + "=" + define.value;
    }
    return text.empty() ? "no features" : text;
}

}  // namespace

std::string to_text(const Plan& plan) {
    std::string text;
    auto out = std::back_inserter(text);
    fmt::format_to(out, "scene    {}\nprofile  {}\ndevice   {} ({})\nsize     {} x {}\n\nPasses\n", plan.scene,
                   plan.profile, plan.device, plan.backend, plan.width, plan.height);
    for (const PlannedPass& pass : plan.passes) {
        fmt::format_to(out, "  {}{}\n    reads   {}\n    writes  {}\n", pass.name,
                       pass.draws > 0 ? fmt::format(" ({} draws)", pass.draws) : "", joined(pass.reads),
                       joined(pass.writes));
        for (const PlannedShader& shader : pass.shaders) {
            fmt::format_to(out, "    shader  {} [{}] {} {:016x}\n", shader.path, features_of(shader),
                           size_text(shader.spirv_bytes), shader.spirv_hash);
        }
    }
    fmt::format_to(out, "\nResources\n");
    for (const PlannedResource& resource : plan.resources) {
        std::string shape;
        if (!resource.format.empty()) {
            shape = fmt::format("{} {} x {}", resource.format, resource.width, resource.height);
            if (resource.layers > 1) shape += fmt::format(" x {} layers", resource.layers);
            if (resource.mips > 1) shape += fmt::format(", {} mips", resource.mips);
        } else {
            shape = "buffer";
        }
        fmt::format_to(out, "  {:<22} {:<38} {:>12}{}\n", resource.name, shape, size_text(resource.bytes),
                       !resource.shares_with.empty() ? "  in the memory of " + resource.shares_with
                       : resource.persistent         ? "  persistent"
                                                     : "");
    }
    fmt::format_to(out,
                   "\nBytes\n  G-buffer   {} per pixel\n  transient  {} ({} without sharing)\n  persistent {}\n"
                   "  geometry   {}\n  textures   {}\n\nLeft out\n",
                   plan.gbuffer_bytes_per_pixel, size_text(plan.transient_bytes),
                   size_text(plan.transient_bytes_unshared), size_text(plan.persistent_bytes),
                   size_text(plan.geometry_bytes), size_text(plan.texture_bytes));
    for (const LeftOut& left_out : plan.left_out) fmt::format_to(out, "  {}: {}\n", left_out.what, left_out.why);
    if (plan.left_out.empty()) text += "  nothing\n";
    return text;
}

std::string to_json(const Plan& plan) {
    using nlohmann::json;
    json document = {{"scene", plan.scene},
                     {"profile", plan.profile},
                     {"backend", plan.backend},
                     {"device", plan.device},
                     {"size", {plan.width, plan.height}},
                     {"gbuffer_bytes_per_pixel", plan.gbuffer_bytes_per_pixel},
                     {"transient_bytes", plan.transient_bytes},
                     {"transient_bytes_unshared", plan.transient_bytes_unshared},
                     {"persistent_bytes", plan.persistent_bytes},
                     {"geometry_bytes", plan.geometry_bytes},
                     {"texture_bytes", plan.texture_bytes},
                     {"passes", json::array()},
                     {"resources", json::array()},
                     {"left_out", json::array()}};
    for (const PlannedPass& pass : plan.passes) {
        json shaders = json::array();
        for (const PlannedShader& shader : pass.shaders) {
            json defines = json::object();
            for (const rhi::ShaderDefine& define : shader.defines) defines[define.name] = define.value;
            shaders.push_back({{"path", shader.path},
                               {"features", defines},
                               {"spirv_bytes", shader.spirv_bytes},
                               {"spirv_hash", fmt::format("{:016x}", shader.spirv_hash)}});
        }
        document["passes"].push_back({{"name", pass.name},
                                      {"reads", pass.reads},
                                      {"writes", pass.writes},
                                      {"draws", pass.draws},
                                      {"shaders", shaders}});
    }
    for (const PlannedResource& resource : plan.resources) {
        document["resources"].push_back({{"name", resource.name},
                                         {"format", resource.format},
                                         {"width", resource.width},
                                         {"height", resource.height},
                                         {"layers", resource.layers},
                                         {"mips", resource.mips},
                                         {"bytes", resource.bytes},
                                         {"shares_with", resource.shares_with},
                                         {"persistent", resource.persistent}});
    }
    for (const LeftOut& left_out : plan.left_out) {
        document["left_out"].push_back({{"what", left_out.what}, {"why", left_out.why}});
    }
    return document.dump(2, ' ', false, json::error_handler_t::replace);
}

}  // namespace nacre::passes
