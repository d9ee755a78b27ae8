// vkt pipe: a whole pipeline in one process.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "shell/run.h"

#include <algorithm>

namespace vkt::shell {
namespace {

/// Splits the words of a pipeline at "|"; a bar inside quotes belongs to its word and was unquoted with a mark.
std::vector<std::vector<std::string>> stages_of(std::string const& line) {
    std::vector<std::vector<std::string>> stages;
    std::string current;
    char quote = 0;
    auto const close = [&] {
        stages.push_back(shell_words(current));
        if (stages.back().empty()) throw Error(ErrorKind::usage, text("an empty stage in '", line, "'"));
        if (stages.back().front() == "vkt") stages.back().erase(stages.back().begin());
        current.clear();
    };
    for (char const c : line) {
        if (quote == 0 && (c == '\'' || c == '"')) {
            quote = c;
        } else if (quote == c) {
            quote = 0;
        } else if (quote == 0 && c == '|') {
            close();
            continue;
        }
        current += c;
    }
    close();
    return stages;
}

int pipe(std::vector<std::string> const& words) {
    if (words.empty())
        throw Error(ErrorKind::usage, "missing pipeline", "e.g. vkt pipe 'read a.nrrd | flip x | write b.nrrd'");
    // The pipeline is the last word; options before it are given to every stage.
    std::vector<std::string> const shared(words.begin(), words.end() - 1);
    std::deque<Invocation> stages;
    for (auto& stage : stages_of(words.back())) {
        if (stage.empty()) throw Error(ErrorKind::usage, "'vkt' alone is no stage");
        Verb verb = find_verb(stage);
        if (verb.command->body) throw Error(ErrorKind::usage, text("'", verb.name, "' cannot be part of a pipeline"));
        verb.words.insert(verb.words.end(), shared.begin(), shared.end());
        stages.emplace_back(std::move(verb));
    }
    for (auto& stage : stages) {
        stage.parse();
        if (stage.common().help || stage.common().examples)
            throw Error(ErrorKind::usage, "--help has no meaning within a pipeline", "see 'vkt help'");
    }
    for (std::size_t i = 0; i + 1 < stages.size(); ++i)
        if (stages[i].common_parameters().given("output"))
            throw Error(ErrorKind::usage,
                        text("--output of '", stages[i].verb().name, "' would end the pipeline there"),
                        "only the last stage has an output");
    return run(stages);
}

} // namespace

Command pipe_command() {
    Command command;
    command.texts = {
        "Run a pipeline in one process: same result, no voxels through pipes.",
        "vkt pipe [options] 'STAGE | STAGE | …'\nOptions before the pipeline are given to all its stages (--threads, "
        "--memory, --dry-run, …).",
        {{"Read, crop and write without copying through pipes",
          "vkt pipe 'read volume.nrrd | crop --roi :,:,10:20 | write part.nrrd'"},
         {"What would happen", "vkt pipe --dry-run 'read volume.nrrd | filter gaussian --sigma 2 | stats'"}}};
    command.body = pipe;
    return command;
}

} // namespace vkt::shell
