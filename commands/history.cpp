// vkt history: what made a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "shell/command.h"

namespace vkt::shell {
namespace {

std::string command_line(History const& step) {
    std::vector<std::string> words{"vkt"};
    for (auto const& word : step.command) words.push_back(shell_quoted(word));
    return join(words, " ");
}

/// The newest step first, what it read below it.
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

/// Steps that are only counted.
std::int64_t untold(History const& step) {
    std::int64_t count = step.earlier;
    for (auto const& input : step.inputs) count += untold(input);
    return count;
}

/// Throws Error{failure} if steps are missing: what is left makes no volume.
std::string shell_line(History const& history) {
    if (std::int64_t const missing = untold(history); missing > 0)
        throw Error(
            ErrorKind::failure,
            text("no pipeline makes the volume again: of its history ", missing, " earlier steps are only counted"),
            "without --as-shell the steps that are known are shown");
    return history_as_shell(history) + "\n";
}

class ShowHistory : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.flag("as-shell", as_shell_, "print a pipeline that makes the volume again");
    }
    bool reports() const override { return true; }
    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        if (as_shell_ && context.json()) throw Error(ErrorKind::usage, "--as-shell and --json exclude each other");
        Source& source = *inputs.front();
        std::vector<std::string> objects, texts;
        while (source.next_volume()) {
            std::optional<History> const history = source.header().history;
            source.finish();
            if (context.json())
                objects.push_back(history ? json(*history, 0) : "null");
            else if (!history)
                context.note("the volume has no history");
            else
                texts.push_back(as_shell_ ? shell_line(*history) : tree(*history, 0));
        }
        if (objects.size() == 1)
            context.print(objects.front() + "\n");
        else if (context.json())
            context.print("[\n" + join(objects, ",\n") + "\n]\n");
        else if (!texts.empty())
            context.print(join(texts, ""));
        return 0;
    }

private:
    bool as_shell_ = false;
};

} // namespace

Command history_command() {
    return consumer_command<ShowHistory>(
        {"Show the commands that made a volume.",
         "The newest step comes first, what it read is indented below it. With --as-shell the same as a pipeline that "
         "a shell runs.",
         {{"The steps", "vkt make sphere --dims 32 32 32 | vkt resample --scale 0.5 | vkt history"},
          {"As a pipeline", "vkt make sphere --dims 32 32 32 | vkt resample --scale 0.5 | vkt history --as-shell"}}});
}

} // namespace vkt::shell
