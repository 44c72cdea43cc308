// SPDX-License-Identifier: Apache-2.0
#include "rhi/spirv.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>
#include <spirv-tools/libspirv.h>
#include <spirv/unified1/spirv.hpp11>

#include "core/hash.h"

namespace nacre::rhi::spirv {
namespace {

constexpr std::string_view action = "validate SPIR-V";

struct CapabilityInfo {
    spv::Capability capability;
    std::string_view name;
    bool is_known;  // Something that vertex, fragment and compute shaders may ask of a device through this interface.
};

constexpr auto capability_table = std::to_array<CapabilityInfo>({
#define KNOWN(name) {spv::Capability::name, #name, true}
#define FOREIGN(name) {spv::Capability::name, #name, false}
    KNOWN(Matrix),
    KNOWN(Shader),
    KNOWN(Float16),
    KNOWN(Float64),
    KNOWN(Int64),
    KNOWN(Int64Atomics),
    KNOWN(Int16),
    KNOWN(Int8),
    KNOWN(ImageGatherExtended),
    KNOWN(StorageImageMultisample),
    KNOWN(UniformBufferArrayDynamicIndexing),
    KNOWN(SampledImageArrayDynamicIndexing),
    KNOWN(StorageBufferArrayDynamicIndexing),
    KNOWN(StorageImageArrayDynamicIndexing),
    KNOWN(ClipDistance),
    KNOWN(CullDistance),
    KNOWN(ImageCubeArray),
    KNOWN(SampleRateShading),
    KNOWN(MinLod),
    KNOWN(Sampled1D),
    KNOWN(Image1D),
    KNOWN(SampledCubeArray),
    KNOWN(ImageMSArray),
    KNOWN(StorageImageExtendedFormats),
    KNOWN(ImageQuery),
    KNOWN(DerivativeControl),
    KNOWN(InterpolationFunction),
    KNOWN(StorageImageReadWithoutFormat),
    KNOWN(StorageImageWriteWithoutFormat),
    KNOWN(GroupNonUniform),
    KNOWN(GroupNonUniformVote),
    KNOWN(GroupNonUniformArithmetic),
    KNOWN(GroupNonUniformBallot),
    KNOWN(GroupNonUniformShuffle),
    KNOWN(GroupNonUniformShuffleRelative),
    KNOWN(GroupNonUniformClustered),
    KNOWN(GroupNonUniformQuad),
    KNOWN(SubgroupBallotKHR),
    KNOWN(SubgroupVoteKHR),
    KNOWN(DrawParameters),
    KNOWN(StorageBuffer16BitAccess),
    KNOWN(UniformAndStorageBuffer16BitAccess),
    KNOWN(StoragePushConstant16),
    KNOWN(StorageInputOutput16),
    KNOWN(StorageBuffer8BitAccess),
    KNOWN(UniformAndStorageBuffer8BitAccess),
    KNOWN(StoragePushConstant8),
    KNOWN(DenormPreserve),
    KNOWN(DenormFlushToZero),
    KNOWN(SignedZeroInfNanPreserve),
    KNOWN(RoundingModeRTE),
    KNOWN(RoundingModeRTZ),
    KNOWN(RayQueryKHR),
    KNOWN(RayTraversalPrimitiveCullingKHR),
    KNOWN(ShaderNonUniform),
    KNOWN(RuntimeDescriptorArray),
    KNOWN(UniformBufferArrayNonUniformIndexing),
    KNOWN(SampledImageArrayNonUniformIndexing),
    KNOWN(StorageBufferArrayNonUniformIndexing),
    KNOWN(StorageImageArrayNonUniformIndexing),
    KNOWN(VulkanMemoryModel),
    KNOWN(VulkanMemoryModelDeviceScope),
    KNOWN(DemoteToHelperInvocation),
    KNOWN(VariablePointersStorageBuffer),
    KNOWN(VariablePointers),
    KNOWN(AtomicFloat32AddEXT),
    KNOWN(AtomicFloat64AddEXT),
    KNOWN(AtomicFloat32MinMaxEXT),
    KNOWN(AtomicFloat64MinMaxEXT),
    KNOWN(DotProduct),
    KNOWN(DotProductInputAll),
    KNOWN(DotProductInput4x8Bit),
    KNOWN(DotProductInput4x8BitPacked),
    KNOWN(GroupNonUniformRotateKHR),
    KNOWN(DeviceGroup),
    KNOWN(SampledBuffer),
    KNOWN(ImageBuffer),
    KNOWN(UniformTexelBufferArrayDynamicIndexing),
    KNOWN(StorageTexelBufferArrayDynamicIndexing),
    KNOWN(UniformTexelBufferArrayNonUniformIndexing),
    KNOWN(StorageTexelBufferArrayNonUniformIndexing),
    FOREIGN(Geometry),
    FOREIGN(Tessellation),
    FOREIGN(Addresses),
    FOREIGN(Linkage),
    FOREIGN(Kernel),
    FOREIGN(Vector16),
    FOREIGN(Float16Buffer),
    FOREIGN(ImageBasic),
    FOREIGN(ImageReadWrite),
    FOREIGN(ImageMipmap),
    FOREIGN(Pipes),
    FOREIGN(Groups),
    FOREIGN(DeviceEnqueue),
    FOREIGN(LiteralSampler),
    FOREIGN(AtomicStorage),
    FOREIGN(TessellationPointSize),
    FOREIGN(GeometryPointSize),
    FOREIGN(ImageRect),
    FOREIGN(SampledRect),
    FOREIGN(GenericPointer),
    FOREIGN(InputAttachment),
    FOREIGN(SparseResidency),
    FOREIGN(TransformFeedback),
    FOREIGN(GeometryStreams),
    FOREIGN(MultiViewport),
    FOREIGN(SubgroupDispatch),
    FOREIGN(NamedBarrier),
    FOREIGN(PipeStorage),
    FOREIGN(ShaderLayer),
    FOREIGN(ShaderViewportIndex),
    FOREIGN(UniformDecoration),
    FOREIGN(FragmentShadingRateKHR),
    FOREIGN(WorkgroupMemoryExplicitLayoutKHR),
    FOREIGN(MultiView),
    FOREIGN(SampleMaskPostDepthCoverage),
    FOREIGN(RayQueryProvisionalKHR),
    FOREIGN(RayTracingKHR),
    FOREIGN(StencilExportEXT),
    FOREIGN(Int64ImageEXT),
    FOREIGN(ShaderClockKHR),
    FOREIGN(ShaderViewportIndexLayerEXT),
    FOREIGN(FragmentFullyCoveredEXT),
    FOREIGN(MeshShadingNV),
    FOREIGN(MeshShadingEXT),
    FOREIGN(FragmentBarycentricKHR),
    FOREIGN(FragmentDensityEXT),
    FOREIGN(RayTracingNV),
    FOREIGN(PhysicalStorageBufferAddresses),
    FOREIGN(CooperativeMatrixNV),
    FOREIGN(FragmentShaderSampleInterlockEXT),
    FOREIGN(FragmentShaderPixelInterlockEXT),
    FOREIGN(BindlessTextureNV),
    FOREIGN(AtomicFloat16AddEXT),
    FOREIGN(AtomicFloat16MinMaxEXT),
#undef KNOWN
#undef FOREIGN
});

const CapabilityInfo* find_capability(std::uint32_t capability) {
    const auto* found = std::ranges::find(capability_table, static_cast<spv::Capability>(capability),
                                          &CapabilityInfo::capability);
    return found == capability_table.end() ? nullptr : found;
}

std::unexpected<Error> broken(std::string_view name, std::string reason) {
    return fail(ErrorCode::shader_compile, std::string(action), fmt::format("'{}'", name), std::move(reason),
                "Compile the shader again; pass whole SPIR-V modules in the byte order of this machine.");
}

spv_target_env environment_of(std::uint32_t version) {
    if (version <= 0x00010300) return SPV_ENV_VULKAN_1_1;
    if (version == 0x00010400) return SPV_ENV_VULKAN_1_1_SPIRV_1_4;
    if (version == 0x00010500) return SPV_ENV_VULKAN_1_2;
    return SPV_ENV_VULKAN_1_3;
}

/// Owners of the C interface's objects.
struct Context {
    explicit Context(spv_target_env environment) : handle(spvContextCreate(environment)) {}
    ~Context() { spvContextDestroy(handle); }
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;
    spv_context handle;
};
struct Diagnostic {
    Diagnostic() = default;
    ~Diagnostic() { spvDiagnosticDestroy(handle); }
    Diagnostic(const Diagnostic&) = delete;
    Diagnostic& operator=(const Diagnostic&) = delete;
    spv_diagnostic handle = nullptr;
};
struct Options {
    Options() : handle(spvValidatorOptionsCreate()) {
        // Vulkan 1.1 has relaxed block layout; GLSL's std430 blocks and scalar members need no more.
        spvValidatorOptionsSetRelaxBlockLayout(handle, true);
        spvValidatorOptionsSetFriendlyNames(handle, true);
    }
    ~Options() { spvValidatorOptionsDestroy(handle); }
    Options(const Options&) = delete;
    Options& operator=(const Options&) = delete;
    spv_validator_options handle;
};

/// The validator counts instructions (from 1), the parser of binaries counts words.
std::size_t offset_of_instruction(std::span<const std::uint32_t> words, std::size_t number) {
    for (const Instruction& instruction : instructions(words))
        if (number-- <= 1) return instruction.offset;
    return words.size();
}

/// Finds types so large that SPIRV-Tools' validator would take all memory (it lists every location of an interface
/// variable) or all time (it lays out a structure once for each place where it is nested). Runs before the validator,
/// so nothing here is known to be right; but types that come after their use are the validator's to reject.
class TypeSizes {
  public:
    Expected<void> check(std::span<const std::uint32_t> words, std::string_view name) {
        for (const Instruction& at : instructions(words)) {
            const std::uint32_t result = at.operand(0);
            switch (static_cast<spv::Op>(at.opcode())) {
                case spv::Op::OpConstant:
                case spv::Op::OpSpecConstant:
                    constants_[at.operand(1)] = at.operand_count() > 3 && at.operand(3) != 0 ? ~0u : at.operand(2);
                    break;
                case spv::Op::OpTypeMatrix: types_[result] = {at.operand(2), 1}; break;
                case spv::Op::OpTypeArray: {
                    const auto length = constants_.find(at.operand(2));
                    const Size element = size(at.operand(1));
                    types_[result] = {limited(element.locations * (length == constants_.end() ? 1 : length->second)),
                                      limited(element.layouts * 4)};
                    break;
                }
                case spv::Op::OpTypeRuntimeArray:
                    types_[result] = {1, limited(size(at.operand(1)).layouts * 4)};
                    break;
                case spv::Op::OpTypeStruct: {
                    Size sum{0, 1};
                    for (std::size_t i = 1; i < at.operand_count(); ++i) {
                        const Size member = size(at.operand(i));
                        sum = {limited(sum.locations + member.locations), limited(sum.layouts + member.layouts)};
                    }
                    types_[result] = sum;
                    if (sum.layouts > max_layouts)
                        return broken(name, fmt::format("word {}: a structure of more than {} nested members",
                                                        at.offset, max_layouts));
                    break;
                }
                case spv::Op::OpTypePointer:
                    if (static_cast<spv::StorageClass>(at.operand(1)) == spv::StorageClass::Input ||
                        static_cast<spv::StorageClass>(at.operand(1)) == spv::StorageClass::Output) {
                        if (size(at.operand(2)).locations > max_locations)
                            return broken(name, fmt::format("word {}: inputs or outputs of more than {} locations",
                                                            at.offset, max_locations));
                    }
                    break;
                case spv::Op::OpFunction: return {};  // No types come after it.
                default: break;
            }
        }
        return {};
    }

  private:
    // Far more than any device takes and any shader needs.
    static constexpr std::uint64_t max_locations = 4096, max_layouts = 1 << 18, limit = 1ull << 32;

    struct Size {
        std::uint64_t locations = 1, layouts = 1;
    };
    static std::uint64_t limited(std::uint64_t value) { return std::min(value, limit); }
    [[nodiscard]] Size size(std::uint32_t type) const {
        const auto found = types_.find(type);
        return found == types_.end() ? Size{} : found->second;
    }

    std::unordered_map<std::uint32_t, Size> types_;
    std::unordered_map<std::uint32_t, std::uint32_t> constants_;
};

class ValidModules {
  public:
    bool contains(const Hash128& hash) {
        std::lock_guard lock(mutex_);
        return hashes_.contains(hash);
    }
    void add(const Hash128& hash) {
        std::lock_guard lock(mutex_);
        hashes_.insert(hash);
    }

  private:
    std::mutex mutex_;
    std::unordered_set<Hash128> hashes_;
};

ValidModules& valid_modules() {
    static ValidModules modules;
    return modules;
}

}  // namespace

std::string Instruction::text(std::size_t index) const {
    std::string result;
    for (std::size_t i = index + 1; i < words.size(); ++i) {
        for (int shift = 0; shift < 32; shift += 8) {
            const char character = static_cast<char>(words[i] >> shift & 0xff);
            if (character == '\0') return result;
            result += character;
        }
    }
    return result;
}

std::size_t Instruction::after_text(std::size_t index) const {
    for (std::size_t i = index + 1; i < words.size(); ++i) {
        const std::uint32_t word = words[i];
        if (!(word & 0xff) || !(word & 0xff00) || !(word & 0xff0000) || !(word & 0xff000000)) return i;
    }
    return words.size() - 1;
}

Expected<std::span<const std::uint32_t>> words_of(std::span<const std::byte> bytes, std::string_view name) {
    if (bytes.empty()) return broken(name, "there are no bytes");
    if (bytes.size() % 4 != 0)
        return broken(name, fmt::format("SPIR-V is made of 32-bit words, but there are {} bytes", bytes.size()));
    if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(std::uint32_t) != 0)
        return fail(ErrorCode::invalid_argument, std::string(action), fmt::format("'{}'", name),
                    "the bytes do not start at a multiple of 4", "Copy them into a std::vector<std::uint32_t>.");
    return std::span(reinterpret_cast<const std::uint32_t*>(bytes.data()), bytes.size() / 4);
}

Expected<void> check_structure(std::span<const std::uint32_t> words, std::string_view name) {
    if (words.empty()) return broken(name, "there are no words");
    constexpr std::uint32_t swapped_magic = 0x03022307;
    if (words[0] == swapped_magic) return broken(name, "word 0: the module has the other byte order (0x03022307)");
    if (words[0] != spv::MagicNumber)
        return broken(name, fmt::format("word 0: the magic number is 0x{:08x}, expected 0x07230203", words[0]));
    if (words.size() < 5)
        return broken(name, fmt::format("a header has 5 words, but the module ends after {}", words.size()));
    const std::uint32_t version = words[1];
    if (version < 0x00010000 || version > 0x00010600 || (version & 0xff0000ff) != 0)
        return fail(ErrorCode::unsupported, std::string(action), fmt::format("'{}'", name),
                    fmt::format("word 1: version 0x{:08x} is not one of SPIR-V 1.0 to 1.6", version),
                    "Compile for SPIR-V 1.3.");
    if (words[3] == 0 || words[3] > max_id_bound)
        return broken(name, fmt::format("word 3: the id bound is {}, allowed are 1 to {}", words[3], max_id_bound));
    if (words[4] != 0) return broken(name, fmt::format("word 4: the schema is {}, expected 0", words[4]));
    for (std::size_t offset = 5; offset < words.size();) {
        const std::size_t count = words[offset] >> 16;
        if (count == 0) return broken(name, fmt::format("word {}: an instruction of no words", offset));
        if (count > words.size() - offset)
            return broken(name, fmt::format("word {}: an instruction of {} words, but the module ends after {} more",
                                            offset, count, words.size() - offset));
        offset += count;
    }
    return {};
}

Expected<void> validate(std::span<const std::uint32_t> words, std::string_view name) {
    NACRE_CHECK(check_structure(words, name));
    const Hash128 hash = hash128(std::as_bytes(words));
    if (valid_modules().contains(hash)) return {};

    for (const Instruction& instruction : instructions(words)) {
        if (instruction.opcode() != static_cast<std::uint32_t>(spv::Op::OpCapability)) break;
        const CapabilityInfo* capability = find_capability(instruction.operand(0));
        if (!capability || !capability->is_known)
            return fail(ErrorCode::unsupported, std::string(action), fmt::format("'{}'", name),
                        fmt::format("word {}: capability {} is not supported by any backend", instruction.offset,
                                    capability_name(instruction.operand(0))),
                        "Write the shader without it; docs/writing-shaders.md lists what shaders can use.");
    }

    NACRE_CHECK(TypeSizes().check(words, name));

    const Context context(environment_of(words[1]));
    const Options options;
    spv_const_binary_t binary{words.data(), words.size()};
    Diagnostic diagnostic;
    if (spvValidateWithOptions(context.handle, options.handle, &binary, &diagnostic.handle) == SPV_SUCCESS) {
        valid_modules().add(hash);
        return {};
    }

    // A failure of the binary parser names a word, one of the rules names an instruction: ask the parser alone.
    Diagnostic parse_diagnostic;
    std::size_t offset = 0;
    const char* text = diagnostic.handle ? diagnostic.handle->error : "";
    if (spvBinaryParse(context.handle, nullptr, words.data(), words.size(), nullptr, nullptr,
                       &parse_diagnostic.handle) != SPV_SUCCESS) {
        if (parse_diagnostic.handle) {
            offset = parse_diagnostic.handle->position.index;
            text = parse_diagnostic.handle->error;
        }
    } else if (diagnostic.handle && diagnostic.handle->position.index != 0) {
        offset = offset_of_instruction(words, diagnostic.handle->position.index);
    }
    const std::string line = source_line(words, offset);
    return broken(name, fmt::format("word {}{}: {}", offset, line.empty() ? "" : fmt::format(" ({})", line), text));
}

std::string capability_name(std::uint32_t capability) {
    const CapabilityInfo* found = find_capability(capability);
    return found ? std::string(found->name) : fmt::format("number {}", capability);
}

std::string source_line(std::span<const std::uint32_t> words, std::size_t word_offset) {
    std::uint32_t file = 0, line = 0;
    for (const Instruction& instruction : instructions(words)) {
        if (instruction.offset > word_offset) break;
        const auto opcode = static_cast<spv::Op>(instruction.opcode());
        if (opcode == spv::Op::OpLine) file = instruction.operand(0), line = instruction.operand(1);
        if (opcode == spv::Op::OpNoLine || opcode == spv::Op::OpFunctionEnd) line = 0;
    }
    if (line == 0) return {};
    for (const Instruction& instruction : instructions(words))
        if (instruction.opcode() == static_cast<std::uint32_t>(spv::Op::OpString) && instruction.operand(0) == file)
            return fmt::format("{}:{}", instruction.text(1), line);
    return {};
}

}  // namespace nacre::rhi::spirv
