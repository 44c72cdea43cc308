// SPDX-License-Identifier: Apache-2.0
#include "rhi/reflection.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spirv/unified1/spirv.hpp11>

#include "rhi/binding_type.h"
#include "rhi/spirv.h"

namespace nacre::rhi {
namespace {

using spirv::Instruction;

constexpr std::uint32_t no_member = ~0u;

struct Decoration {
    std::uint32_t target, member;
    spv::Decoration kind;
    std::uint32_t value;
};

std::uint64_t saturating_add(std::uint64_t a, std::uint64_t b) {
    std::uint64_t sum = 0;
    return __builtin_add_overflow(a, b, &sum) ? std::numeric_limits<std::uint64_t>::max() : sum;
}
std::uint64_t saturating_multiply(std::uint64_t a, std::uint64_t b) {
    std::uint64_t product = 0;
    return __builtin_mul_overflow(a, b, &product) ? std::numeric_limits<std::uint64_t>::max() : product;
}

std::string_view stage_name(ShaderStage stage) {
    switch (stage) {
        case ShaderStage::vertex: return "vertex";
        case ShaderStage::fragment: return "fragment";
        case ShaderStage::compute: return "compute";
        default: return "no single";
    }
}

ShaderStage stage_of(spv::ExecutionModel model) {
    switch (model) {
        case spv::ExecutionModel::Vertex: return ShaderStage::vertex;
        case spv::ExecutionModel::Fragment: return ShaderStage::fragment;
        case spv::ExecutionModel::GLCompute: return ShaderStage::compute;
        default: return ShaderStage::none;
    }
}

Format format_of(spv::ImageFormat format) {
    switch (format) {
        case spv::ImageFormat::Rgba32f: return Format::rgba32_float;
        case spv::ImageFormat::Rgba16f: return Format::rgba16_float;
        case spv::ImageFormat::R32f: return Format::r32_float;
        case spv::ImageFormat::Rgba8: return Format::rgba8_unorm;
        case spv::ImageFormat::Rgba8Snorm: return Format::rgba8_snorm;
        case spv::ImageFormat::Rg32f: return Format::rg32_float;
        case spv::ImageFormat::Rg16f: return Format::rg16_float;
        case spv::ImageFormat::R11fG11fB10f: return Format::rg11b10_float;
        case spv::ImageFormat::R16f: return Format::r16_float;
        case spv::ImageFormat::Rgba16: return Format::rgba16_unorm;
        case spv::ImageFormat::Rgb10A2: return Format::rgb10a2_unorm;
        case spv::ImageFormat::Rg16: return Format::rg16_unorm;
        case spv::ImageFormat::Rg8: return Format::rg8_unorm;
        case spv::ImageFormat::R16: return Format::r16_unorm;
        case spv::ImageFormat::R8: return Format::r8_unorm;
        case spv::ImageFormat::Rgba16Snorm: return Format::rgba16_snorm;
        case spv::ImageFormat::Rg16Snorm: return Format::rg16_snorm;
        case spv::ImageFormat::Rg8Snorm: return Format::rg8_snorm;
        case spv::ImageFormat::R16Snorm: return Format::r16_snorm;
        case spv::ImageFormat::R8Snorm: return Format::r8_snorm;
        case spv::ImageFormat::Rgba32i: return Format::rgba32_sint;
        case spv::ImageFormat::Rgba16i: return Format::rgba16_sint;
        case spv::ImageFormat::Rgba8i: return Format::rgba8_sint;
        case spv::ImageFormat::R32i: return Format::r32_sint;
        case spv::ImageFormat::Rg32i: return Format::rg32_sint;
        case spv::ImageFormat::Rg16i: return Format::rg16_sint;
        case spv::ImageFormat::Rg8i: return Format::rg8_sint;
        case spv::ImageFormat::R16i: return Format::r16_sint;
        case spv::ImageFormat::R8i: return Format::r8_sint;
        case spv::ImageFormat::Rgba32ui: return Format::rgba32_uint;
        case spv::ImageFormat::Rgba16ui: return Format::rgba16_uint;
        case spv::ImageFormat::Rgba8ui: return Format::rgba8_uint;
        case spv::ImageFormat::R32ui: return Format::r32_uint;
        case spv::ImageFormat::Rgb10a2ui: return Format::rgb10a2_uint;
        case spv::ImageFormat::Rg32ui: return Format::rg32_uint;
        case spv::ImageFormat::Rg16ui: return Format::rg16_uint;
        case spv::ImageFormat::Rg8ui: return Format::rg8_uint;
        case spv::ImageFormat::R16ui: return Format::r16_uint;
        case spv::ImageFormat::R8ui: return Format::r8_uint;
        default: return Format::undefined;
    }
}

ViewDimension dimension_of(spv::Dim dim, bool arrayed) {
    switch (dim) {
        case spv::Dim::Dim1D: return arrayed ? ViewDimension::d1_array : ViewDimension::d1;
        case spv::Dim::Dim2D: return arrayed ? ViewDimension::d2_array : ViewDimension::d2;
        case spv::Dim::Dim3D: return ViewDimension::d3;
        case spv::Dim::Cube: return arrayed ? ViewDimension::cube_array : ViewDimension::cube;
        default: return ViewDimension::automatic;
    }
}

/// A module that the validator has passed, indexed by id. Every look-up is still checked: the validator's rules
/// are many, and a lookup of a wrong kind must read as "absent", never as memory beyond the module.
class Module {
  public:
    explicit Module(std::span<const std::uint32_t> words) : words_(words), definitions_(words[3], 0) {
        for (const Instruction& instruction : spirv::instructions(words)) index(instruction);
        std::ranges::stable_sort(decorations_, {}, &Decoration::target);
    }

    [[nodiscard]] std::optional<Instruction> find(std::uint32_t id) const {
        if (id >= definitions_.size() || definitions_[id] == 0) return {};
        const std::size_t offset = definitions_[id];
        return Instruction{words_.subspan(offset, words_[offset] >> 16), offset};
    }
    [[nodiscard]] std::optional<Instruction> find(std::uint32_t id, spv::Op opcode) const {
        auto found = find(id);
        return found && is(*found, opcode) ? found : std::nullopt;
    }
    static bool is(const Instruction& instruction, spv::Op opcode) {
        return instruction.opcode() == static_cast<std::uint32_t>(opcode);
    }

    [[nodiscard]] std::optional<std::uint32_t> decoration(std::uint32_t id, spv::Decoration kind,
                                                          std::uint32_t member = no_member) const {
        for (const Decoration& entry : std::ranges::equal_range(decorations_, id, {}, &Decoration::target))
            if (entry.kind == kind && entry.member == member) return entry.value;
        return {};
    }
    [[nodiscard]] bool has(std::uint32_t id, spv::Decoration kind, std::uint32_t member = no_member) const {
        return decoration(id, kind, member).has_value();
    }
    [[nodiscard]] bool every_member_has(const Instruction& structure, spv::Decoration kind) const {
        const auto members = static_cast<std::uint32_t>(structure.operand_count() - 1);
        for (std::uint32_t member = 0; member < members; ++member)
            if (!has(structure.operand(0), kind, member)) return false;
        return members > 0;
    }
    [[nodiscard]] std::string name(std::uint32_t id) const {
        const auto found = names_.find(id);
        return found == names_.end() ? std::string() : found->second;
    }
    /// Value of an integer constant, or the default of a specialization constant.
    [[nodiscard]] std::uint32_t constant(std::uint32_t id) const {
        const auto found = find(id);
        const bool is_constant = found && (is(*found, spv::Op::OpConstant) || is(*found, spv::Op::OpSpecConstant));
        return is_constant ? found->operand(2) : 0;
    }

    /// Bytes of a type laid out by its Offset, ArrayStride and MatrixStride decorations; nothing for the unbounded
    /// tail.
    std::uint64_t size(std::uint32_t type, std::uint32_t matrix_stride = 0, bool row_major = false) {
        const auto found = find(type);
        if (!found) return 0;
        switch (static_cast<spv::Op>(found->opcode())) {
            case spv::Op::OpTypeInt:
            case spv::Op::OpTypeFloat: return found->operand(1) / 8;
            case spv::Op::OpTypeVector: return saturating_multiply(size(found->operand(1)), found->operand(2));
            case spv::Op::OpTypeMatrix: {
                const auto column = find(found->operand(1), spv::Op::OpTypeVector);
                const std::uint32_t rows = column ? column->operand(2) : 0;
                return std::uint64_t{matrix_stride} * (row_major ? rows : found->operand(2));
            }
            case spv::Op::OpTypeArray:
                return saturating_multiply(decoration(type, spv::Decoration::ArrayStride).value_or(0),
                                           constant(found->operand(2)));
            case spv::Op::OpTypeStruct: return struct_size(*found);
            default: return 0;
        }
    }

    /// Kind and components of a scalar, a vector or of a matrix's column, and the locations of the whole.
    void describe_variable(std::uint32_t type, ReflectedVariable& variable) {
        variable.locations = 1;
        for (int depth = 0; depth < 64; ++depth) {
            const auto found = find(type);
            if (!found) return;
            switch (static_cast<spv::Op>(found->opcode())) {
                case spv::Op::OpTypeFloat: variable.kind = FormatKind::floating; return;
                case spv::Op::OpTypeInt:
                    variable.kind = found->operand(2) ? FormatKind::sint : FormatKind::uint;
                    return;
                case spv::Op::OpTypeVector: variable.components = found->operand(2); break;
                case spv::Op::OpTypeMatrix: variable.locations *= found->operand(2); break;
                case spv::Op::OpTypeArray: variable.locations *= std::max(constant(found->operand(2)), 1u); break;
                default: return;
            }
            type = found->operand(1);
        }
    }

    [[nodiscard]] const std::vector<Instruction>& variables() const { return variables_; }
    [[nodiscard]] const std::vector<Instruction>& entry_points() const { return entry_points_; }
    [[nodiscard]] const std::vector<Instruction>& execution_modes() const { return execution_modes_; }
    [[nodiscard]] const std::vector<Instruction>& specialization() const { return specialization_; }
    [[nodiscard]] const std::vector<std::uint32_t>& capabilities() const { return capabilities_; }
    [[nodiscard]] const std::vector<std::uint32_t>& composites() const { return composites_; }

    struct Reachable {
        std::unordered_set<std::uint32_t>
            named;  ///< Ids that instructions name (and some literals that look like ids).
        bool discards = false;
    };
    /// What the functions that an entry point calls, directly or not, refer to.
    [[nodiscard]] Reachable reach(std::uint32_t entry_function) const {
        Reachable result;
        std::unordered_set<std::uint32_t> seen{entry_function};
        std::vector<std::uint32_t> open{entry_function};
        while (!open.empty()) {
            const auto function = find(open.back(), spv::Op::OpFunction);
            open.pop_back();
            if (!function) continue;
            for (spirv::InstructionRange::Iterator at(words_, function->offset), end(words_, words_.size()); at != end;
                 ++at) {
                const Instruction instruction = *at;
                const auto opcode = static_cast<spv::Op>(instruction.opcode());
                if (opcode == spv::Op::OpFunctionEnd) break;
                if (opcode == spv::Op::OpLine) continue;
                if (opcode == spv::Op::OpKill || opcode == spv::Op::OpTerminateInvocation ||
                    opcode == spv::Op::OpDemoteToHelperInvocation)
                    result.discards = true;
                if (opcode == spv::Op::OpFunctionCall && seen.insert(instruction.operand(2)).second)
                    open.push_back(instruction.operand(2));
                result.named.insert(instruction.words.begin() + 1, instruction.words.end());
            }
        }
        return result;
    }

  private:
    void index(const Instruction& instruction) {
        const auto opcode = static_cast<spv::Op>(instruction.opcode());
        bool has_result = false, has_type = false;
        spv::HasResultAndType(opcode, &has_result, &has_type);
        if (has_result) {
            const std::uint32_t id = instruction.operand(has_type ? 1 : 0);
            if (id < definitions_.size()) definitions_[id] = static_cast<std::uint32_t>(instruction.offset);
        }
        switch (opcode) {
            case spv::Op::OpName: names_[instruction.operand(0)] = instruction.text(1); break;
            case spv::Op::OpDecorate:
                decorations_.push_back({instruction.operand(0), no_member,
                                        static_cast<spv::Decoration>(instruction.operand(1)), instruction.operand(2)});
                break;
            case spv::Op::OpMemberDecorate:
                decorations_.push_back({instruction.operand(0), instruction.operand(1),
                                        static_cast<spv::Decoration>(instruction.operand(2)), instruction.operand(3)});
                break;
            case spv::Op::OpCapability: capabilities_.push_back(instruction.operand(0)); break;
            case spv::Op::OpEntryPoint: entry_points_.push_back(instruction); break;
            case spv::Op::OpExecutionMode:
            case spv::Op::OpExecutionModeId: execution_modes_.push_back(instruction); break;
            case spv::Op::OpVariable:
                if (static_cast<spv::StorageClass>(instruction.operand(2)) != spv::StorageClass::Function)
                    variables_.push_back(instruction);
                break;
            case spv::Op::OpSpecConstantTrue:
            case spv::Op::OpSpecConstantFalse:
            case spv::Op::OpSpecConstant: specialization_.push_back(instruction); break;
            case spv::Op::OpConstantComposite:
            case spv::Op::OpSpecConstantComposite: composites_.push_back(instruction.operand(1)); break;
            default: break;
        }
    }

    std::uint64_t struct_size(const Instruction& structure) {
        const std::uint32_t id = structure.operand(0);
        // Remembered, because types share parts: nested pairs would otherwise take time exponential in their depth.
        // A zero first, so that a type within itself ends.
        if (const auto [known, is_new] = sizes_.try_emplace(id, 0); !is_new) return known->second;
        std::uint64_t bytes = 0;
        const auto members = static_cast<std::uint32_t>(structure.operand_count() - 1);
        for (std::uint32_t member = 0; member < members; ++member) {
            const std::uint32_t stride = decoration(id, spv::Decoration::MatrixStride, member).value_or(0);
            const bool row_major = has(id, spv::Decoration::RowMajor, member);
            const std::uint64_t offset = decoration(id, spv::Decoration::Offset, member).value_or(0);
            bytes = std::max(bytes, saturating_add(offset, size(structure.operand(member + 1), stride, row_major)));
        }
        return sizes_[id] = bytes;
    }

    std::span<const std::uint32_t> words_;
    std::vector<std::uint32_t> definitions_;  // Word offset by id; 0: none.
    std::vector<Decoration> decorations_;     // Sorted by target.
    std::unordered_map<std::uint32_t, std::string> names_;
    std::unordered_map<std::uint32_t, std::uint64_t> sizes_;
    std::vector<Instruction> variables_, entry_points_, execution_modes_, specialization_;
    std::vector<std::uint32_t> capabilities_, composites_;
};

class Reflector {
  public:
    Reflector(Module& module, ShaderStage stage, const std::string& entry_point, const std::string& name)
        : module_(module), stage_(stage), entry_point_(entry_point), name_(name) {}

    Expected<ShaderReflection> run() {
        NACRE_CHECK(find_entry_point());
        result_.stage = stage_;
        reached_ = module_.reach(entry_->operand(1));
        result_.discards = reached_.discards;
        read_capabilities();
        read_execution_modes();
        read_workgroup_size();
        read_specialization();
        for (const Instruction& variable : module_.variables()) NACRE_CHECK(read_variable(variable));
        read_interface();
        std::ranges::sort(result_.bindings, {}, [](const ReflectedBinding& b) { return std::pair(b.set, b.binding); });
        return std::move(result_);
    }

  private:
    std::unexpected<Error> reject(ErrorCode code, std::string reason, std::string remedy) const {
        return fail(code, "reflect shader", fmt::format("'{}'", name_), std::move(reason), std::move(remedy));
    }

    Expected<void> find_entry_point() {
        std::vector<std::string> others;
        for (const Instruction& candidate : module_.entry_points()) {
            const ShaderStage stage = stage_of(static_cast<spv::ExecutionModel>(candidate.operand(0)));
            const std::string found = candidate.text(2);
            if (found == entry_point_ && stage == stage_) entry_ = candidate;
            others.push_back(
                fmt::format("'{}' ({})", found, stage == ShaderStage::none ? "another" : stage_name(stage)));
        }
        if (entry_) return {};
        return reject(
            ErrorCode::shader_compile,
            fmt::format("there is no entry point '{}' for the {} stage; the module has {}", entry_point_,
                        stage_name(stage_), others.empty() ? "none" : fmt::format("{}", fmt::join(others, ", "))),
            "Set ShaderDesc::stage and ShaderDesc::entry_point to one that it has.");
    }

    void read_capabilities() {
        for (const std::uint32_t capability : module_.capabilities()) {
            const std::string text = spirv::capability_name(capability);
            result_.uses_subgroups |= text.starts_with("GroupNonUniform") || text.starts_with("Subgroup");
            result_.uses_ray_query |= text == "RayQueryKHR";
            result_.capabilities.push_back(text);
        }
    }

    void set_workgroup_dimension(std::size_t dimension, std::uint32_t constant_id) {
        result_.workgroup_size[dimension] = module_.constant(constant_id);
        result_.workgroup_size_ids[dimension] =
            module_.decoration(constant_id, spv::Decoration::SpecId).value_or(~0u);
    }

    void read_execution_modes() {
        for (const Instruction& mode : module_.execution_modes()) {
            if (mode.operand(0) != entry_->operand(1)) continue;
            switch (static_cast<spv::ExecutionMode>(mode.operand(1))) {
                case spv::ExecutionMode::EarlyFragmentTests: result_.early_fragment_tests = true; break;
                case spv::ExecutionMode::DepthReplacing: result_.writes_depth = true; break;
                case spv::ExecutionMode::LocalSize:
                    result_.workgroup_size = {mode.operand(2), mode.operand(3), mode.operand(4)};
                    break;
                case spv::ExecutionMode::LocalSizeId:
                    for (std::size_t i = 0; i < 3; ++i) set_workgroup_dimension(i, mode.operand(2 + i));
                    break;
                default: break;
            }
        }
    }

    // A constant decorated as the built-in WorkgroupSize wins over the execution mode (local_size_x_id in GLSL).
    void read_workgroup_size() {
        if (stage_ != ShaderStage::compute) return;
        for (const std::uint32_t id : module_.composites()) {
            const auto built_in = module_.decoration(id, spv::Decoration::BuiltIn);
            if (!built_in || static_cast<spv::BuiltIn>(*built_in) != spv::BuiltIn::WorkgroupSize) continue;
            const auto composite = module_.find(id);
            for (std::size_t i = 0; composite && i < 3; ++i) set_workgroup_dimension(i, composite->operand(2 + i));
        }
    }

    void read_specialization() {
        for (const Instruction& constant : module_.specialization()) {
            const auto id = module_.decoration(constant.operand(1), spv::Decoration::SpecId);
            if (id) result_.specialization.push_back({*id, module_.name(constant.operand(1))});
        }
        std::ranges::sort(result_.specialization, {}, &ReflectedSpecialization::id);
        const auto repeated = std::ranges::unique(result_.specialization, {}, &ReflectedSpecialization::id);
        result_.specialization.erase(repeated.begin(), repeated.end());
    }

    Expected<void> read_variable(const Instruction& variable) {
        const std::uint32_t id = variable.operand(1);
        const auto storage = static_cast<spv::StorageClass>(variable.operand(2));
        const bool is_used = reached_.named.contains(id);
        if (!is_used && module_.entry_points().size() > 1) return {};
        const auto pointer = module_.find(variable.operand(0), spv::Op::OpTypePointer);
        if (!pointer) return {};
        std::uint32_t type = pointer->operand(2);

        switch (storage) {
            case spv::StorageClass::PushConstant:
                result_.push_constant_bytes = std::max(
                    result_.push_constant_bytes,
                    static_cast<std::uint32_t>(std::min<std::uint64_t>((module_.size(type) + 3) & ~3ull, 0xfffffffc)));
                return {};
            case spv::StorageClass::Uniform:
            case spv::StorageClass::StorageBuffer:
            case spv::StorageClass::UniformConstant: break;
            default: return {};
        }

        ReflectedBinding binding;
        binding.used = is_used;
        binding.name = module_.name(id);
        binding.set = module_.decoration(id, spv::Decoration::DescriptorSet).value_or(0);
        const auto number = module_.decoration(id, spv::Decoration::Binding);
        if (!number)
            return reject(ErrorCode::shader_compile, fmt::format("'{}' has no binding number", binding.name),
                          "Write layout(set = ..., binding = ...) before it.");
        binding.binding = *number;
        std::uint64_t count = 1;
        for (int depth = 0; depth < 64; ++depth) {
            const auto found = module_.find(type);
            if (!found) return {};
            if (Module::is(*found, spv::Op::OpTypeArray))
                count = saturating_multiply(count, module_.constant(found->operand(2)));
            else if (Module::is(*found, spv::Op::OpTypeRuntimeArray)) count = 0;
            else break;
            type = found->operand(1);
        }
        if (count > std::numeric_limits<std::uint32_t>::max())
            return reject(ErrorCode::unsupported, fmt::format("'{}' is an array of {} resources", binding.name, count),
                          "Make the array smaller.");
        binding.count = static_cast<std::uint32_t>(count);

        const auto found = module_.find(type);
        if (!found) return {};
        if (storage == spv::StorageClass::UniformConstant)
            NACRE_CHECK(read_opaque(binding, id, *found));
        else
            read_block(binding, id, *found, storage);
        return add(std::move(binding));
    }

    void read_block(ReflectedBinding& binding, std::uint32_t variable, const Instruction& type,
                    spv::StorageClass storage) {
        const std::uint32_t id = type.operand(0);
        const bool is_storage_block =
            storage == spv::StorageClass::StorageBuffer || module_.has(id, spv::Decoration::BufferBlock);
        const bool is_readonly = module_.has(variable, spv::Decoration::NonWritable) ||
                                 module_.every_member_has(type, spv::Decoration::NonWritable);
        binding.type = !is_storage_block ? BindingType::uniform_buffer
                       : is_readonly     ? BindingType::readonly_storage_buffer
                                         : BindingType::storage_buffer;
        binding.block_size = module_.size(id);
        if (binding.name.empty()) binding.name = module_.name(id);
    }

    Expected<void> read_opaque(ReflectedBinding& binding, std::uint32_t variable, Instruction type) {
        if (Module::is(type, spv::Op::OpTypeSampler)) {
            binding.type = BindingType::sampler;
            return {};
        }
        if (Module::is(type, spv::Op::OpTypeAccelerationStructureKHR)) {
            binding.type = BindingType::acceleration_structure;
            return {};
        }
        const bool is_combined = Module::is(type, spv::Op::OpTypeSampledImage);
        const auto image = is_combined ? module_.find(type.operand(1), spv::Op::OpTypeImage)
                                       : module_.find(type.operand(0), spv::Op::OpTypeImage);
        if (!image)
            return reject(ErrorCode::unsupported,
                          fmt::format("'{}' is a kind of resource that cannot be bound", binding.name),
                          "Use buffers, textures, samplers and images.");
        const auto sampled = module_.find(image->operand(1));
        if (sampled && Module::is(*sampled, spv::Op::OpTypeInt))
            binding.sampled_kind = sampled->operand(2) ? FormatKind::sint : FormatKind::uint;
        const auto dim = static_cast<spv::Dim>(image->operand(2));
        binding.depth_comparison = image->operand(3) == 1;
        binding.dimension = dimension_of(dim, image->operand(4) != 0);
        binding.multisampled = image->operand(5) != 0;
        const bool is_texel_buffer = dim == spv::Dim::Buffer;
        if (binding.dimension == ViewDimension::automatic && !is_texel_buffer)
            return reject(ErrorCode::unsupported,
                          fmt::format("'{}' is a kind of image that cannot be bound", binding.name),
                          "Use a 1D, 2D, 3D or cube image, or a texel buffer.");
        if (image->operand(6) == 2) {
            const bool is_readonly = module_.has(variable, spv::Decoration::NonWritable);
            const bool is_writeonly = !is_readonly && module_.has(variable, spv::Decoration::NonReadable);
            if (is_texel_buffer)
                binding.type = is_readonly    ? BindingType::readonly_storage_texel_buffer
                               : is_writeonly ? BindingType::writeonly_storage_texel_buffer
                                              : BindingType::storage_texel_buffer;
            else
                binding.type = is_readonly    ? BindingType::readonly_storage_image
                               : is_writeonly ? BindingType::writeonly_storage_image
                                              : BindingType::storage_image;
            binding.image_format = format_of(static_cast<spv::ImageFormat>(image->operand(7)));
        } else if (is_texel_buffer) {
            binding.type = BindingType::uniform_texel_buffer;
        } else {
            binding.type = is_combined ? BindingType::combined_texture_sampler : BindingType::sampled_texture;
        }
        return {};
    }

    // Two variables may share a binding where both are of one kind; the layout must then allow what either does.
    Expected<void> add(ReflectedBinding&& binding) {
        const auto shared = std::ranges::find_if(result_.bindings, [&](const ReflectedBinding& other) {
            return other.set == binding.set && other.binding == binding.binding;
        });
        if (shared == result_.bindings.end()) {
            result_.bindings.push_back(std::move(binding));
            return {};
        }
        if (!is_same_resource(shared->type, binding.type) || shared->count != binding.count ||
            shared->dimension != binding.dimension || shared->multisampled != binding.multisampled)
            return reject(ErrorCode::shader_compile,
                          fmt::format("'{}' and '{}' share set {}, binding {}, but are of different kinds",
                                      shared->name, binding.name, binding.set, binding.binding),
                          "Give one of them another binding number.");
        shared->type = union_of(shared->type, binding.type);
        shared->block_size = std::max(shared->block_size, binding.block_size);
        shared->used |= binding.used;
        return {};
    }

    void read_interface() {
        for (std::size_t i = entry_->after_text(2); i < entry_->operand_count(); ++i) {
            const auto variable = module_.find(entry_->operand(i), spv::Op::OpVariable);
            if (!variable) continue;
            const auto storage = static_cast<spv::StorageClass>(variable->operand(2));
            if (storage == spv::StorageClass::Input) read_interface_variable(*variable, result_.inputs);
            if (storage == spv::StorageClass::Output) read_interface_variable(*variable, result_.outputs);
        }
        const auto order = [](const ReflectedVariable& v) {
            return std::tuple(v.location, v.index, v.first_component);
        };
        std::ranges::sort(result_.inputs, {}, order);
        std::ranges::sort(result_.outputs, {}, order);
    }

    void read_interface_variable(const Instruction& variable, std::vector<ReflectedVariable>& list) {
        const std::uint32_t id = variable.operand(1);
        const auto pointer = module_.find(variable.operand(0), spv::Op::OpTypePointer);
        if (!pointer || module_.has(id, spv::Decoration::BuiltIn)) return;
        const std::uint32_t type = pointer->operand(2);
        const auto block = module_.find(type, spv::Op::OpTypeStruct);
        if (!block) {
            ReflectedVariable& entry = list.emplace_back();
            entry.name = module_.name(id);
            entry.location = module_.decoration(id, spv::Decoration::Location).value_or(0);
            entry.index = module_.decoration(id, spv::Decoration::Index).value_or(0);
            entry.first_component = module_.decoration(id, spv::Decoration::Component).value_or(0);
            entry.components = 1;
            module_.describe_variable(type, entry);
            return;
        }
        // Members of a block without a location of their own follow the one before them.
        std::uint32_t next = module_.decoration(id, spv::Decoration::Location).value_or(0);
        const auto members = static_cast<std::uint32_t>(block->operand_count() - 1);
        for (std::uint32_t member = 0; member < members; ++member) {
            if (module_.has(type, spv::Decoration::BuiltIn, member)) continue;
            ReflectedVariable& entry = list.emplace_back();
            entry.name = fmt::format("{}.{}", module_.name(id), member);
            entry.location = module_.decoration(type, spv::Decoration::Location, member).value_or(next);
            entry.first_component = module_.decoration(type, spv::Decoration::Component, member).value_or(0);
            entry.components = 1;
            module_.describe_variable(block->operand(member + 1), entry);
            next = entry.location + entry.locations;
        }
    }

    Module& module_;
    ShaderStage stage_;
    const std::string& entry_point_;
    const std::string& name_;
    std::optional<Instruction> entry_;
    Module::Reachable reached_;
    ShaderReflection result_;
};

}  // namespace

Expected<ShaderReflection> reflect(std::span<const std::uint32_t> spirv, ShaderStage stage,
                                   const std::string& entry_point, const std::string& name) {
    NACRE_CHECK(spirv::validate(spirv, name));
    Module module(spirv);
    return Reflector(module, stage, entry_point, name).run();
}

}  // namespace nacre::rhi
