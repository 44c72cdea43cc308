// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/gl/driver.h"

namespace nacre::gl {

/// A sampler object. Border colors exist twice: OpenGL keeps floating and integer colors apart, and which one counts
/// depends on the texture.
class GlSampler : public rhi::BackendSampler {
  public:
    explicit GlSampler(DriverPointer driver) : driver_(std::move(driver)) {}
    ~GlSampler() override;

    /// Errors: unsupported where this OpenGL ES has no border colors or no bias.
    static Expected<std::unique_ptr<rhi::BackendSampler>> create(const DriverPointer& driver,
                                                                 const rhi::SamplerDesc& desc);

    GLuint name = 0;
    GLuint integer_name = 0;  ///< For integer textures; `name` where the border does not matter.
    ObjectId id = 0, integer_id = 0;

  private:
    DriverPointer driver_;
};

}  // namespace nacre::gl
