// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/query_pool.h"

#include <fmt/format.h>

namespace nacre::gl {

Expected<std::unique_ptr<rhi::BackendQueryPool>> GlQueryPool::create(const DriverPointer& driver,
                                                                     const rhi::QueryPoolDesc& desc) {
    if (desc.type == rhi::QueryType::timestamp && !driver->traits.timer)
        return fail(ErrorCode::unsupported, "create query pool", fmt::format("'{}'", desc.name),
                    "this OpenGL ES has no timestamps", "Ask Capabilities::timestamps.");
    auto pool = std::make_unique<GlQueryPool>(driver);
    pool->desc = desc;
    pool->names_.resize(desc.count);
    driver->worker->run([&] { driver->gl.GenQueries(static_cast<GLsizei>(desc.count), pool->names_.data()); });
    return pool;
}

GlQueryPool::~GlQueryPool() {
    driver_->worker->post([driver = driver_.get(), names = std::move(names_)] {
        driver->gl.DeleteQueries(static_cast<GLsizei>(names.size()), names.data());
    });
}

GLenum GlQueryPool::occlusion_target() const {
    return driver_->traits.desktop ? GL_SAMPLES_PASSED : GL_ANY_SAMPLES_PASSED;
}

void GlQueryPool::write_timestamp(std::uint32_t index) { driver_->gl.QueryCounter(names_[index], GL_TIMESTAMP); }
void GlQueryPool::begin(std::uint32_t index) { driver_->gl.BeginQuery(occlusion_target(), names_[index]); }
void GlQueryPool::end() { driver_->gl.EndQuery(occlusion_target()); }

std::vector<std::uint64_t> GlQueryPool::read(std::uint32_t first, std::uint32_t count) {
    return driver_->worker->run([&] {
        std::vector<std::uint64_t> values(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            const GLuint name = names_[first + i];
            if (driver_->traits.timer) {
                GLuint64 value = 0;
                driver_->gl.GetQueryObjectui64v(name, GL_QUERY_RESULT, &value);
                values[i] = value;
            } else {
                GLuint value = 0;
                driver_->gl.GetQueryObjectuiv(name, GL_QUERY_RESULT, &value);
                values[i] = value;
            }
        }
        return values;
    });
}

}  // namespace nacre::gl
