// SPDX-License-Identifier: Apache-2.0
#include "rhi/device_state.h"

#include <algorithm>

#include "core/log.h"

namespace nacre::rhi {

void MessageSink::set_callback(std::function<void(const Message&)> callback) {
    const std::lock_guard lock(mutex_);
    callback_ = std::move(callback);
}

void MessageSink::send(const Message& message) {
    if (message.severity == MessageSeverity::error) errors_.fetch_add(1, std::memory_order_relaxed);
    const std::lock_guard lock(mutex_);
    if (callback_) {
        callback_(message);
        return;
    }
    const LogLevel level = message.severity == MessageSeverity::error     ? LogLevel::error
                           : message.severity == MessageSeverity::warning ? LogLevel::warning
                                                                          : LogLevel::debug;
    log_message(level, message.code + ": " + message.text);
}

std::unexpected<Error> MessageSink::reject(Problem problem) {
    const std::string code(code_of(problem.rule));
    Error error{problem.code, std::move(problem.attempted), std::move(problem.subject),
                std::move(problem.reason) + " [" + code + "].", std::move(problem.remedy)};
    Message message;
    message.severity = MessageSeverity::error;
    message.source = problem.rule >= Rule::statement_missing ? MessageSource::verify : MessageSource::validation;
    message.code = code;
    message.text = error.message();
    send(message);
    return std::unexpected(std::move(error));
}

std::unique_ptr<CommandStream> StreamPool::take() {
    {
        const std::lock_guard lock(mutex_);
        if (!free_.empty()) {
            std::unique_ptr<CommandStream> stream = std::move(free_.back());
            free_.pop_back();
            return stream;
        }
    }
    return std::make_unique<CommandStream>();
}

void StreamPool::give_back(std::unique_ptr<CommandStream> stream) {
    constexpr std::size_t most_kept = 16;
    constexpr std::size_t most_blocks = 256;
    stream->clear();
    stream->validator.reset();
    stream->pool.reset();
    if (stream->blocks.size() > most_blocks) stream->blocks.resize(most_blocks);
    const std::lock_guard lock(mutex_);
    if (free_.size() < most_kept) free_.push_back(std::move(stream));
}

std::unexpected<Error> DeviceState::lost_error(std::string attempted, std::string subject) const {
    return fail(ErrorCode::device_lost, std::move(attempted), std::move(subject),
                "the device '" + adapter.name + "' was lost", "Destroy it and create a new device.");
}

void DeviceState::note_failure(const Error& error) {
    if (error.code != ErrorCode::device_lost) return;
    if (!lost.exchange(true))
        log_message(LogLevel::error, "device '" + shared->desc.name + "' (" + adapter.backend + ", " + adapter.name +
                                         ") was lost: " + error.message());
}

void DeviceState::retire(std::unique_ptr<BackendObject> object) {
    if (object) retired.push_back({submitted_serial, std::move(object)});
    collect();
}

void DeviceState::collect() {
    if (retired.empty() && staging.empty()) return;
    // A lost device completes nothing any more; its objects may be freed at once.
    const std::uint64_t completed = lost ? ~std::uint64_t{0} : backend->completed_serial();
    while (!retired.empty() && retired.front().serial <= completed) retired.pop_front();
    // Staging memory is used again; at most one idle chunk of the usual size is kept beyond what is in flight.
    bool kept_one = false;
    std::erase_if(staging, [&](StagingChunk& chunk) {
        if (chunk.serial == 0 || chunk.serial > completed) return false;
        if (kept_one || chunk.buffer->desc.size > 4 * 1024 * 1024) return true;
        kept_one = true;
        return false;
    });
}

Expected<DeviceState::Staging> DeviceState::stage_upload(std::uint64_t size) {
    constexpr std::uint64_t chunk_bytes = 256 * 1024;
    constexpr std::uint64_t alignment = 16;
    const std::uint64_t completed = lost ? ~std::uint64_t{0} : backend->completed_serial();
    for (StagingChunk& chunk : staging) {
        if (chunk.serial != 0 && chunk.serial <= completed) chunk.serial = 0, chunk.used = 0;
        if (chunk.serial != 0) continue;
        const std::uint64_t offset = (chunk.used + alignment - 1) / alignment * alignment;
        if (offset > chunk.buffer->desc.size || chunk.buffer->desc.size - offset < size) continue;
        chunk.used = offset + size;
        return Staging{chunk.buffer.get(), offset};
    }
    BufferDesc desc;
    desc.size = std::max(size, chunk_bytes);
    desc.usage = BufferUsage::copy_source | BufferUsage::copy_destination;
    desc.memory = MemoryKind::upload;
    desc.name = "upload staging";
    auto buffer = backend->create_buffer(desc);
    if (!buffer) {
        note_failure(buffer.error());
        return std::unexpected(std::move(buffer).error());
    }
    (*buffer)->desc = desc;
    staging.push_back({std::move(*buffer), size, 0});
    return Staging{staging.back().buffer.get(), 0};
}

Expected<void> DeviceState::wait_for(std::uint64_t serial, std::chrono::nanoseconds timeout) {
    if (lost) return lost_error("wait for device");
    auto waited = backend->wait(serial, timeout);
    if (!waited) {
        note_failure(waited.error());
        return waited;
    }
    return {};
}

}  // namespace nacre::rhi
