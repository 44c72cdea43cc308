// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/pipeline.h"

#include <bit>
#include <vector>

#include "backends/vulkan/bind_group.h"
#include "backends/vulkan/formats.h"
#include "backends/vulkan/pipeline_cache.h"
#include "backends/vulkan/render_pass.h"
#include "backends/vulkan/result.h"
#include "backends/vulkan/shader.h"

namespace nacre::vulkan {
namespace {

/// VkSpecializationInfo and what it points to.
class Specialization {
  public:
    explicit Specialization(std::span<const rhi::SpecializationConstant> constants) {
        for (const rhi::SpecializationConstant& constant : constants) {
            entries_.push_back({constant.id, static_cast<std::uint32_t>(words_.size() * 4), 4});
            words_.push_back(std::visit(
                [](auto value) -> std::uint32_t {
                    if constexpr (std::is_same_v<decltype(value), bool>)
                        return value ? VK_TRUE : VK_FALSE;
                    else
                        return std::bit_cast<std::uint32_t>(value);
                },
                constant.value));
        }
        info_.mapEntryCount = static_cast<std::uint32_t>(entries_.size());
        info_.pMapEntries = entries_.data();
        info_.dataSize = words_.size() * 4;
        info_.pData = words_.data();
    }
    Specialization(const Specialization&) = delete;
    Specialization& operator=(const Specialization&) = delete;
    [[nodiscard]] const VkSpecializationInfo* info() const { return entries_.empty() ? nullptr : &info_; }

  private:
    std::vector<VkSpecializationMapEntry> entries_;
    std::vector<std::uint32_t> words_;
    VkSpecializationInfo info_{};
};

VkPipelineShaderStageCreateInfo stage_of(const rhi::BackendShader& shader, VkShaderStageFlagBits stage,
                                         const Specialization& specialization) {
    VkPipelineShaderStageCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
    info.stage = stage;
    info.module = static_cast<const Shader&>(shader).handle;
    info.pName = shader.entry_point.c_str();
    info.pSpecializationInfo = specialization.info();
    return info;
}

Expected<void> make_layout(Context& context, std::span<rhi::BackendBindGroupLayout* const> layouts,
                           const std::string& subject, PipelineCore& core) {
    if (layouts.size() > max_bind_groups)
        return nacre::fail(ErrorCode::unsupported, "create", subject, "it uses more than 8 bind groups",
                           "Use fewer bind groups.");
    std::array<VkDescriptorSetLayout, max_bind_groups> handles{};
    core.group_count = static_cast<std::uint32_t>(layouts.size());
    for (std::size_t i = 0; i < layouts.size(); ++i) {
        core.group_layouts[i] = layouts[i];
        handles[i] = static_cast<const BindGroupLayout&>(*layouts[i]).sets->layout();
    }
    VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    info.setLayoutCount = core.group_count;
    info.pSetLayouts = handles.data();
    info.pushConstantRangeCount = 1;
    info.pPushConstantRanges = &context.push_constants;
    if (VkResult result = context.vk.CreatePipelineLayout(context.device, &info, nullptr, &core.layout);
        result != VK_SUCCESS)
        return fail(context.check(result), "create layout of", subject);
    return {};
}

VkStencilOpState to_vulkan(const rhi::StencilFace& face) {
    return {vulkan::to_vulkan(face.fail),
            vulkan::to_vulkan(face.pass),
            vulkan::to_vulkan(face.depth_fail),
            vulkan::to_vulkan(face.compare),
            face.read_mask,
            face.write_mask,
            0};
}

void destroy(Context& context, PipelineCore& core) {
    if (core.handle) context.vk.DestroyPipeline(context.device, core.handle, nullptr);
    if (core.layout) context.vk.DestroyPipelineLayout(context.device, core.layout, nullptr);
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> GraphicsPipeline::create(
    Context& context, const rhi::BackendGraphicsPipelineDesc& from) {
    std::unique_ptr<GraphicsPipeline> pipeline(new GraphicsPipeline(context));
    const rhi::GraphicsPipelineDesc& desc = *from.desc;
    const std::string subject = "graphics pipeline " + in_quotes(desc.name);
    NACRE_CHECK(make_layout(context, from.layouts, subject, pipeline->core));

    const Specialization specialization(desc.specialization);
    std::vector<VkPipelineShaderStageCreateInfo> stages{
        stage_of(*from.vertex, VK_SHADER_STAGE_VERTEX_BIT, specialization)};
    if (from.fragment) stages.push_back(stage_of(*from.fragment, VK_SHADER_STAGE_FRAGMENT_BIT, specialization));

    std::vector<VkVertexInputBindingDescription> bindings;
    for (std::uint32_t i = 0; i < desc.vertex_buffers.size(); ++i)
        bindings.push_back(
            {i, desc.vertex_buffers[i].stride,
             desc.vertex_buffers[i].per_instance ? VK_VERTEX_INPUT_RATE_INSTANCE : VK_VERTEX_INPUT_RATE_VERTEX});
    std::vector<VkVertexInputAttributeDescription> attributes;
    for (const rhi::VertexAttribute& each : desc.vertex_attributes)
        attributes.push_back({each.location, each.buffer, vulkan::to_vulkan(each.format), each.offset});
    VkPipelineVertexInputStateCreateInfo vertex_input{VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO};
    vertex_input.vertexBindingDescriptionCount = static_cast<std::uint32_t>(bindings.size());
    vertex_input.pVertexBindingDescriptions = bindings.data();
    vertex_input.vertexAttributeDescriptionCount = static_cast<std::uint32_t>(attributes.size());
    vertex_input.pVertexAttributeDescriptions = attributes.data();

    VkPipelineInputAssemblyStateCreateInfo assembly{VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO};
    assembly.topology = vulkan::to_vulkan(desc.topology);
    VkPipelineViewportStateCreateInfo viewport{VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO};
    viewport.viewportCount = viewport.scissorCount = 1;

    const rhi::DepthStencilState& depth = desc.depth_stencil;
    VkPipelineRasterizationStateCreateInfo raster{VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO};
    raster.depthClampEnable = depth.depth_clamp;
    raster.polygonMode = desc.fill == rhi::FillMode::line ? VK_POLYGON_MODE_LINE : VK_POLYGON_MODE_FILL;
    raster.cullMode = desc.cull == rhi::CullMode::back    ? VK_CULL_MODE_BACK_BIT
                      : desc.cull == rhi::CullMode::front ? VK_CULL_MODE_FRONT_BIT
                                                          : VK_CULL_MODE_NONE;
    raster.frontFace =
        desc.front_face == rhi::FrontFace::clockwise ? VK_FRONT_FACE_CLOCKWISE : VK_FRONT_FACE_COUNTER_CLOCKWISE;
    raster.depthBiasEnable = depth.depth_bias != 0.0f || depth.depth_bias_slope != 0.0f;
    raster.depthBiasConstantFactor = depth.depth_bias;
    raster.depthBiasSlopeFactor = depth.depth_bias_slope;
    raster.depthBiasClamp = depth.depth_bias_clamp;
    raster.lineWidth = 1.0f;
    // Lines of one sample cover what OpenGL's lines cover; by default Vulkan draws thin rectangles. The rule cannot be
    // chosen together with alpha to coverage, and samples ask for rectangles in OpenGL too.
    VkPipelineRasterizationLineStateCreateInfoEXT lines{
        VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_LINE_STATE_CREATE_INFO_EXT};
    lines.lineRasterizationMode = VK_LINE_RASTERIZATION_MODE_BRESENHAM_EXT;
    if (context.bresenham_lines && desc.samples == 1 && !desc.alpha_to_coverage) raster.pNext = &lines;

    VkPipelineMultisampleStateCreateInfo multisample{VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO};
    multisample.rasterizationSamples = static_cast<VkSampleCountFlagBits>(desc.samples);
    multisample.alphaToCoverageEnable = desc.alpha_to_coverage;

    VkPipelineDepthStencilStateCreateInfo depth_stencil{VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO};
    // Depth is written only by fragments that were tested: a pipeline that writes without a test passes them all.
    depth_stencil.depthTestEnable = depth.depth_test || depth.depth_write;
    depth_stencil.depthWriteEnable = depth.depth_write;
    depth_stencil.depthCompareOp = depth.depth_test ? vulkan::to_vulkan(depth.depth_compare) : VK_COMPARE_OP_ALWAYS;
    depth_stencil.stencilTestEnable = depth.stencil_test;
    depth_stencil.front = to_vulkan(depth.front);
    depth_stencil.back = to_vulkan(depth.back);

    std::vector<VkPipelineColorBlendAttachmentState> blends;
    for (const rhi::ColorTargetState& target : desc.color_targets)
        blends.push_back({target.blend.enabled, vulkan::to_vulkan(target.blend.source_color),
                          vulkan::to_vulkan(target.blend.destination_color),
                          vulkan::to_vulkan(target.blend.color_operation), vulkan::to_vulkan(target.blend.source_alpha),
                          vulkan::to_vulkan(target.blend.destination_alpha),
                          vulkan::to_vulkan(target.blend.alpha_operation), target.write_mask});
    VkPipelineColorBlendStateCreateInfo blend{VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO};
    blend.attachmentCount = static_cast<std::uint32_t>(blends.size());
    blend.pAttachments = blends.data();

    constexpr VkDynamicState dynamic_states[] = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR,
                                                 VK_DYNAMIC_STATE_STENCIL_REFERENCE, VK_DYNAMIC_STATE_BLEND_CONSTANTS};
    VkPipelineDynamicStateCreateInfo dynamic{VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO};
    dynamic.dynamicStateCount = static_cast<std::uint32_t>(std::size(dynamic_states));
    dynamic.pDynamicStates = dynamic_states;

    VkGraphicsPipelineCreateInfo info{VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO};
    std::vector<VkFormat> color_formats;
    VkPipelineRenderingCreateInfo rendering{VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO};
    if (context.dynamic_rendering) {
        for (const rhi::ColorTargetState& target : desc.color_targets)
            color_formats.push_back(vulkan::to_vulkan(target.format));
        rendering.colorAttachmentCount = static_cast<std::uint32_t>(color_formats.size());
        rendering.pColorAttachmentFormats = color_formats.data();
        if (rhi::info(depth.format).has_depth) rendering.depthAttachmentFormat = vulkan::to_vulkan(depth.format);
        if (rhi::info(depth.format).has_stencil) rendering.stencilAttachmentFormat = vulkan::to_vulkan(depth.format);
        info.pNext = &rendering;
    } else {
        RenderPassKey key;
        key.color_count = static_cast<std::uint32_t>(desc.color_targets.size());
        for (std::uint32_t i = 0; i < key.color_count && i < max_color_targets; ++i)
            key.colors[i].format = vulkan::to_vulkan(desc.color_targets[i].format);
        key.depth_format = vulkan::to_vulkan(depth.format);
        key.samples = static_cast<VkSampleCountFlagBits>(desc.samples);
        NACRE_TRY(info.renderPass, context.render_passes->render_pass(key));
    }
    info.stageCount = static_cast<std::uint32_t>(stages.size());
    info.pStages = stages.data();
    info.pVertexInputState = &vertex_input;
    info.pInputAssemblyState = &assembly;
    info.pViewportState = &viewport;
    info.pRasterizationState = &raster;
    info.pMultisampleState = &multisample;
    info.pDepthStencilState = &depth_stencil;
    info.pColorBlendState = &blend;
    info.pDynamicState = &dynamic;
    info.layout = pipeline->core.layout;
    if (VkResult result = context.vk.CreateGraphicsPipelines(context.device, context.pipelines->handle(), 1, &info,
                                                             nullptr, &pipeline->core.handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", subject);
    context.set_name(pipeline->core.handle, VK_OBJECT_TYPE_PIPELINE, desc.name);
    return pipeline;
}

GraphicsPipeline::~GraphicsPipeline() { destroy(context_, core); }

Expected<std::unique_ptr<rhi::BackendComputePipeline>> ComputePipeline::create(
    Context& context, const rhi::BackendComputePipelineDesc& from) {
    std::unique_ptr<ComputePipeline> pipeline(new ComputePipeline(context));
    const rhi::ComputePipelineDesc& desc = *from.desc;
    const std::string subject = "compute pipeline " + in_quotes(desc.name);
    NACRE_CHECK(make_layout(context, from.layouts, subject, pipeline->core));
    const Specialization specialization(desc.specialization);
    VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    info.stage = stage_of(*from.shader, VK_SHADER_STAGE_COMPUTE_BIT, specialization);
    info.layout = pipeline->core.layout;
    if (VkResult result = context.vk.CreateComputePipelines(context.device, context.pipelines->handle(), 1, &info,
                                                            nullptr, &pipeline->core.handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", subject);
    context.set_name(pipeline->core.handle, VK_OBJECT_TYPE_PIPELINE, desc.name);
    return pipeline;
}

ComputePipeline::~ComputePipeline() { destroy(context_, core); }

}  // namespace nacre::vulkan
