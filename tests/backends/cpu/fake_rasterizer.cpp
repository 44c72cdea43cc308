// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/fake_rasterizer.h"

#include <cstring>

namespace nacre::cpu {

std::function<void(const RenderTargets&, const FakeDraw&)> FakeRaster::paint;
std::vector<FakeDraw> FakeRaster::draws;
std::vector<RenderTargets> FakeRaster::passes;

void FakeRaster::forget() {
    paint = nullptr;
    draws.clear();
    passes.clear();
}

struct Rasterizer::State {
    std::vector<FakeDraw> collected;
    RenderTargets targets;
    std::uint64_t passed = 0;

    void carry_out() {
        for (FakeDraw& draw : collected) {
            draw.push_constants.assign(draw.state.context.push_constants,
                                       draw.state.context.push_constants + push_constant_capacity);
            if (FakeRaster::paint) FakeRaster::paint(targets, draw);
            passed += std::uint64_t{draw.call.count} * draw.call.instance_count;
            FakeRaster::draws.push_back(draw);
        }
        collected.clear();
    }
};

namespace {

void fill(const ImageLevel& level, const RenderTargets& targets, const std::byte* texel, std::size_t texel_bytes) {
    for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
        for (std::uint32_t y = 0; y < targets.height; ++y)
            for (std::uint32_t x = 0; x < targets.width; ++x)
                std::memcpy(level.data + sample * level.sample_stride + std::size_t{y} * level.row_stride +
                                x * texel_bytes,
                            texel, texel_bytes);
}

}  // namespace

Rasterizer::Rasterizer(Scheduler&, std::uint32_t, const RasterizerOptions&) : state_(std::make_unique<State>()) {}
Rasterizer::~Rasterizer() = default;

void Rasterizer::begin_pass(const RenderTargets& targets) {
    state_->targets = targets;
    state_->passed = 0;
    for (std::size_t i = 0; i < targets.color_clears.size(); ++i)
        if (targets.color_clears[i])
            fill(targets.colors[i].levels[0], targets, targets.color_clears[i]->data(), targets.colors[i].texel_bytes);
    const ImageView& depth = targets.depth_stencil;
    if (targets.depth_clear) fill(depth.levels[0], targets, targets.depth_clear->data(), depth.texel_bytes);
    if (targets.stencil_clear && depth.stencil_levels[0].data) {
        const auto stencil = static_cast<std::byte>(*targets.stencil_clear);
        fill(depth.stencil_levels[0], targets, &stencil, 1);
    }
    FakeRaster::passes.push_back(targets);
}
void Rasterizer::draw(const DrawState& state, const DrawCall& call) { state_->collected.push_back({state, call, {}}); }
void Rasterizer::end_pass() { state_->carry_out(); }
std::uint64_t Rasterizer::passed_samples() {
    state_->carry_out();
    return state_->passed;
}

}  // namespace nacre::cpu
