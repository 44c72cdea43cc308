// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/gl/buffer.h"

/// @file
/// `flat` values come from the first vertex of a triangle in Vulkan and from the last one in OpenGL ES, which has no
/// switch for it. Triangles of pipelines that read flat values are drawn with their corners turned by one place: the
/// same triangle, the same winding, the other last vertex. A compute shader writes the indices; indirect draws, whose
/// counts the host does not know, keep OpenGL's rule.

namespace nacre::gl {

class ProvokingVertex {
  public:
    explicit ProvokingVertex(Driver& driver) : driver_(driver), gl_(driver.gl) {}
    void destroy();

    struct Draw {
        bool strip = false;
        std::uint32_t count = 0;         ///< Vertices or indices.
        std::uint32_t first = 0;         ///< First vertex, or first index counted from the begin of the buffer.
        std::int32_t vertex_offset = 0;  ///< Added to each index.
        const GlBuffer* indices = nullptr;
        bool wide_indices = false;       ///< 32 bits.
    };
    /// Writes 32-bit indices of a triangle list. Changes program and storage buffers 0 and 1.
    /// @return number of indices; 0 where nothing is to be drawn
    std::uint32_t turn(const Draw& draw);
    /// The buffer that `turn` wrote.
    [[nodiscard]] GLuint indices() const { return turned_; }

  private:
    GLuint program();

    Driver& driver_;
    const Functions& gl_;
    GLuint program_ = 0, turned_ = 0;
    GLint parameters_ = -1;
};

}  // namespace nacre::gl
