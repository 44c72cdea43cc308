// SPDX-License-Identifier: Apache-2.0
#include "core/file.h"
#include "core/hash.h"

#include <iostream>

int main() {
    const auto text = nacre::read_text_file("/proc/version");
    std::cout << (text ? nacre::hash128(*text).to_string() : text.error().message()) << "\nnacre works\n";
}
