// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "backends/cpu/image_view.h"
#include "backends/cpu/shader_interface.h"

/// @file
/// What code that looks for faults and the rest of the backend share. Code without checks holds none of this.

namespace nacre::cpu {

/// What is looked for; several may be.
enum CheckFlags : std::uint32_t {
    check_traps = 1,     ///< Stop at the first number that is none or infinite, division by zero or index out of range.
    check_sanitize = 2,  ///< Uninitialized reads, indices, races, derivatives, births of NaN.
    check_hostile = 4,   ///< Whatever order and whatever content is allowed is the one that hurts most.
};

class CheckedMemory;

/// A place in a shader, as the compiler writes it into the code. Texts end with 0 and may be null.
struct CheckSite {
    const char* shader;
    const char* place;          ///< "passes/lighting/lighting.comp:41"
    const char* object;         ///< Name of a variable, a block or a member.
    std::int32_t set, binding;  ///< -1: nothing that is bound.
};

/// The invocations that run at one time. The code fills it in before the first of them begins.
struct RunningInvocations {
    const ShaderContext* context;
    const void* work;     ///< WorkgroupRange, VertexBatch or FragmentBatch.
    std::uint32_t stage;  ///< rhi::ShaderStage
    std::uint32_t lanes;
    std::uint32_t group_x, subgroup;
    std::uint32_t size[3];   ///< Of a workgroup.
    std::uint32_t barriers;  ///< Workgroup barriers behind them.
    std::uint64_t batch;     ///< Number of the workgroup, or of the batch.
    // The last read of what nothing has written; set by the functions below.
    const CheckSite* undefined_site;
    const CheckedMemory* undefined_memory;
    std::uint64_t undefined_lanes;
};

enum MemoryAccess : std::uint32_t {
    access_read = 1,
    access_write = 2,
    access_atomic = 4,
    access_shared = 8,      ///< Others may write there meanwhile: races are looked for.
    access_workgroup = 16,  ///< Memory of the workgroup; no descriptors.
    access_vertex = 32,     ///< The vertex buffer whose number is the site's binding; no descriptors.
};

/// Beside ImageFlags: invocations agree on their own who uses a texel when.
inline constexpr std::uint32_t image_unshared = 1u << 31;

/// Texels of a color target that blending is about to read, in sixteen lanes.
struct BlendedTexels {
    std::uint32_t target;  ///< Number of the color target in its pass.
    std::uint32_t sample;
    const std::int32_t *x, *y;            ///< Left upper pixel of each quad of lanes, as in FragmentBatch.
    const std::uint32_t (*words)[max_lanes];  ///< For each 32-bit word of a texel those of all lanes.
    std::uint32_t lanes;                  ///< One bit for each that counts.
};
using BlendCheck = void (*)(const CommandChecks*, const BlendedTexels&);

}  // namespace nacre::cpu

// Functions that checked code calls. `lanes` has one bit for each lane that counts. Arrays have max_lanes elements.
extern "C" {
/// Fills in RunningInvocations::batch, where batches have no number of their own.
using NacreCpuCheckBegin = void (*)(nacre::cpu::RunningInvocations*);
/// A workgroup begins: its memory is undefined again. `bytes` of variables.
using NacreCpuCheckWorkgroup = void (*)(const nacre::cpu::ShaderContext*, std::byte* memory, std::uint64_t bytes);
/// A fault of the kind (rhi::ShaderFault) in these lanes. `descriptor`, `found` and `limit` may be null.
using NacreCpuCheckFault = void (*)(const nacre::cpu::RunningInvocations*, const nacre::cpu::CheckSite*,
                                    std::uint32_t kind, std::uint32_t lanes, const nacre::cpu::Descriptor* descriptor,
                                    const std::int64_t* found, const std::int64_t* limit);
/// An access to memory; returns the lanes that read what is undefined. `undefined`: lanes that write what is.
using NacreCpuCheckMemory = std::uint32_t (*)(nacre::cpu::RunningInvocations*, const nacre::cpu::CheckSite*,
                                              const nacre::cpu::Descriptor* const* descriptors,
                                              std::byte* const* addresses, std::uint32_t bytes, std::uint32_t access,
                                              std::uint32_t lanes, std::uint32_t undefined);
/// A read of an input of a fragment shader that is undefined in these lanes.
using NacreCpuCheckInput = void (*)(nacre::cpu::RunningInvocations*, const nacre::cpu::CheckSite*, std::uint32_t lanes);
/// An access to an image, before it is made; returns the lanes that read what is undefined.
using NacreCpuCheckImage = std::uint32_t (*)(nacre::cpu::RunningInvocations*, const nacre::cpu::CheckSite*,
                                             const nacre::cpu::Descriptor* image, const nacre::cpu::Descriptor* sampler,
                                             nacre::cpu::ImageArguments*, std::uint32_t flags, std::uint32_t lanes);
}
