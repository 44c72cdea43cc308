// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "rhi/device_access.h"
#include "rhi/object_checks.h"

namespace nacre::rhi {
namespace {

/// Puts a made object into its table; an error where the table is full.
template <typename HandleType, typename Object>
Expected<HandleType> insert(DeviceState& device, HandleType kind, Object object, const char* attempted) {
    const std::unique_lock lock(device.shared->tables_mutex);
    const HandleType handle = device.tables().table(kind).insert(std::move(object));
    if (!handle)
        return fail(ErrorCode::out_of_memory, attempted, "device '" + device.shared->desc.name + "'",
                    "16 million objects of this kind exist", "Destroy objects that are no longer used.");
    return handle;
}

template <typename Made>
std::unexpected<Error> backend_failure(DeviceState& device, Made& made) {
    device.note_failure(made.error());
    return std::unexpected(std::move(made).error());
}

const std::string& name_of_object(const BufferObject& object) { return object.desc.name; }
const std::string& name_of_object(const TextureObject& object) { return object.desc.name; }
const std::string& name_of_object(const SamplerObject& object) { return object.desc.name; }
const std::string& name_of_object(const ShaderObject& object) { return object.backend->name; }
const std::string& name_of_object(const BindGroupObject& object) { return object.name; }
const std::string& name_of_object(const GraphicsPipelineObject& object) { return object.common.name; }
const std::string& name_of_object(const ComputePipelineObject& object) { return object.common.name; }
const std::string& name_of_object(const QueryPoolObject& object) { return object.desc.name; }
const std::string& name_of_object(const AccelerationStructureObject& object) { return object.desc.name; }

/// A shader lives on in the pipelines that were made from it.
class SharedShader : public BackendObject {
  public:
    explicit SharedShader(std::shared_ptr<BackendShader> shader) : shader_(std::move(shader)) {}

  private:
    std::shared_ptr<BackendShader> shader_;
};

template <typename HandleType>
void destroy_object(DeviceState& device, HandleType handle, const char* attempted, const char* kind, bool is_resource) {
    if (!handle) return;
    const std::lock_guard lock(device.mutex);
    auto& table = device.tables().table(handle);
    auto* found = table.find(handle);
    if (!found) {
        Problem problem = handle_problem(table, handle, attempted, kind);
        if (problem.rule == Rule::stale_handle) {
            problem.rule = Rule::destroyed_twice;
            problem.remedy = "Destroy each object once.";
        }
        (void)device.reject(std::move(problem));
        return;
    }
    auto object = [&] {
        const std::unique_lock tables_lock(device.shared->tables_mutex);
        return table.remove(handle, name_of_object(*found));
    }();
    if (is_resource) ++device.destructions;
    if constexpr (requires { object.is_mapped; })
        if (object.is_mapped) --device.mapped_buffers;
    if constexpr (std::is_same_v<HandleType, Shader>)
        device.retire(std::make_unique<SharedShader>(std::move(object.backend)));
    else
        device.retire(std::move(object.backend));
    if constexpr (requires { object.common; })
        for (std::shared_ptr<BackendShader>& shader : object.common.shaders)
            device.retire(std::make_unique<SharedShader>(std::move(shader)));
}

template <typename HandleType>
auto described(const DeviceState& device, HandleType handle, const char* attempted, const char* kind)
    -> Expected<decltype(device.shared->tables.table(handle).find(handle))> {
    auto& table = device.shared->tables.table(handle);
    auto* object = table.find(handle);
    if (!object) return device.shared->messages.reject(handle_problem(table, handle, attempted, kind));
    return object;
}

std::string content_key(const BindGroupLayoutDesc& desc) {
    std::string key;
    for (const BindingLayout& binding : desc.bindings)
        key += fmt::format("{},{},{},{};", binding.binding, static_cast<int>(binding.type), binding.count,
                           static_cast<std::uint32_t>(binding.stages));
    return key;
}

}  // namespace

Expected<Buffer> Device::create_buffer(const BufferDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create buffer", "'" + desc.name + "'");
    if (Check failed = check_buffer(desc, device.capabilities())) return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    device.collect();
    BufferDesc wanted = desc;
    wanted.usage |= BufferUsage::copy_source | BufferUsage::copy_destination;
    auto made = device.backend->create_buffer(wanted);
    if (!made) return backend_failure(device, made);
    BufferObject object;
    object.backend = std::move(*made);
    object.backend->desc = std::move(wanted);
    object.desc = desc;
    NACRE_TRY(const Buffer handle, insert(device, Buffer{}, std::move(object), "create buffer"));
    device.tables().buffers.find(handle)->handle = handle;
    return handle;
}

Expected<Texture> Device::create_texture(const TextureDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create texture", "'" + desc.name + "'");
    if (Check failed = check_texture(desc, device.capabilities())) return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    device.collect();
    auto made = device.backend->create_texture(desc);
    if (!made) return backend_failure(device, made);
    TextureObject object;
    object.backend = std::move(*made);
    object.backend->desc = desc;
    object.desc = desc;
    NACRE_TRY(const Texture handle, insert(device, Texture{}, std::move(object), "create texture"));
    device.tables().textures.find(handle)->handle = handle;
    return handle;
}

Expected<Sampler> Device::create_sampler(const SamplerDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create sampler", "'" + desc.name + "'");
    if (Check failed = check_sampler(desc, device.capabilities())) return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    auto made = device.backend->create_sampler(desc);
    if (!made) return backend_failure(device, made);
    SamplerObject object;
    object.backend = std::move(*made);
    object.backend->desc = desc;
    object.desc = desc;
    return insert(device, Sampler{}, std::move(object), "create sampler");
}

Expected<Shader> Device::create_shader(const ShaderDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create shader", "'" + desc.name + "'");
    if (desc.stage != ShaderStage::vertex && desc.stage != ShaderStage::fragment && desc.stage != ShaderStage::compute)
        return device.reject({Rule::shader_stage, ErrorCode::invalid_argument, "create shader", "'" + desc.name + "'",
                              "expected one stage (vertex, fragment or compute), found " + text_of(desc.stage),
                              "Set ShaderDesc::stage to the stage of the entry point."});
    NACRE_TRY(ShaderReflection reflection, reflect(desc.spirv, desc.stage, desc.entry_point, desc.name));
    if (Check failed = check_shader(reflection, desc.name, device.capabilities()))
        return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    auto made = device.backend->create_shader(desc, reflection);
    if (!made) return backend_failure(device, made);
    ShaderObject object;
    object.backend = std::move(*made);
    object.backend->spirv = desc.spirv;
    object.backend->reflection = std::move(reflection);
    object.backend->entry_point = desc.entry_point;
    object.backend->name = desc.name;
    object.stage = desc.stage;
    return insert(device, Shader{}, std::move(object), "create shader");
}

Expected<BindGroupLayout> Device::create_bind_group_layout(const BindGroupLayoutDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create bind group layout", "'" + desc.name + "'");
    BindGroupLayoutDesc sorted = desc;
    std::stable_sort(sorted.bindings.begin(), sorted.bindings.end(),
                     [](const BindingLayout& a, const BindingLayout& b) { return a.binding < b.binding; });
    if (Check failed = check_layout(sorted, device.capabilities())) return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    return device.layout_of(std::move(sorted));
}

Expected<BindGroupLayout> DeviceState::layout_of(BindGroupLayoutDesc sorted) {
    std::string key = content_key(sorted);
    if (const auto known = layouts_by_content.find(key); known != layouts_by_content.end()) return known->second;
    auto made = backend->create_bind_group_layout(sorted);
    if (!made) return backend_failure(*this, made);
    BindGroupLayoutObject object;
    object.backend = std::move(*made);
    object.backend->desc = sorted;
    object.has_unbounded = std::any_of(sorted.bindings.begin(), sorted.bindings.end(),
                                       [](const BindingLayout& binding) { return binding.count == 0; });
    object.desc = std::move(sorted);
    NACRE_TRY(const BindGroupLayout handle,
              insert(*this, BindGroupLayout{}, std::move(object), "create bind group layout"));
    layouts_by_content.emplace(std::move(key), handle);
    return handle;
}

Expected<QueryPool> Device::create_query_pool(const QueryPoolDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create query pool", "'" + desc.name + "'");
    if (Check failed = check_query_pool(desc, device.capabilities())) return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    auto made = device.backend->create_query_pool(desc);
    if (!made) return backend_failure(device, made);
    QueryPoolObject object;
    object.backend = std::move(*made);
    object.backend->desc = desc;
    object.desc = desc;
    object.written.assign(desc.count, false);
    return insert(device, QueryPool{}, std::move(object), "create query pool");
}

Expected<void> BackendDevice::start_trace(const TraceRequest& request) {
    return fail(ErrorCode::unsupported, "trace shaders", fmt::format("'{}'", request.shader),
                "this backend cannot look into its shaders", "Use backend cpu.");
}

Expected<Trace> BackendDevice::finish_trace() { return Trace{}; }

Expected<std::unique_ptr<BackendAccelerationStructure>> BackendDevice::create_acceleration_structure(
    const AccelerationStructureDesc& desc) {
    return fail(ErrorCode::unsupported, "create acceleration structure", "'" + desc.name + "'",
                "this backend has no acceleration structures", "Ask Capabilities::ray_query first.");
}

Expected<AccelerationStructure> Device::create_acceleration_structure(const AccelerationStructureDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create acceleration structure", "'" + desc.name + "'");
    if (Check failed = check_acceleration_structure(desc, device.capabilities()))
        return device.reject(std::move(*failed));
    const std::lock_guard lock(device.mutex);
    device.collect();
    auto made = device.backend->create_acceleration_structure(desc);
    if (!made) return backend_failure(device, made);
    AccelerationStructureObject object;
    object.backend = std::move(*made);
    object.backend->desc = desc;
    object.desc = desc;
    NACRE_TRY(const AccelerationStructure handle,
              insert(device, AccelerationStructure{}, std::move(object), "create acceleration structure"));
    device.tables().acceleration_structures.find(handle)->handle = handle;
    return handle;
}

void Device::destroy(Buffer object) { destroy_object(*state_, object, "destroy", "buffer", true); }
void Device::destroy(Texture object) { destroy_object(*state_, object, "destroy", "texture", true); }
void Device::destroy(Sampler object) { destroy_object(*state_, object, "destroy", "sampler", true); }
void Device::destroy(Shader object) { destroy_object(*state_, object, "destroy", "shader", false); }
void Device::destroy(BindGroup object) { destroy_object(*state_, object, "destroy", "bind group", false); }
void Device::destroy(GraphicsPipeline object) {
    destroy_object(*state_, object, "destroy", "graphics pipeline", false);
}
void Device::destroy(ComputePipeline object) { destroy_object(*state_, object, "destroy", "compute pipeline", false); }
void Device::destroy(QueryPool object) { destroy_object(*state_, object, "destroy", "query pool", false); }
void Device::destroy(AccelerationStructure object) {
    destroy_object(*state_, object, "destroy", "acceleration structure", true);
}

Expected<BufferDesc> Device::describe(Buffer object) const {
    const std::shared_lock lock(state_->shared->tables_mutex);
    NACRE_TRY(const BufferObject* found, described(*state_, object, "describe", "buffer"));
    return found->desc;
}

Expected<TextureDesc> Device::describe(Texture object) const {
    const std::shared_lock lock(state_->shared->tables_mutex);
    NACRE_TRY(const TextureObject* found, described(*state_, object, "describe", "texture"));
    return found->desc;
}

Expected<AccelerationStructureDesc> Device::describe(AccelerationStructure object) const {
    const std::shared_lock lock(state_->shared->tables_mutex);
    NACRE_TRY(const AccelerationStructureObject* found,
              described(*state_, object, "describe", "acceleration structure"));
    return found->desc;
}

Expected<ShaderReflection> Device::reflection(Shader object) const {
    const std::shared_lock lock(state_->shared->tables_mutex);
    NACRE_TRY(const ShaderObject* found, described(*state_, object, "reflect", "shader"));
    return found->backend->reflection;
}

Expected<BindGroupLayoutDesc> Device::describe(BindGroupLayout layout) const {
    const std::shared_lock lock(state_->shared->tables_mutex);
    NACRE_TRY(const BindGroupLayoutObject* found, described(*state_, layout, "describe", "bind group layout"));
    return found->desc;
}

}  // namespace nacre::rhi
