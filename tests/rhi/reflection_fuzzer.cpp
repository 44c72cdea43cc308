// SPDX-License-Identifier: Apache-2.0
// Any words are a module or an error, never a crash, and never take all memory or time.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "rhi/reflection.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nacre::rhi;
    std::vector<std::uint32_t> words(size / 4);
    if (!words.empty()) std::memcpy(words.data(), data, words.size() * 4);
    for (const ShaderStage stage : {ShaderStage::vertex, ShaderStage::fragment, ShaderStage::compute}) {
        const auto reflection = reflect(words, stage, "main", "input");
        if (reflection && reflection->stage != stage) std::abort();
        if (!reflection && reflection.error().message().empty()) std::abort();
    }
    return 0;
}
