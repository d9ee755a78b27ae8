// vkt completion: functions for the user's shell, and the candidates that they ask for.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "shell/candidates.h"
#include "shell/command.h"
#include "shell/completion_scripts.h"

#include <cstdio>

namespace vkt::shell {
namespace {

int completion(std::vector<std::string> const& words) {
    if (!words.empty() && words.front() == "--words") {
        for (auto const& candidate : completions({words.begin() + 1, words.end()})) std::puts(candidate.c_str());
        return 0;
    }
    if (words.size() != 1)
        throw Error(ErrorKind::usage, "name one shell: bash, zsh or fish", "e.g. source <(vkt completion bash)");
    for (auto const& [shell, script] : completion_scripts()) {
        if (shell != words.front()) continue;
        std::fputs(script.c_str(), stdout);
        return 0;
    }
    throw Error(ErrorKind::usage, text("no completion for '", words.front(), "'"), "bash, zsh and fish are known");
}

} // namespace

Command completion_command() {
    Command command;
    command.texts = {
        "Print the completion function for bash, zsh or fish.",
        "vkt completion bash|zsh|fish\n  --words WORD…  candidates for the last of these words, one a line",
        {{"For this bash session", "vkt completion bash"}}};
    command.body = completion;
    return command;
}

} // namespace vkt::shell
