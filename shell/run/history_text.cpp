// What made a volume, as text.
// SPDX-License-Identifier: MIT
#include "shell/run/history_text.h"

#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/series.h"
#include "libvkt/io/shared_memory.h"
#include "shell/command.h"
#include "shell/named_files.h"

#include <cstddef>
#include <cstdint>
#include <set>
#include <unistd.h>
#include <utility>
#include <vector>

namespace vkt::shell {
namespace {

std::string command_line(History const& step) {
    std::vector<std::string> words{"vkt"};
    for (auto const& word : step.command) words.push_back(shell_quoted(word));
    return join(words, " ");
}

/// Steps that are only counted.
std::int64_t untold(History const& step) {
    std::int64_t count = step.earlier;
    for (auto const& input : step.inputs) count += untold(input);
    return count;
}

bool is_told(History const& step) { return !step.command.empty() || step.earlier > 0; }

/// Adds what a pipeline of these steps would want and not find: files by name, and "-" for standard input.
void look_for_inputs(History const& step, std::set<std::string>& missing) {
    for (auto const& input : step.inputs) look_for_inputs(input, missing);
    if (step.command.empty()) return;
    Invocation stage(find_verb(step.command));
    stage.parse();
    auto const look = [&](std::string const& name) {
        bool const told = name == "-" ? !step.inputs.empty() && is_told(step.inputs.front()) : name == "<(…)";
        if (told) return;
        for (auto const& file : matching_files(name))
            if (name == "-" || ::access(segment_file(file).c_str(), F_OK) != 0) missing.insert(file);
    };
    for (auto const& name : input_names(stage)) look(name);
    for (auto const& p : stage.own_parameters().all())
        if (p.given && p.in_history && p.value_name == "FILE") look(p.get().front());
}

std::string tree(History const& step, std::size_t depth) {
    std::string result = std::string(2 * depth, ' ');
    result += !step.command.empty() ? command_line(step) : step.earlier > 0 ? earlier_text(step.earlier) : "(unknown)";
    result += '\n';
    for (auto const& input : step.inputs) result += tree(input, depth + 1);
    return result;
}

std::string json(History const& step, std::size_t depth) {
    std::string const margin(2 * depth, ' ');
    std::vector<std::string> words, inputs;
    for (auto const& word : step.command) words.push_back(json_string(word));
    for (auto const& input : step.inputs) inputs.push_back(margin + "    " + json(input, depth + 2));
    std::string result = text("{\n", margin, "  \"command\": [", join(words, ", "), "]");
    if (step.earlier > 0) result += text(",\n", margin, "  \"earlier\": ", step.earlier);
    if (!inputs.empty()) result += text(",\n", margin, "  \"inputs\": [\n", join(inputs, ",\n"), "\n", margin, "  ]");
    return result += text("\n", margin, "}");
}

} // namespace

std::string history_tree(History const& history) { return tree(history, 0); }
std::string history_json(History const& history) { return json(history, 0); }

std::string history_line(History const& history) {
    if (std::int64_t const missing = untold(history); missing > 0)
        throw Error(
            ErrorKind::failure,
            text("no pipeline makes the volume again: of its history ", missing, " earlier steps are only counted"),
            "without --as-shell the steps that are known are shown");
    return history_as_shell(history) + "\n";
}

std::string history_obstacle(History const& history) {
    std::set<std::string> missing;
    try {
        look_for_inputs(history, missing);
    } catch (Error const& error) { // words of another version, or a file that an option names
        return text("a step of the pipeline cannot be run here: ", error.what());
    }
    bool const input = missing.erase("-") > 0;
    std::string files;
    for (auto const& file : missing) files += text(files.empty() ? "'" : ", '", file, "'");
    if (!files.empty()) files = text("what it reads is not here: ", files);
    if (!input) return files;
    return text("the pipeline reads standard input: no history told what came there", files.empty() ? "" : "; ", files);
}

} // namespace vkt::shell
