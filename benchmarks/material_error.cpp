// SPDX-License-Identifier: Apache-2.0
/// @file
/// How far layered closures are off what a random walk through the same stack says (materials/random_walk.h), for the
/// stacks of materials/reference_stacks.h:
///
///     material_error_benchmark [--paths N] [--stacks N] [--ball SIZE] [--ball-paths N] [--ball-strata N]
///                              [--json FILE] [--pictures FOLDER]
///
/// Prints a table: error of the directional albedo (mean and largest over channels and view angles) and FLIP between
/// the lit balls. FOLDER gets the balls side by side: closures, walk, difference times four. Exit status 1 where one of
/// the five stacks that authors use most is off by 0.03 or more.

#include <algorithm>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "materials/layering_error.h"
#include "materials/preview.h"
#include "materials/random_walk.h"
#include "materials/reference_stacks.h"
#include "measure/flip.h"

namespace {

using namespace nacre;
using namespace nacre::materials;

Image side_by_side(const Image& closures, const Image& walk) {
    Image image{.width = 3 * closures.width, .height = closures.height, .channels = 3};
    image.pixels.resize(std::size_t{3} * image.width * image.height);
    for (std::uint32_t y = 0; y < closures.height; ++y) {
        for (std::uint32_t x = 0; x < closures.width; ++x) {
            for (int channel = 0; channel < 3; ++channel) {
                const float a = closures.texel(x, y)[channel], b = walk.texel(x, y)[channel];
                image.texel(x, y)[channel] = a;
                image.texel(x + closures.width, y)[channel] = b;
                image.texel(x + 2 * closures.width, y)[channel] = std::min(4.0f * std::abs(a - b), 1.0f);
            }
        }
    }
    return image;
}

std::string file_name(std::string name) {
    std::ranges::replace_if(
        name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '-');
    return name + ".png";
}

}  // namespace

int main(int count, char** arguments) {
    std::uint32_t paths = 65536, random_stacks = 48, ball = 128, ball_paths = 16384, ball_strata = 16;
    std::string json, pictures;
    CLI::App app("Layered closures against a random walk through the stack.");
    app.add_option("--paths", paths, "Paths for each view angle");
    app.add_option("--stacks", random_stacks, "Random stacks beside the five");
    app.add_option("--ball", ball, "Pixels of the balls' side; 0: none");
    app.add_option("--ball-paths", ball_paths, "Paths for each angle on a ball");
    app.add_option("--ball-strata", ball_strata, "Squared: directions by which a closure's pixel is lit");
    app.add_option("--json", json, "File for all figures");
    app.add_option("--pictures", pictures, "Folder for the balls");
    CLI11_PARSE(app, count, arguments);
    if (!pictures.empty()) std::filesystem::create_directories(pictures);

    std::vector<Tree> stacks = reference_stacks();
    const std::size_t named = stacks.size();
    for (std::uint32_t i = 0; i < random_stacks; ++i) stacks.push_back(random_stack(i));
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    bool is_close = true;
    double sum_of_means = 0.0, sum_of_flips = 0.0;
    std::printf("%-52s %8s %8s %5s %8s %8s\n", "stack", "mean", "largest", "at", "+-", "FLIP");
    for (std::size_t i = 0; i < stacks.size(); ++i) {
        const auto flat = flatten(stacks[i]);
        if (!flat) {
            std::fprintf(stderr, "%s\n", flat.error().message().c_str());
            return 2;
        }
        const RandomWalk walk(*flat);
        const LayeringError error = layering_error(*flat, walk, paths);
        double flip = 0.0;
        if (ball > 0) {
            const Image closures = preview_ball(*flat, ball, static_cast<int>(ball_strata));
            const Image walked = walked_ball(walk, ball, ball_paths);
            flip = measure::compute_flip(walked, closures)->mean;
            if (!pictures.empty()) {
                const auto file = std::filesystem::path(pictures) / file_name(stacks[i].name);
                if (!write_png(file.string(), side_by_side(closures, walked))) return 2;
            }
        }
        sum_of_means += error.mean;
        sum_of_flips += flip;
        if (i < named) is_close = is_close && error.mean < 0.03 && flip < 0.03;
        std::printf("%-52s %8.4f %8.4f %5.2f %8.4f %8.4f\n", stacks[i].name.c_str(), error.mean, error.largest,
                    error.largest_at, error.uncertainty, flip);
        std::fflush(stdout);
        rows.push_back({{"name", stacks[i].name},
                        {"albedo_error", error.mean},
                        {"largest", error.largest},
                        {"at_cosine", error.largest_at},
                        {"uncertainty", error.uncertainty},
                        {"flip", flip}});
    }
    std::printf("%-52s %8.4f %31s %8.4f\n", "mean of all", sum_of_means / static_cast<double>(stacks.size()), "",
                sum_of_flips / static_cast<double>(stacks.size()));
    if (!json.empty())
        std::ofstream(json) << nlohmann::ordered_json{{"paths", paths}, {"stacks", rows}}.dump(2) << '\n';
    return is_close ? 0 : 1;
}
