// SPDX-License-Identifier: Apache-2.0
// Thousands of calls with right, wrong, stale and foreign arguments in any order. Whatever happens is an error or
// works; under the sanitizers nothing else may be seen. The backend checks that what reaches it is possible.
#include <gtest/gtest.h>

#include <random>

#include "tests/rhi/validation_bench.h"

namespace nacre::test {
namespace {

using namespace rhi;

class RandomCalls {
  public:
    RandomCalls(std::uint32_t seed, bool validation)
        : random_(seed), bench_(desc(validation), small_capabilities()), list_(bench_.list()) {
        bench_.device().set_message_callback([this](const Message&) { ++messages_; });
        compute_ = bench_.compute(
            "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer R { uint r[4]; }; layout(set = 0, "
            "binding = 1) uniform sampler2D image; layout(push_constant) uniform P { vec4 p; }; void main() { r[0] = "
            "uint(texelFetch(image, ivec2(0), 0).r + p.x); }");
        graphics_ = bench_.graphics();
        sampler_ = *bench_.device().create_sampler({});
        foreign_ = other_.buffer(BufferUsage::storage);
        buffers_ = {foreign_, Buffer{}};
        textures_ = {Texture{}};
        groups_ = {BindGroup{}};
        pools_ = {QueryPool{}, *bench_.device().create_query_pool({QueryType::timestamp, 4, "times"}),
                  *bench_.device().create_query_pool({QueryType::occlusion, 4, "seen"})};
    }

    void step() {
        switch (pick(26)) {
            case 0:
                keep(buffers_, bench_.device().create_buffer({pick(3) ? pick(2048) : ~0ull >> pick(64),
                                                              static_cast<BufferUsage>(pick(128)),
                                                              static_cast<MemoryKind>(pick(3)), "b"}));
                break;
            case 1: {
                TextureDesc desc;
                desc.dimension = static_cast<TextureDimension>(pick(4));
                desc.format = pick(3) ? Format::rgba8_unorm : static_cast<Format>(pick(format_count));
                desc.width = pick(20), desc.height = pick(20), desc.depth = pick(3), desc.layers = pick(8),
                desc.mips = pick(4);
                desc.samples = pick(5) ? 1 : 4;
                desc.usage = static_cast<TextureUsage>(pick(64));
                keep(textures_, bench_.device().create_texture(desc));
                break;
            }
            case 2:
                keep(groups_, bench_.device().create_bind_group(
                                  {.layout = *bench_.device().bind_group_layout(compute_, 0),
                                   .entries = {{.binding = pick(3),
                                                .buffer = buffer(),
                                                .offset = pick(3) * 128,
                                                .size = pick(2) ? ~0ull : pick(512)},
                                               {.binding = pick(3), .texture = view(), .sampler = sampler_}},
                                   .name = "g"}));
                break;
            case 3:
                if (pick(4) == 0) bench_.device().destroy(buffer());
                break;
            case 4:
                if (pick(4) == 0) bench_.device().destroy(texture());
                break;
            case 5:
                if (pick(4) == 0) bench_.device().destroy(group());
                break;
            case 6:
            case 7: submit(); break;
            case 8:
                list_.begin_render_pass(
                    {.color = {{.view = view(),
                                .load = static_cast<LoadOperation>(pick(3)),
                                .resolve = pick(4) ? TextureView() : view()}},
                     .depth_stencil = {.view = pick(2) ? TextureView() : view(), .read_only = pick(2) == 0}});
                break;
            case 9: list_.end_render_pass(); break;
            case 10: pick(2) ? list_.set_pipeline(compute_) : list_.set_pipeline(graphics_); break;
            case 11: list_.set_bind_group(pick(10) ? 0 : pick(40), group()); break;
            case 12: list_.set_push_constants(std::array<float, 4>{}, pick(4) ? 0 : pick(200)); break;
            case 13: list_.set_vertex_buffer(pick(4) ? 0 : pick(100), buffer(), pick(64)); break;
            case 14: list_.draw({pick(4), pick(3), pick(4), pick(2)}); break;
            case 15: list_.dispatch({pick(3), pick(3), 1}); break;
            case 16: list_.dispatch_indirect(buffer(), pick(64)); break;
            case 17:
                list_.copy_buffer(buffer(), pick(64), buffer(), pick(4) ? pick(64) : ~0ull - pick(8), pick(300));
                break;
            case 18: list_.copy_buffer_to_texture(buffer(), texture(), region()); break;
            case 19: list_.copy_texture_to_buffer(texture(), buffer(), region()); break;
            case 20:
                list_.copy_texture(texture(), texture(),
                                   {.source_mip = pick(3),
                                    .source_layer = pick(4),
                                    .destination_mip = pick(3),
                                    .destination_layer = pick(4),
                                    .extent = {pick(6), pick(6), pick(2)},
                                    .layer_count = pick(3)});
                break;
            case 21: list_.fill_buffer(buffer(), 1, pick(16) * 4, pick(2) ? ~0ull : pick(512)); break;
            case 22: pick(2) ? list_.clear_texture(view(), {}) : list_.clear_depth_stencil(view(), 1.0f); break;
            case 23: list_.write_timestamp(pools_[pick(3)], pick(5)); break;
            case 24: content(); break;
            default: pick(2) ? list_.begin_statement("s", {}) : list_.end_statement(); break;
        }
    }
    void submit() {
        if (pick(3) == 0) list_.end_render_pass();
        accepted_ += bench_.device().submit(std::move(list_)).has_value();
        list_ = bench_.list();
    }
    [[nodiscard]] int accepted() const { return accepted_; }
    [[nodiscard]] int messages() const { return messages_; }

  private:
    static DeviceDesc desc(bool validation) {
        DeviceDesc made;
        made.validation = validation;
        made.verify_statements = true;
        return made;
    }
    static Capabilities small_capabilities() {
        Capabilities made = full_capabilities();
        made.max_buffer_size = 1 << 16;  // Buffers of the null backend have real memory.
        return made;
    }
    std::uint32_t pick(std::uint32_t below) { return random_() % below; }
    template <typename T>
    void keep(std::vector<T>& all, const Expected<T>& made) {
        if (made) all.push_back(*made);
        if (all.size() > 24) all.erase(all.begin() + 2);
    }
    Buffer buffer() { return buffers_[pick(static_cast<std::uint32_t>(buffers_.size()))]; }
    Texture texture() { return textures_[pick(static_cast<std::uint32_t>(textures_.size()))]; }
    BindGroup group() { return groups_[pick(static_cast<std::uint32_t>(groups_.size()))]; }
    TextureView view() {
        TextureView made(texture());
        if (pick(2)) made = TextureView::subresource(made.texture, pick(3), pick(4));
        if (pick(8) == 0) made.dimension = static_cast<ViewDimension>(pick(8));
        if (pick(8) == 0) made.layer_count = pick(9);
        return made;
    }
    BufferTextureCopy region() {
        BufferTextureCopy made;
        made.buffer_offset = pick(4) * 8, made.mip = pick(3), made.layer = pick(4);
        if (pick(2)) made.bytes_per_row = pick(3) ? 64 : pick(100), made.rows_per_slice = pick(16);
        if (pick(2)) made.offset = {pick(6), pick(6), pick(2)}, made.extent = {pick(6), pick(6), pick(2)};
        return made;
    }
    void content() {
        const Buffer target = buffer();
        if (pick(2))
            (void)bench_.device().write_buffer(target, std::vector<std::byte>(pick(300)), pick(300));
        else
            (void)bench_.device().read_buffer(target, pick(300), pick(2) ? ~0ull : pick(300));
        const Texture image = texture();
        if (pick(2)) (void)bench_.device().write_texture(image, std::vector<std::byte>(pick(2048)), pick(3), pick(3));
        if (const auto mapped = bench_.device().map(target)) (void)bench_.device().unmap(target);
    }

    std::mt19937 random_;
    Bench bench_, other_;
    CommandList list_;
    ComputePipeline compute_;
    GraphicsPipeline graphics_;
    Sampler sampler_;
    Buffer foreign_;
    std::vector<Buffer> buffers_;
    std::vector<Texture> textures_;
    std::vector<BindGroup> groups_;
    std::vector<QueryPool> pools_;
    int accepted_ = 0, messages_ = 0;
};

TEST(RandomCalls, AreErrorsOrWork) {
    int accepted = 0, messages = 0;
    for (const bool validation : {true, false})
        for (std::uint32_t seed = 1; seed <= 12; ++seed) {
            RandomCalls calls(seed, validation);
            for (int i = 0; i < 4000; ++i) calls.step();
            accepted += calls.accepted();
            messages += calls.messages();
        }
    EXPECT_GT(accepted, 500);
    EXPECT_GT(messages, 5000);
}

}  // namespace
}  // namespace nacre::test
