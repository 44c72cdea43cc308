// SPDX-License-Identifier: Apache-2.0
#include "core/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>

namespace nacre {
namespace {

/// Guards the terminal line and the chain of steps. Never destroyed: threads may log while the program ends.
std::recursive_mutex& terminal_mutex() {
    static std::recursive_mutex* const mutex = new std::recursive_mutex;
    return *mutex;
}

Progress* innermost = nullptr;
/// The file on which a line stands that must be erased before anything else is written; null where none does.
std::FILE* line_on = nullptr;

void erase_line() {
    if (!line_on) return;
    std::fputs("\r\033[K", line_on);
    std::fflush(line_on);
    line_on = nullptr;
}

/// Cut to the width of the terminal: a line that wraps cannot be overwritten. Cuts between characters of UTF-8.
std::string cut_to_width(std::string text, std::FILE* file) {
    winsize size{};
    const std::size_t columns = ::ioctl(::fileno(file), TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
    if (text.size() < columns) return text;
    std::size_t end = columns - 1;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
    text.resize(end);
    return text;
}

}  // namespace

ProgressOutput ProgressOutput::standard() {
    ProgressOutput output;
    const char* wanted = std::getenv("NACRE_PROGRESS");
    const std::string_view choice = wanted ? wanted : "";
    const char* terminal = std::getenv("TERM");
    if (choice == "off")
        output.style = Style::hidden;
    else if (choice != "plain" && ::isatty(::fileno(output.file)) && terminal && std::string_view(terminal) != "dumb")
        output.style = Style::line;
    return output;
}

Progress::Progress(std::string_view step, std::uint64_t total, const ProgressOutput& output)
    : output_(output), step_(step), total_(total) {
    std::lock_guard lock(terminal_mutex());
    outer_ = innermost;
    innermost = this;
}

Progress::~Progress() {
    std::lock_guard lock(terminal_mutex());
    // Usually the innermost; steps of different threads may end in any order.
    for (Progress** link = &innermost; *link; link = &(*link)->outer_)
        if (*link == this) {
            *link = outer_;
            break;
        }
    if (!was_shown_) return;
    if (output_.style == ProgressOutput::Style::line) {
        if (line_on == output_.file) erase_line();
    } else {
        const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
        std::fputs(fmt::format("{}: done in {:.1f} s\n", step_, seconds).c_str(), output_.file);
        std::fflush(output_.file);
    }
}

void Progress::update(std::uint64_t done, std::string_view item) {
    if (output_.style == ProgressOutput::Style::hidden) return;
    std::lock_guard lock(terminal_mutex());
    if (innermost != this) return;
    const Clock::time_point now = Clock::now();
    const bool is_line = output_.style == ProgressOutput::Style::line;
    if (now - start_ < output_.delay) return;
    if (was_shown_ && now - last_shown_ < (is_line ? output_.line_interval : output_.plain_interval)) return;
    was_shown_ = true;
    last_shown_ = now;

    std::string text = step_;
    if (total_ > 0)
        text += fmt::format(" {}/{}", done, total_);
    else if (done > 0)
        text += fmt::format(" {}", done);
    if (!item.empty()) text += fmt::format(": {}", item);
    if (is_line) {
        erase_line();
        std::fputs(cut_to_width(std::move(text), output_.file).c_str(), output_.file);
        line_on = output_.file;
    } else {
        std::fputs((text + '\n').c_str(), output_.file);
    }
    std::fflush(output_.file);
}

ProgressLinePause::ProgressLinePause() : lock_(terminal_mutex()) { erase_line(); }

}  // namespace nacre
