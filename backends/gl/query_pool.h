// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "backends/gl/driver.h"

namespace nacre::gl {

/// One query object for each entry.
class GlQueryPool : public rhi::BackendQueryPool {
  public:
    explicit GlQueryPool(DriverPointer driver) : driver_(std::move(driver)) {}
    ~GlQueryPool() override;
    static Expected<std::unique_ptr<rhi::BackendQueryPool>> create(const DriverPointer& driver,
                                                                   const rhi::QueryPoolDesc& desc);
    /// Nanoseconds, samples, or 0 and 1 where OpenGL ES counts no samples.
    std::vector<std::uint64_t> read(std::uint32_t first, std::uint32_t count);

    // Worker thread only.
    void write_timestamp(std::uint32_t index);
    void begin(std::uint32_t index);
    void end();

  private:
    [[nodiscard]] GLenum occlusion_target() const;
    DriverPointer driver_;
    std::vector<GLuint> names_;
};

}  // namespace nacre::gl
