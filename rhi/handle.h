// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>

namespace nacre::rhi {

/// Names an object of a `Device`. A handle is a plain value: copying it copies no object, and it owns
/// nothing. Objects live until `Device::destroy` is called on them or their device is destroyed; the
/// memory is freed once the device has finished the work that uses it.
///
/// A handle carries the generation of its slot and the number of its device, so a destroyed object, an
/// object of another device and a default-constructed handle are each recognized and reported.
template <typename Tag>
struct Handle {
    std::uint64_t index : 24 = 0xffffff;
    std::uint64_t generation : 24 = 0;
    std::uint64_t device : 16 = 0;  ///< Number of the device in this process, from 1.

    /// True for a handle that was returned by a device (it may have been destroyed since).
    constexpr explicit operator bool() const { return device != 0; }
    friend constexpr bool operator==(const Handle& a, const Handle& b) {
        return a.index == b.index && a.generation == b.generation && a.device == b.device;
    }
};

using Buffer = Handle<struct BufferTag>;
using Texture = Handle<struct TextureTag>;
using Sampler = Handle<struct SamplerTag>;
using Shader = Handle<struct ShaderTag>;
using BindGroupLayout = Handle<struct BindGroupLayoutTag>;
using BindGroup = Handle<struct BindGroupTag>;
using GraphicsPipeline = Handle<struct GraphicsPipelineTag>;
using ComputePipeline = Handle<struct ComputePipelineTag>;
using QueryPool = Handle<struct QueryPoolTag>;
using AccelerationStructure = Handle<struct AccelerationStructureTag>;

/// Bitwise operators for an `enum class` of flags in this namespace.
#define NACRE_FLAGS(Type)                                                                                        \
    constexpr Type operator|(Type a, Type b) {                                                                   \
        return static_cast<Type>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));                 \
    }                                                                                                            \
    constexpr Type operator&(Type a, Type b) {                                                                   \
        return static_cast<Type>(static_cast<std::uint32_t>(a) & static_cast<std::uint32_t>(b));                 \
    }                                                                                                            \
    constexpr Type operator~(Type a) { return static_cast<Type>(~static_cast<std::uint32_t>(a)); }               \
    constexpr Type& operator|=(Type& a, Type b) { return a = a | b; }                                            \
    constexpr Type& operator&=(Type& a, Type b) { return a = a & b; }                                            \
    /** True when any bit of `b` is in `a`. */                                                                   \
    constexpr bool has_any(Type a, Type b) { return static_cast<std::uint32_t>(a & b) != 0; }                    \
    /** True when all bits of `b` are in `a`. */                                                                 \
    constexpr bool has_all(Type a, Type b) { return (a & b) == b; }

/// Shader stages; combined where a set of stages is meant.
enum class ShaderStage : std::uint32_t { none = 0, vertex = 1, fragment = 2, compute = 4 };
NACRE_FLAGS(ShaderStage)

}  // namespace nacre::rhi
