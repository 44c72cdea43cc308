// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "backends/gl/context.h"
#include "backends/gl/traits.h"
#include "backends/gl/worker.h"
#include "rhi/backend.h"

/// @file
/// What all objects of one device share: the functions, the context's thread, and what is bound in the context.

namespace nacre::gl {

/// Objects are told apart by numbers that are never used again; OpenGL's names are, as soon as an object is deleted.
using ObjectId = std::uint64_t;

/// What is bound in the context, so that nothing is bound twice. Used on the worker thread only.
struct BoundState {
    struct BufferRange {
        ObjectId id = 0;
        std::uint64_t offset = 0, size = 0;
        friend bool operator==(const BufferRange&, const BufferRange&) = default;
    };
    struct Image {
        ObjectId id = 0;
        std::uint32_t level = 0, layer = 0;
        bool layered = false;
        GLenum access = 0, format = 0;
        friend bool operator==(const Image&, const Image&) = default;
    };
    GLuint program = 0, vertex_array = 0, draw_framebuffer = 0;
    std::vector<BufferRange> uniform_buffers, storage_buffers;
    std::vector<ObjectId> textures, samplers;
    std::vector<Image> images;
    GLuint active_unit = 0;
    ObjectId raster_state = 0;   ///< Pipeline whose fixed-function state is set; 0: unknown.
    ObjectId indirect_buffer = 0;
    bool scissor_test = false;
};

class Driver {
  public:
    Driver(std::unique_ptr<Context> context_in, std::function<void(const rhi::Message&)> report_in)
        : context(std::move(context_in)), report(std::move(report_in)) {}
    /// Runs what is queued, then lets go of the context.
    ~Driver();

    std::unique_ptr<Context> context;
    std::function<void(const rhi::Message&)> report;
    Functions gl;
    Traits traits;
    rhi::FaultInjection faults;
    bool debug_names = false;
    std::atomic<bool> lost{false};
    std::atomic<std::uint64_t> reserved_bytes{0};
    std::atomic<std::uint32_t> allocations{0};

    // Below: worker thread only.
    BoundState bound;
    GLuint scratch_unit = 0;     ///< Texture unit for creating and copying textures; never a pipeline's.
    GLuint scratch_framebuffers[2]{};  ///< For reading and drawing in copies.
    GLuint nearest_sampler = 0;  ///< For textures that are only fetched from.
    std::uint64_t serial = 0;    ///< Number of the submission being executed.

    [[nodiscard]] ObjectId next_id() { return ++last_id_; }

    /// Counts an allocation; true when the planted fault makes it fail.
    bool allocation_fails() { return ++allocation_count_ == faults.fail_allocation; }

    /// Forgets errors of earlier calls, then tells the error of `call`.
    template <typename Call>
    GLenum error_of(Call&& call) {
        while (gl.GetError() != GL_NO_ERROR && !lost) {}
        call();
        return gl.GetError();
    }

    /// Binds a texture for creation or transfer; leaves the pipelines' units alone.
    void bind_scratch_texture(GLenum target, GLuint name) {
        select_unit(scratch_unit);
        gl.BindTexture(target, name);
    }
    void select_unit(GLuint unit) {
        if (bound.active_unit == unit) return;
        gl.ActiveTexture(GL_TEXTURE0 + unit);
        bound.active_unit = unit;
    }

    void warn(rhi::MessageSeverity severity, std::string code, std::string text) const {
        if (report) report({severity, rhi::MessageSource::driver, std::move(code), std::move(text)});
    }
    void label(GLenum kind, GLuint name, const std::string& text) const;

    /// Framebuffers by what is attached; an entry goes when one of its textures does.
    struct FramebufferKey {
        struct Attachment {
            ObjectId texture = 0;
            GLuint name = 0;
            GLenum target = 0;
            std::uint32_t mip = 0, layer = 0;
            friend bool operator==(const Attachment&, const Attachment&) = default;
        };
        std::array<Attachment, 8> colors{};
        Attachment depth_stencil{};
        GLenum depth_point = 0;
        std::uint32_t color_count = 0;
        friend bool operator==(const FramebufferKey&, const FramebufferKey&) = default;
    };
    GLuint framebuffer(const FramebufferKey& key);
    void attach(GLenum target, GLenum point, const FramebufferKey::Attachment& attachment) const;
    void forget_texture(ObjectId id);
    void bind_draw_framebuffer(GLuint name) {
        if (bound.draw_framebuffer == name) return;
        gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, name);
        bound.draw_framebuffer = name;
    }

    /// Lets clears through: all masks open, no scissor. The next draw sets its pipeline's state again.
    void open_masks();
    /// Clears one color target of the bound framebuffer.
    void clear_color(GLint index, rhi::Format format, const rhi::ClearColor& color) const;

    /// Starts the thread's state; the context is current.
    void prepare();

    /// The context's thread; made last and ended first, since its tasks use everything above.
    std::unique_ptr<Worker> worker;

  private:
    struct KeyHash {
        std::size_t operator()(const FramebufferKey& key) const;
    };
    std::unordered_map<FramebufferKey, GLuint, KeyHash> framebuffers_;
    std::atomic<ObjectId> last_id_{0};
    std::uint64_t allocation_count_ = 0;
};

using DriverPointer = std::shared_ptr<Driver>;

}  // namespace nacre::gl
