// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/shader.h"

#include <fmt/format.h>
#include <spirv_cross/spirv_cross_c.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <memory>
#include <utility>

#include "backends/gl/formats.h"

namespace nacre::gl {
namespace {

using rhi::ReflectedBinding;
using rhi::ShaderStage;

struct ContextDeleter {
    void operator()(spvc_context context) const { spvc_context_destroy(context); }
};
using CrossContext = std::unique_ptr<spvc_context_s, ContextDeleter>;

char stage_letter(ShaderStage stage) {
    return stage == ShaderStage::vertex ? 'v' : stage == ShaderStage::fragment ? 'f' : 'c';
}

SpvExecutionModel execution_model(ShaderStage stage) {
    return stage == ShaderStage::vertex     ? SpvExecutionModelVertex
           : stage == ShaderStage::fragment ? SpvExecutionModelFragment
                                            : SpvExecutionModelGLCompute;
}

/// One translation in progress. SPIRV-Cross trusts its input (Debian builds it with asserts): only modules that the
/// front end validated come here, and only queries that fit the kind of the object are made.
class Translator {
  public:
    Translator(const rhi::BackendShader& shader, const Traits& traits, SlotAllocator& slots)
        : shader_(shader), spirv_(shader.spirv), traits_(traits), slots_(slots),
          letter_(stage_letter(shader.reflection.stage)) {}

    Expected<Translation> run(std::span<const rhi::SpecializationConstant> specialization) {
        NACRE_CHECK(check());
        specialize(specialization);
        NACRE_CHECK(open());
        NACRE_CHECK(set_options());
        NACRE_CHECK(combine_samplers());
        NACRE_CHECK(place_resources());
        const char* source = nullptr;
        if (spvc_compiler_compile(compiler_, &source) != SPVC_SUCCESS) return refuse("translate");
        result_.source = source;
        if (traits_.es) mirror_point_coordinate();
        return std::move(result_);
    }

  private:
    std::unexpected<Error> refuse(const char* step) const {
        return fail(ErrorCode::unsupported, fmt::format("{} shader", step), fmt::format("'{}'", shader_.name),
                    fmt::format("SPIRV-Cross: {}", spvc_context_get_last_error_string(context_.get())),
                    "Write this part of the shader without what is named here, or use another backend.");
    }

    Expected<void> check() const {
        const rhi::ShaderReflection& reflection = shader_.reflection;
        const auto lacking = [&](std::string_view what) {
            return fail(ErrorCode::unsupported, "create pipeline", fmt::format("shader '{}'", shader_.name),
                        fmt::format("it uses {}, which {} does not have", what, traits_.es ? "OpenGL ES" : "OpenGL"),
                        "Ask the device's capabilities and offer a variant of the shader without them.");
        };
        if (reflection.uses_subgroups) return lacking("subgroup operations (GL_KHR_shader_subgroup)");
        if (reflection.uses_ray_query) return lacking("ray queries (GL_EXT_ray_query)");
        for (const ReflectedBinding& binding : reflection.bindings)
            if (binding.count == 0) return lacking("an unbounded array of textures (descriptor indexing)");
        for (const ReflectedBinding& binding : reflection.bindings)
            if (!traits_.image_formats && binding.image_format != rhi::Format::undefined &&
                !is_es_image_format(binding.image_format))
                return lacking(fmt::format("a storage image of format {} (set {}, binding {})",
                                           rhi::info(binding.image_format).name, binding.set, binding.binding));
        return {};
    }

    Expected<void> open() {
        spvc_context context = nullptr;
        if (spvc_context_create(&context) != SPVC_SUCCESS)
            return fail(ErrorCode::out_of_memory, "translate shader", fmt::format("'{}'", shader_.name),
                        "SPIRV-Cross could not be started");
        context_.reset(context);
        spvc_parsed_ir ir = nullptr;
        if (spvc_context_parse_spirv(context, spirv_.data(), spirv_.size(), &ir) != SPVC_SUCCESS ||
            spvc_context_create_compiler(context, SPVC_BACKEND_GLSL, ir, SPVC_CAPTURE_MODE_TAKE_OWNERSHIP,
                                         &compiler_) != SPVC_SUCCESS ||
            spvc_compiler_set_entry_point(compiler_, shader_.entry_point.c_str(),
                                          execution_model(shader_.reflection.stage)) != SPVC_SUCCESS)
            return refuse("read");
        return {};
    }

    Expected<void> set_options() {
        spvc_compiler_options options = nullptr;
        if (spvc_compiler_create_compiler_options(compiler_, &options) != SPVC_SUCCESS) return refuse("translate");
        const unsigned version = !traits_.es ? 450 : traits_.version >= 32 ? 320 : 310;
        spvc_compiler_options_set_uint(options, SPVC_COMPILER_OPTION_GLSL_VERSION, version);
        spvc_compiler_options_set_bool(options, SPVC_COMPILER_OPTION_GLSL_ES, traits_.es);
        spvc_compiler_options_set_bool(options, SPVC_COMPILER_OPTION_GLSL_ES_DEFAULT_FLOAT_PRECISION_HIGHP, SPVC_TRUE);
        spvc_compiler_options_set_bool(options, SPVC_COMPILER_OPTION_GLSL_ES_DEFAULT_INT_PRECISION_HIGHP, SPVC_TRUE);
        spvc_compiler_options_set_bool(options, SPVC_COMPILER_OPTION_FIXUP_DEPTH_CONVENTION, !traits_.clip_control);
        spvc_compiler_options_set_bool(options, SPVC_COMPILER_OPTION_GLSL_SUPPORT_NONZERO_BASE_INSTANCE, SPVC_TRUE);
        if (spvc_compiler_install_compiler_options(compiler_, options) != SPVC_SUCCESS) return refuse("translate");
        if (traits_.es)
            for (const rhi::ReflectedVariable& output : shader_.reflection.outputs)
                if (output.index == 1) {
                    // SPIRV-Cross writes `index = 1` without asking for what makes it legal in ESSL.
                    spvc_compiler_require_extension(compiler_, "GL_EXT_blend_func_extended");
                    break;
                }
        return {};
    }

    // New defaults in the module itself: what SPIRV-Cross prints then holds the values wherever they are used.
    void specialize(std::span<const rhi::SpecializationConstant> values) {
        constexpr std::size_t header_words = 5;
        std::vector<std::uint32_t>& words = spirv_;
        std::map<std::uint32_t, std::uint32_t> value_of;  // By the id of the constant.
        for (std::size_t at = header_words; at < words.size() && !values.empty(); at += words[at] >> 16) {
            const std::uint32_t length = words[at] >> 16, operation = words[at] & 0xffff;
            if (length == 0 || at + length > words.size()) return;
            if (operation == SpvOpDecorate && length == 4 && words[at + 2] == SpvDecorationSpecId)
                for (const rhi::SpecializationConstant& value : values)
                    if (value.id == words[at + 3]) value_of[words[at + 1]] = bits_of(value);
            const bool is_boolean = operation == SpvOpSpecConstantTrue || operation == SpvOpSpecConstantFalse;
            if (!is_boolean && !(operation == SpvOpSpecConstant && length == 4)) continue;
            const auto found = value_of.find(words[at + 2]);
            if (found == value_of.end()) continue;
            if (is_boolean)
                words[at] = length << 16 | (found->second ? SpvOpSpecConstantTrue : SpvOpSpecConstantFalse);
            else
                words[at + 3] = found->second;
        }
    }

    static std::uint32_t bits_of(const rhi::SpecializationConstant& constant) {
        return std::visit(
            [](auto value) -> std::uint32_t {
                if constexpr (std::is_same_v<decltype(value), bool>)
                    return value ? 1u : 0u;
                else
                    return std::bit_cast<std::uint32_t>(value);
            },
            constant.value);
    }

    const ReflectedBinding* find(std::uint32_t set, std::uint32_t binding) const {
        for (const ReflectedBinding& reflected : shader_.reflection.bindings)
            if (reflected.set == set && reflected.binding == binding) return &reflected;
        return nullptr;
    }

    std::pair<std::uint32_t, std::uint32_t> place_of(SpvId id) const {
        return {spvc_compiler_get_decoration(compiler_, id, SpvDecorationDescriptorSet),
                spvc_compiler_get_decoration(compiler_, id, SpvDecorationBinding)};
    }

    Expected<void> combine_samplers() {
        spvc_variable_id dummy = 0;
        if (spvc_compiler_build_dummy_sampler_for_combined_images(compiler_, &dummy) != SPVC_SUCCESS ||
            spvc_compiler_build_combined_image_samplers(compiler_) != SPVC_SUCCESS)
            return refuse("combine textures and samplers of");
        const spvc_combined_image_sampler* pairs = nullptr;
        std::size_t count = 0;
        if (spvc_compiler_get_combined_image_samplers(compiler_, &pairs, &count) != SPVC_SUCCESS)
            return refuse("combine textures and samplers of");
        for (std::size_t i = 0; i < count; ++i) {
            TextureRange range;
            std::tie(range.set, range.binding) = place_of(pairs[i].image_id);
            if (const ReflectedBinding* image = find(range.set, range.binding)) range.count = image->count;
            if (pairs[i].sampler_id != dummy) {
                std::tie(range.sampler_set, range.sampler_binding) = place_of(pairs[i].sampler_id);
                const ReflectedBinding* sampler = find(range.sampler_set, range.sampler_binding);
                if (sampler && sampler->count != 1)
                    return fail(ErrorCode::unsupported, "create pipeline", fmt::format("shader '{}'", shader_.name),
                                fmt::format("set {} binding {} is an array of samplers, which OpenGL does not have",
                                            range.sampler_set, range.sampler_binding),
                                "Use one binding for each sampler.");
            }
            range.first =
                slots_.texture(range.set, range.binding, range.sampler_set, range.sampler_binding, range.count);
            const bool sampled = range.sampler_binding != TextureRange::no_sampler;
            spvc_compiler_set_name(
                compiler_, pairs[i].combined_id,
                sampled ? fmt::format("texture_{}_{}_{}_{}_{}", letter_, range.set, range.binding, range.sampler_set,
                                      range.sampler_binding).c_str()
                        : fmt::format("texture_{}_{}_{}", letter_, range.set, range.binding).c_str());
            spvc_compiler_set_decoration(compiler_, pairs[i].combined_id, SpvDecorationBinding, range.first);
            result_.textures.push_back(range);
            combined_.push_back(pairs[i].combined_id);
        }
        return {};
    }

    template <typename Place>
    Expected<void> for_each_resource(spvc_resources resources, spvc_resource_type type, Place&& place) {
        const spvc_reflected_resource* list = nullptr;
        std::size_t count = 0;
        if (spvc_resources_get_resource_list_for_type(resources, type, &list, &count) != SPVC_SUCCESS)
            return refuse("list resources of");
        for (std::size_t i = 0; i < count; ++i)
            if (auto placed = place(list[i]); !placed) return placed;
        return {};
    }

    Expected<void> place_buffer(const spvc_reflected_resource& resource, SlotRange::Kind kind) {
        SlotRange range;
        range.kind = kind;
        std::tie(range.set, range.binding) = place_of(resource.id);
        if (const ReflectedBinding* reflected = find(range.set, range.binding)) range.count = reflected->count;
        const bool uniform = kind == SlotRange::Kind::uniform_buffer;
        range.first = uniform ? slots_.uniform_buffer(range.set, range.binding, range.count)
                              : slots_.storage_buffer(range.set, range.binding, range.count);
        // Blocks and variables are matched by name between stages; names of our own keep two stages' different blocks
        // of one name apart.
        const std::string suffix = fmt::format("{}_{}_{}", letter_, range.set, range.binding);
        spvc_compiler_set_name(compiler_, resource.base_type_id, ("Block_" + suffix).c_str());
        spvc_compiler_set_name(compiler_, resource.id, ("buffer_" + suffix).c_str());
        spvc_compiler_set_decoration(compiler_, resource.id, SpvDecorationBinding, range.first);
        result_.slots.push_back(range);
        return {};
    }

    Expected<void> place_image(const spvc_reflected_resource& resource) {
        SlotRange range;
        range.kind = SlotRange::Kind::image;
        std::tie(range.set, range.binding) = place_of(resource.id);
        if (const ReflectedBinding* reflected = find(range.set, range.binding)) {
            range.count = reflected->count;
            using enum rhi::BindingType;
            range.readable =
                reflected->type != writeonly_storage_image && reflected->type != writeonly_storage_texel_buffer;
            range.writable =
                reflected->type != readonly_storage_image && reflected->type != readonly_storage_texel_buffer;
        }
        range.first = slots_.image(range.set, range.binding, range.count);
        spvc_compiler_set_name(compiler_, resource.id,
                               fmt::format("image_{}_{}_{}", letter_, range.set, range.binding).c_str());
        spvc_compiler_set_decoration(compiler_, resource.id, SpvDecorationBinding, range.first);
        result_.slots.push_back(range);
        return {};
    }

    Expected<void> place_combined(const spvc_reflected_resource& resource) {
        // The list of what the module declares holds the pairs made above as well.
        if (std::ranges::find(combined_, resource.id) != combined_.end()) return {};
        return place_texture(resource, true);
    }

    // Of textures without a sampler only texel buffers are left: the others were combined above.
    Expected<void> place_texel_buffer(const spvc_reflected_resource& resource) {
        const auto [set, binding] = place_of(resource.id);
        const ReflectedBinding* reflected = find(set, binding);
        if (!reflected || reflected->type != rhi::BindingType::uniform_texel_buffer) return {};
        return place_texture(resource, false);
    }

    Expected<void> place_texture(const spvc_reflected_resource& resource, bool has_sampler) {
        TextureRange range;
        range.combined = has_sampler;
        std::tie(range.set, range.binding) = place_of(resource.id);
        if (const ReflectedBinding* reflected = find(range.set, range.binding)) range.count = reflected->count;
        if (has_sampler) {
            range.sampler_set = range.set;
            range.sampler_binding = range.binding;
        }
        range.first = slots_.texture(range.set, range.binding, range.sampler_set, range.sampler_binding, range.count);
        spvc_compiler_set_name(compiler_, resource.id,
                               fmt::format("texture_{}_{}_{}", letter_, range.set, range.binding).c_str());
        spvc_compiler_set_decoration(compiler_, resource.id, SpvDecorationBinding, range.first);
        result_.textures.push_back(range);
        return {};
    }

    Expected<void> place_resources() {
        spvc_resources resources = nullptr;
        if (spvc_compiler_create_shader_resources(compiler_, &resources) != SPVC_SUCCESS)
            return refuse("list resources of");
        using Resource = spvc_reflected_resource;
        NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_UNIFORM_BUFFER, [&](const Resource& resource) {
            return place_buffer(resource, SlotRange::Kind::uniform_buffer);
        }));
        NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_STORAGE_BUFFER, [&](const Resource& resource) {
            return place_buffer(resource, SlotRange::Kind::storage_buffer);
        }));
        NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_STORAGE_IMAGE,
                                      [&](const Resource& resource) { return place_image(resource); }));
        NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_SAMPLED_IMAGE,
                                      [&](const Resource& resource) { return place_combined(resource); }));
        NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_SEPARATE_IMAGE,
                                      [&](const Resource& resource) { return place_texel_buffer(resource); }));
        NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_PUSH_CONSTANT, [&](const Resource& resource) {
            const std::string name = fmt::format("push_{}", letter_);
            spvc_compiler_set_name(compiler_, resource.id, name.c_str());
            spvc_compiler_set_name(compiler_, resource.base_type_id, fmt::format("Push_{}", letter_).c_str());
            return collect_members(resource.base_type_id, name, 0);
        }));
        if (shader_.reflection.stage == ShaderStage::fragment)
            NACRE_CHECK(for_each_resource(resources, SPVC_RESOURCE_TYPE_STAGE_INPUT,
                                          [&](const Resource& resource) -> Expected<void> {
                result_.flat_inputs |= spvc_compiler_has_decoration(compiler_, resource.id, SpvDecorationFlat) != 0;
                return {};
            }));
        return {};
    }

    // Lists the leaves of a structure in the push constants.
    Expected<void> collect_members(spvc_type_id structure_id, const std::string& prefix, std::uint32_t base) {
        spvc_type structure = spvc_compiler_get_type_handle(compiler_, structure_id);
        const unsigned member_count = spvc_type_get_num_member_types(structure);
        for (unsigned i = 0; i < member_count; ++i) {
            // The names that the source will have: given here, so that none is mangled for being reserved.
            const std::string member = fmt::format("m{}", i);
            spvc_compiler_set_member_name(compiler_, structure_id, i, member.c_str());
            unsigned offset = 0;
            if (spvc_compiler_type_struct_member_offset(compiler_, structure, i, &offset) != SPVC_SUCCESS)
                return refuse("read push constants of");
            const spvc_type_id type_id = spvc_type_get_member_type(structure, i);
            spvc_type type = spvc_compiler_get_type_handle(compiler_, type_id);
            const unsigned dimensions = spvc_type_get_num_array_dimensions(type);
            if (dimensions > 1) return unsupported_member(prefix, "an array of arrays");
            std::uint32_t count = 1;
            unsigned stride = 0;
            if (dimensions == 1) {
                if (!spvc_type_array_dimension_is_literal(type, 0))
                    return unsupported_member(prefix, "an array sized by a specialization constant");
                count = spvc_type_get_array_dimension(type, 0);
                if (spvc_compiler_type_struct_member_array_stride(compiler_, structure, i, &stride) != SPVC_SUCCESS)
                    return refuse("read push constants of");
            }
            const std::string name = prefix + "." + member;
            const spvc_basetype base_type = spvc_type_get_basetype(type);
            if (base_type == SPVC_BASETYPE_STRUCT) {
                const spvc_type_id inner = spvc_type_get_base_type_id(type);
                for (std::uint32_t element = 0; element < count; ++element)
                    NACRE_CHECK(collect_members(inner, dimensions ? fmt::format("{}[{}]", name, element) : name,
                                                base + offset + element * stride));
                continue;
            }
            PushConstantLeaf leaf;
            leaf.name = dimensions ? name + "[0]" : name;
            leaf.offset = base + offset;
            leaf.count = count;
            leaf.array_stride = stride;
            leaf.components = spvc_type_get_vector_size(type);
            leaf.columns = spvc_type_get_columns(type);
            switch (base_type) {
                case SPVC_BASETYPE_FP32: leaf.scalar = PushConstantLeaf::Scalar::floating; break;
                case SPVC_BASETYPE_INT32: leaf.scalar = PushConstantLeaf::Scalar::sint; break;
                case SPVC_BASETYPE_UINT32: leaf.scalar = PushConstantLeaf::Scalar::uint; break;
                default: return unsupported_member(prefix, "a type other than 32-bit numbers");
            }
            if (leaf.columns > 1) {
                unsigned matrix_stride = 0;
                if (spvc_compiler_type_struct_member_matrix_stride(compiler_, structure, i, &matrix_stride) !=
                    SPVC_SUCCESS)
                    return refuse("read push constants of");
                leaf.matrix_stride = matrix_stride;
                leaf.row_major = spvc_compiler_has_member_decoration(compiler_, structure_id, i, SpvDecorationRowMajor);
            }
            result_.push_constants.push_back(std::move(leaf));
        }
        return {};
    }

    std::unexpected<Error> unsupported_member(const std::string& where, const char* what) const {
        return fail(ErrorCode::unsupported, "create pipeline", fmt::format("shader '{}'", shader_.name),
                    fmt::format("its push constants ({}) hold {}, which this backend does not translate", where, what),
                    "Use a uniform buffer for it.");
    }

    // OpenGL ES always counts gl_PointCoord.y from the side of the highest row (on desktop a parameter tells).
    void mirror_point_coordinate() {
        static constexpr std::string_view word = "gl_PointCoord";
        std::string& text = result_.source;
        for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos;) {
            static constexpr std::string_view mirrored = "vec2(gl_PointCoord.x, 1.0 - gl_PointCoord.y)";
            text.replace(at, word.size(), mirrored);
            at += mirrored.size();
        }
    }

    const rhi::BackendShader& shader_;
    std::vector<std::uint32_t> spirv_;
    const Traits& traits_;
    SlotAllocator& slots_;
    const char letter_;
    CrossContext context_;
    spvc_compiler compiler_ = nullptr;
    std::vector<SpvId> combined_;  ///< Pairs of a texture and a sampler.
    Translation result_;
};

}  // namespace

std::uint32_t SlotAllocator::Space::take(Key key, std::uint32_t count) {
    const auto [found, is_new] = taken.try_emplace(key, next);
    if (is_new) next += count;
    return found->second;
}

std::uint32_t SlotAllocator::uniform_buffer(std::uint32_t set, std::uint32_t binding, std::uint32_t count) {
    return uniform_buffers_.take({set, binding, 0, 0}, count);
}
std::uint32_t SlotAllocator::storage_buffer(std::uint32_t set, std::uint32_t binding, std::uint32_t count) {
    return storage_buffers_.take({set, binding, 0, 0}, count);
}
std::uint32_t SlotAllocator::image(std::uint32_t set, std::uint32_t binding, std::uint32_t count) {
    return images_.take({set, binding, 0, 0}, count);
}
std::uint32_t SlotAllocator::texture(std::uint32_t set, std::uint32_t binding, std::uint32_t sampler_set,
                                     std::uint32_t sampler_binding, std::uint32_t count) {
    return textures_.take({set, binding, sampler_set, sampler_binding}, count);
}

Expected<Translation> translate(const rhi::BackendShader& shader,
                                std::span<const rhi::SpecializationConstant> specialization, const Traits& traits,
                                SlotAllocator& slots) {
    return Translator(shader, traits, slots).run(specialization);
}

}  // namespace nacre::gl
