// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/fake_rasterizer.h"

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

Rasterizer::Rasterizer(Scheduler&, std::uint32_t, const RasterizerOptions&) : state_(std::make_unique<State>()) {}
Rasterizer::~Rasterizer() = default;

void Rasterizer::begin_pass(const RenderTargets& targets) {
    state_->targets = targets;
    state_->passed = 0;
    FakeRaster::passes.push_back(targets);
}
void Rasterizer::draw(const DrawState& state, const DrawCall& call) { state_->collected.push_back({state, call, {}}); }
void Rasterizer::end_pass() { state_->carry_out(); }
std::uint64_t Rasterizer::passed_samples() {
    state_->carry_out();
    return state_->passed;
}

}  // namespace nacre::cpu
