// SPDX-License-Identifier: Apache-2.0
#include "tests/samples/run_command.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "tests/core/temporary_folder.h"

namespace nacre {
namespace {

std::string content_of(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

CommandResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          const std::vector<std::string>& environment) {
    // Output goes through files: no pipe can fill up and stop the program.
    const TemporaryFolder folder;
    const std::string output = folder.path() / "output", errors = folder.path() / "errors";
    std::vector<char*> words{const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
    words.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
        if (!std::freopen(output.c_str(), "wb", stdout) || !std::freopen(errors.c_str(), "wb", stderr)) ::_exit(126);
        for (const std::string& entry : environment) ::putenv(const_cast<char*>(entry.c_str()));
        ::execvp(program.c_str(), words.data());
        ::_exit(127);
    }
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child) return {};
    CommandResult result;
    result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    result.output = content_of(output);
    result.errors = content_of(errors);
    return result;
}

CommandResult run_nacre(const std::vector<std::string>& arguments, const std::vector<std::string>& environment) {
    return run_program(NACRE_COMMAND, arguments, environment);
}

}  // namespace nacre
