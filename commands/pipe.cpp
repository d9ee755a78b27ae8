// vkt pipe: a whole pipeline in one process.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "shell/log.h"
#include "shell/options.h"
#include "shell/run/budget.h"
#include "shell/run/run.h"
#include "shell/run/stage_error.h"

#include <algorithm>

namespace vkt::shell {
namespace {

std::vector<std::vector<std::string>> stages_of(std::string const& line) {
    auto stages = shell_stages(line);
    for (auto& stage : stages) {
        if (stage.empty()) throw Error(ErrorKind::usage, text("an empty stage in '", line, "'"));
        if (stage.front() == "vkt") stage.erase(stage.begin());
        if (stage.empty()) throw Error(ErrorKind::usage, "'vkt' alone is no stage");
    }
    return stages;
}

/// Options given to the pipeline go to the stages that have them, those about the output to the last one.
void share(Parameters const& shared, std::vector<Verb>& stages) {
    for (auto const& p : shared.all()) {
        if (!p.given || p.positional) continue;
        bool const output = is_about_output(p.name);
        bool taken = false;
        for (Verb& stage : stages) {
            bool const last = &stage == &stages.back();
            if (output && !last) continue;
            Invocation known(stage);
            bool const own = output && known.own_parameters().find(p.name) != nullptr; // those of write
            if (!own && known.common_parameters().find(p.name) == nullptr) continue;
            taken = true;
            stage.words.push_back("--" + p.name);
            for (auto& word : p.get()) stage.words.push_back(std::move(word));
        }
        if (!taken)
            throw Error(ErrorKind::usage, output ? text("the last stage, '", stages.back().name, "', has no --", p.name)
                                                 : text("no stage of the pipeline has an option --", p.name));
    }
}

int pipe(std::vector<std::string> const& words) {
    if (words.empty())
        throw Error(ErrorKind::usage, "missing pipeline", "e.g. vkt pipe 'read a.nrrd | flip x | write b.nrrd'");
    std::string line;
    Common common;
    Parameters shared, own;
    std::optional<double> tolerance;
    own.option("tolerance", tolerance, "E", "largest error of the result, a physical value, divided among the stages");
    shared.positional("pipeline", line, "the stages, quoted as one word");
    common.declare(shared,
                   {.volume_output = true, .file_output = true, .report = true, .report_file = true, .input = true});
    parse_words(words, {&shared, &own}, "pipe");
    std::vector<Verb> verbs;
    for (auto& words_of_stage : stages_of(line)) {
        verbs.push_back(find_verb(words_of_stage));
        if (verbs.back().command->body)
            throw Error(ErrorKind::usage, text("'", verbs.back().name, "' cannot be part of a pipeline"));
    }
    share(shared, verbs);
    std::deque<Invocation> stages;
    for (auto& verb : verbs) {
        Invocation& stage = stages.emplace_back(std::move(verb), Invocation::Place::pipeline);
        in_stage(stage.label(), [&] { stage.parse(); });
        if (stage.common().help || stage.common().examples)
            throw Error(ErrorKind::usage, "--help has no meaning within a pipeline", "see 'vkt help'");
    }
    for (std::size_t i = 0; i + 1 < stages.size(); ++i)
        if (stages[i].common_parameters().given("output"))
            throw Error(ErrorKind::usage,
                        text("--output of '", stages[i].verb().name, "' would end the pipeline there"),
                        "only the last stage has an output");
    if (tolerance) {
        bool const tells = common.explain || common.dry_run || common.verbose;
        DividedBudget const divided = divide_budget(stages, *tolerance);
        for (auto const& choice : divided.choices)
            if (tells)
                Log().answer(
                    text("vkt pipe:   ", stages[choice.stage].verb().name, " --", choice.option, " ", choice.value));
        if (tells) Log().answer(text("vkt pipe:   ", divided.result));
    }
    return run(stages);
}

} // namespace

Command pipe_command() {
    Command command;
    command.texts = {
        "Run a pipeline in one process: same result, no voxels through pipes.",
        "vkt pipe [options] 'STAGE | STAGE | …'\nOptions beside the pipeline are given to all stages that have them "
        "(--threads, --memory, --dry-run, …), those about the output (-o, --force, --format, …) to the last.\n"
        "      --tolerance E           divides an error of E, a physical value, among the stages so that the whole "
        "costs least",
        {{"Read, crop and write without copying through pipes",
          "vkt pipe 'read volume.nrrd | crop --roi :,:,10:20 | write part.nrrd'"},
         {"What would happen", "vkt pipe --dry-run 'read volume.nrrd | filter gaussian --sigma 2 | stats'"},
         {"As cheap as an error of one level of 256 allows",
          "vkt make noise --dims 24 24 24 --dtype uint8 -o levels.nrrd && vkt pipe --tolerance 1 --explain 'convert "
          "levels.nrrd --dtype float32 | filter gaussian --sigma 2 | filter gaussian --sigma 3 | stats'"}}};
    command.body = pipe;
    return command;
}

} // namespace vkt::shell
