// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/watch.h"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <thread>

namespace nacre::command {
namespace {

volatile std::sig_atomic_t is_ended = 0;

void end_watching(int) { is_ended = 1; }

/// While it lives, Ctrl-C ends the watching and not the program, which then ends as ever.
class EndSignals {
  public:
    EndSignals() : interrupt_(std::signal(SIGINT, end_watching)), terminate_(std::signal(SIGTERM, end_watching)) {}
    ~EndSignals() {
        std::signal(SIGINT, interrupt_);
        std::signal(SIGTERM, terminate_);
    }
    EndSignals(const EndSignals&) = delete;
    EndSignals& operator=(const EndSignals&) = delete;

  private:
    void (*interrupt_)(int);
    void (*terminate_)(int);
};

}  // namespace

Expected<void> watch_shaders(passes::Renderer& renderer, const std::string& folder,
                             const std::function<Expected<void>()>& render) {
    const EndSignals signals;
    fmt::print(stderr, "watching the shaders below {}; Ctrl-C ends it\n", folder);
    while (is_ended == 0) {
        bool is_new = false;
        for (const rhi::PipelineReload& reload : renderer.reload_shaders()) {
            is_new |= !reload.error;
            fmt::print(stderr, "{}: {}\n", reload.pipeline, reload.error ? reload.error->message() : "reloaded");
        }
        if (is_new) NACRE_CHECK(render());
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    return {};
}

}  // namespace nacre::command
