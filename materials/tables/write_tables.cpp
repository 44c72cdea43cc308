// SPDX-License-Identifier: Apache-2.0
/// @file
/// Writes the data of one table to standard output; run by hand when its generator changes:
///
///     build/bin/write_tables interface > materials/tables/interface_table_data.inc

#include <cmath>
#include <cstdio>
#include <string_view>
#include <vector>

#include "materials/tables/anisotropy_table_generator.h"
#include "materials/tables/interface_table_generator.h"
#include "materials/tables/medium_table_generator.h"

namespace {

/// Words as hexadecimal numbers, 16 a line.
class WordWriter {
  public:
    void write(double value) {
        const long word = std::lround(std::fmin(std::fmax(value, 0.0), 1.0) * 65535.0);
        std::printf("0x%04lx,%s", word, ++count_ % 16 == 0 ? "\n" : "");
    }

  private:
    long count_ = 0;
};

void write_interface_table() {
    using namespace nacre::materials;
    WordWriter words;
    for (std::uint32_t row = 0; row < interface_table_rows; ++row) {
        for (std::uint32_t column = 0; column < interface_table_columns; ++column) {
            for (const double value : interface_table_entry(row, column, 256)) words.write(value);
        }
    }
}

void write_medium_table() {
    using namespace nacre::materials;
    WordWriter words;
    for (std::uint32_t slice = 0; slice < medium_table_slices; ++slice)
        for (const double value : medium_table_slice(slice)) words.write(value);
    std::puts("");
}

void write_anisotropy_table() {
    using namespace nacre::materials;
    const auto& size = anisotropy_table_size;
    const auto number_of = [&](const AnisotropyIndex& at) {
        return at[0] + size[0] * (at[1] + size[1] * (at[2] + size[2] * at[3]));
    };
    const auto index_of = [&](std::uint32_t i) {
        const std::uint32_t above = i / size[0], higher = above / size[1];
        return AnisotropyIndex{i % size[0], above % size[1], higher % size[2], higher / size[2]};
    };
    std::vector<std::array<double, 2>> samples(std::size_t{size[0]} * size[1] * size[2] * size[3]);
    for (std::uint32_t i = 0; i < samples.size(); ++i) samples[i] = anisotropy_table_sample(index_of(i), 96);
    WordWriter words;
    for (std::uint32_t i = 0; i < samples.size(); ++i) {
        const auto sample = [&](const AnisotropyIndex& at) { return samples[number_of(at)]; };
        for (const double value : anisotropy_table_entry(index_of(i), sample)) words.write(value);
    }
    std::puts("");
}

}  // namespace

int main(int count, char** arguments) {
    const std::string_view name = count == 2 ? arguments[1] : "";
    std::puts("// SPDX-License-Identifier: Apache-2.0\n// Written by materials/tables/write_tables.cpp.");
    if (name == "interface") {
        write_interface_table();
    } else if (name == "medium") {
        write_medium_table();
    } else if (name == "anisotropy") {
        write_anisotropy_table();
    } else {
        std::fputs("write_tables: name one table: interface, medium, anisotropy (which reads the first)\n", stderr);
        return 2;
    }
}
