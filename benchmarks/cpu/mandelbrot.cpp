// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "benchmarks/cpu/bench.h"

/// @file
/// Divergent loops: a picture of the Mandelbrot set with up to 1000 steps.

namespace nacre::bench {
namespace {

struct Picture {
    rhi::Device* device;
    Kernel kernel;
    rhi::Buffer steps;

    [[nodiscard]] Expected<double> run() const {
        return time_submission(*device, [&](rhi::CommandList& list) {
            list.set_pipeline(kernel.pipeline);
            list.set_bind_group(0, kernel.group);
            list.dispatch({.x = picture_width / 8, .y = picture_height / 8});
        });
    }
    /// The number of steps over all pixels, which differs a little between roundings.
    [[nodiscard]] Expected<double> total() const {
        NACRE_TRY(const auto bytes, device->read_buffer(steps));
        double sum = 0;
        for (std::size_t i = 0; i < bytes.size(); i += 4) {
            std::uint32_t value = 0;
            std::memcpy(&value, bytes.data() + i, 4);
            sum += value;
        }
        return sum;
    }
};

Expected<Picture> make_picture(Bench& bench, const std::string& spec) {
    Picture picture;
    NACRE_TRY(picture.device, bench.device(spec));
    NACRE_TRY(picture.steps, picture.device->create_buffer({.size = std::uint64_t{4} * picture_width * picture_height,
                                                            .usage = rhi::BufferUsage::storage,
                                                            .name = "steps"}));
    NACRE_TRY(picture.kernel, make_kernel(*picture.device, "benchmarks/cpu/mandelbrot.comp",
                                          {{.binding = 0, .buffer = picture.steps}}));
    return picture;
}

}  // namespace

Expected<void> run_mandelbrot(Bench& bench) {
    Case work{.name = "mandelbrot", .target = 2.0};
    if (!bench.has_device("vulkan")) return {};
    NACRE_TRY(const Picture reference, make_picture(bench, "vulkan"));
    work.references.push_back({.name = "vulkan", .run = [reference] { return reference.run(); }});
    std::vector<Picture> pictures;
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(const Picture picture, make_picture(bench, cpu_spec(lanes)));
        pictures.push_back(picture);
        work.cpu.push_back({.name = "cpu", .lanes = lanes, .run = [picture] { return picture.run(); }});
    }
    NACRE_CHECK(bench.measure(std::move(work)));
    NACRE_TRY(const double expected, reference.total());
    for (const Picture& picture : pictures) {
        NACRE_TRY(const double found, picture.total());
        if (found < 0.99 * expected || found > 1.01 * expected)
            return fail(ErrorCode::internal, "compare", "mandelbrot", "the sides did not do the same work",
                        "Look at the two pictures: one of the compilers is wrong.");
    }
    return {};
}

}  // namespace nacre::bench
