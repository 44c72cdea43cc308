// SPDX-License-Identifier: Apache-2.0
#include "tests/samples/run_command.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

namespace nacre {
namespace {

std::string content_of(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

RunningProgram::RunningProgram(const std::string& program, const std::vector<std::string>& arguments,
                               const std::vector<std::string>& environment) {
    const std::string output = folder_.path() / "output", errors = folder_.path() / "errors";
    std::vector<char*> words{const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
    words.push_back(nullptr);
    child_ = ::fork();
    if (child_ == 0) {
        if (!std::freopen(output.c_str(), "wb", stdout) || !std::freopen(errors.c_str(), "wb", stderr)) ::_exit(126);
        for (const std::string& entry : environment) ::putenv(const_cast<char*>(entry.c_str()));
        ::execvp(program.c_str(), words.data());
        ::_exit(127);
    }
}

RunningProgram::~RunningProgram() {
    if (child_ <= 0) return;
    ::kill(child_, SIGKILL);
    ::waitpid(child_, nullptr, 0);
}

std::string RunningProgram::output() const { return content_of(folder_.path() / "output"); }
std::string RunningProgram::errors() const { return content_of(folder_.path() / "errors"); }

void RunningProgram::interrupt() const {
    if (child_ > 0) ::kill(child_, SIGINT);
}

CommandResult RunningProgram::wait() {
    int status = 0;
    if (child_ <= 0 || ::waitpid(child_, &status, 0) != child_) return {};
    child_ = -1;
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
            .output = output(),
            .errors = errors()};
}

CommandResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          const std::vector<std::string>& environment) {
    return RunningProgram(program, arguments, environment).wait();
}

CommandResult run_nacre(const std::vector<std::string>& arguments, const std::vector<std::string>& environment) {
    return run_program(NACRE_COMMAND, arguments, environment);
}

}  // namespace nacre
