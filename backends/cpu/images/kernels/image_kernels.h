// SPDX-License-Identifier: Apache-2.0
// The functions that compiled shaders call, for one instruction set. Included once for each (see image_kernels_*.cpp).
#pragma once

#include "backends/cpu/images/image_atomics.h"
#include "backends/cpu/images/kernels/sampling.h"
#include "backends/cpu/images/kernels/texel_access.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

template <int W>
NACRE_INLINE void run(const Invocation& call) {
    const auto operation = static_cast<ImageOperation>(call.flags & image_operation_mask);
    if (operation != ImageOperation::store && (call.live == 0 || call.image == nullptr)) return write_zeros<W>(call);
    switch (operation) {
        case ImageOperation::fetch: read_texels<W>(call, true); break;
        case ImageOperation::load: read_texels<W>(call, false); break;
        case ImageOperation::sample: sample_image<W>(call); break;
        case ImageOperation::gather: gather_image<W>(call); break;
        case ImageOperation::query_lod: query_level_of_detail<W>(call); break;
        case ImageOperation::store:
            if (call.live != 0 && call.image != nullptr) store_texels<W>(call);
            break;
        default: write_zeros<W>(call); break;
    }
}

/// `N` lanes in steps of `W`, the width of the machine's registers. Quads are never torn apart.
template <int N, int W>
void image_function(const ImageView* image, const SamplerState* sampler, ImageArguments* arguments, std::uint32_t flags,
                    std::uint32_t live) {
    static_assert(N % W == 0 && W % 4 == 0);
    live &= N == 32 ? ~0u : (1u << N) - 1;
    if (static_cast<ImageOperation>(flags & image_operation_mask) == ImageOperation::atomic) {
        return image_atomic(image, arguments, flags, live, N);
    }
    for (int first = 0; first < N; first += W) {
        run<W>({image, sampler, arguments, flags, (live >> first) & all_lanes<W>, first});
    }
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
