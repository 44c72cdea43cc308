// SPDX-License-Identifier: Apache-2.0
// The command `nacre`: devices, render, compare, diff, explain, material, stability, demo, cache, completion. See
// `nacre --help`.
#include <fmt/format.h>

#include <cstdio>
#include <exception>

#include "samples/nacre/commands.h"

int main(int argc, char** argv) {
    using namespace nacre::command;
    try {
        const auto parsed = parse_command_line(argc, argv);
        if (const int* exit_code = std::get_if<int>(&parsed)) return *exit_code;
        const Outcome outcome =
            std::visit([](const auto& arguments) { return run(arguments); }, std::get<Invocation>(parsed));
        if (outcome) return static_cast<int>(*outcome);
        fmt::print(stderr, "nacre: {}\n", outcome.error().error.message());
        return static_cast<int>(outcome.error().code);
    } catch (const std::exception& error) {
        fmt::print(stderr, "nacre: {}\n", error.what());
        return static_cast<int>(ExitCode::failure);
    }
}
