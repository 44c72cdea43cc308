// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/provoking_vertex.h"

#include <algorithm>
#include <array>

namespace nacre::gl {
namespace {

constexpr const char* source = R"(#version 310 es
precision highp int;
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Source { uint words[]; };
layout(std430, binding = 1) writeonly buffer Turned { uint turned[]; };
// Triangles, first, vertex offset, and flags: 1 strip, 2 indexed, 4 32-bit indices.
uniform ivec4 parameters;
int vertex(int at) {
    at += parameters.y;
    if ((parameters.w & 2) == 0) return at;
    if ((parameters.w & 4) != 0) return int(words[at]) + parameters.z;
    return int((words[at >> 1] >> uint((at & 1) * 16)) & 0xffffu) + parameters.z;
}
void main() {
    int triangle = int(gl_GlobalInvocationID.y * gl_NumWorkGroups.x * 64u + gl_GlobalInvocationID.x);
    if (triangle >= parameters.x) return;
    bool strip = (parameters.w & 1) != 0;
    int odd = strip ? triangle & 1 : 0;
    int corner = strip ? triangle : triangle * 3;
    turned[triangle * 3] = uint(vertex(corner + 1 + odd));
    turned[triangle * 3 + 1] = uint(vertex(corner + 2 - odd));
    turned[triangle * 3 + 2] = uint(vertex(corner));
})";

}  // namespace

GLuint ProvokingVertex::program() {
    if (program_) return program_;
    const GLuint shader = gl_.CreateShader(GL_COMPUTE_SHADER);
    const char* text = source;
    gl_.ShaderSource(shader, 1, &text, nullptr);
    gl_.CompileShader(shader);
    program_ = gl_.CreateProgram();
    gl_.AttachShader(program_, shader);
    gl_.DeleteShader(shader);
    gl_.LinkProgram(program_);
    parameters_ = gl_.GetUniformLocation(program_, "parameters");
    gl_.GenBuffers(1, &turned_);
    return program_;
}

std::uint32_t ProvokingVertex::turn(const Draw& draw) {
    const std::uint32_t triangles = draw.strip ? (draw.count < 3 ? 0 : draw.count - 2) : draw.count / 3;
    if (triangles == 0) return 0;
    const GLuint name = program();
    if (driver_.bound.program != name) gl_.UseProgram(driver_.bound.program = name);
    gl_.BindBuffer(GL_COPY_WRITE_BUFFER, turned_);
    gl_.BufferData(GL_COPY_WRITE_BUFFER, static_cast<GLsizeiptr>(triangles) * 12, nullptr, GL_STREAM_COPY);
    // Every declared block needs a buffer, also where no index is read.
    gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, draw.indices ? draw.indices->name : turned_);
    gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, turned_);
    driver_.bound.storage_buffers[0] = driver_.bound.storage_buffers[1] = {};
    const std::array<GLint, 4> parameters{
        static_cast<GLint>(triangles), static_cast<GLint>(draw.first), draw.vertex_offset,
        (draw.strip ? 1 : 0) | (draw.indices ? 2 : 0) | (draw.wide_indices ? 4 : 0)};
    gl_.Uniform4iv(parameters_, 1, parameters.data());
    const std::uint32_t groups = (triangles + 63) / 64, columns = std::min(groups, 32768u);
    gl_.DispatchCompute(columns, (groups + columns - 1) / columns, 1);
    gl_.MemoryBarrier(GL_ELEMENT_ARRAY_BARRIER_BIT);
    return triangles * 3;
}

void ProvokingVertex::destroy() {
    if (program_) gl_.DeleteProgram(program_);
    if (turned_) gl_.DeleteBuffers(1, &turned_);
}

}  // namespace nacre::gl
