// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "scene/gltf/document.h"
#include "scene/scene.h"

/// @file
/// The pictures of a file: only those that a material uses are decoded, once each, several at a time.
/// Internal to scene/gltf/; functions may throw `Rejected`. Not thread-safe.

namespace nacre::scene::gltf {

class ImageTable {
  public:
    /// Index into the images of the scene for one picture of the file in one color space.
    int use(std::size_t file_image, ColorSpace color_space);

    /// Reads and decodes what was used. A damaged picture is rejected, naming it.
    std::vector<Image> load(Document& document) const;

  private:
    std::map<std::pair<std::size_t, ColorSpace>, int> index_of_;
    std::vector<std::pair<std::size_t, ColorSpace>> used_;
};

}  // namespace nacre::scene::gltf
