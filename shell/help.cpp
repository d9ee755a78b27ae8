// Help.
// SPDX-License-Identifier: MIT
#include "shell/help.h"

#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/shared_memory.h"
#include "libvkt/render/colormap.h"
#include "shell/completion_scripts.h"

#include <algorithm>
#include <functional>
#include <map>

namespace vkt::shell {
namespace {

constexpr std::size_t column = 30;

std::string padded(std::string line, std::size_t width) {
    if (line.size() + 1 < width) return line.append(width - line.size(), ' ');
    return line + "\n" + std::string(width, ' ');
}

std::string synopsis(Parameter const& p) {
    std::string names = p.letter != 0 ? text("-", std::string(1, p.letter), ", --", p.name) : text("    --", p.name);
    for (auto const& alias : p.aliases) names += text(", --", alias);
    return p.value_name.empty() ? names : text(names, " ", p.value_name);
}

std::string option_lines(Parameters const& parameters) {
    std::string lines;
    for (auto const& p : parameters.all()) {
        if (p.positional) {
            for (auto const& alias : p.aliases)
                lines += text(padded(text("      --", alias, " ", p.value_name), column), "the argument ", p.value_name,
                              ", said as an option\n");
            continue;
        }
        std::string help = p.help;
        if (!p.choices.empty() && p.choices.size() <= 8) help += text(" [", join(p.choices, "|"), "]");
        if (!p.flag && !p.required) {
            auto const value = p.get();
            std::string const shown = join(value, " ");
            if (!shown.empty()) help += text(" (default ", printable(shown), ")");
        }
        lines += text(padded("  " + synopsis(p), column), help, "\n");
    }
    return lines;
}

std::string usage_line(Invocation& invocation) {
    std::string line = "vkt " + invocation.verb().name;
    for (auto const& p : invocation.own_parameters().all())
        if (p.positional) line += p.required ? text(" ", p.value_name) : text(" [", p.value_name, "]");
    if (!invocation.command().verbs.empty()) line += " METHOD";
    int const inputs = invocation.operation()
                           ? (invocation.operation()->input_names().empty() ? invocation.operation()->inputs() : 0)
                       : invocation.consumer() ? invocation.consumer()->inputs()
                                               : 0;
    for (int i = 0; i < inputs; ++i) line += " [IN]";
    if (invocation.yields_volumes()) line += " [-o OUT]";
    return line + " [options]";
}

void examples_into(std::string& lines, Command const& command) {
    for (auto const& example : command.texts.examples) lines += example.line + "\n";
    for (auto const& verb : command.verbs) examples_into(lines, verb.command);
}

/// What people call a command who do not know our word for it.
std::map<std::string, std::string> const& synonyms() {
    static std::map<std::string, std::string> const words{
        {"arith", "threshold clamp difference subtract add multiply divide"},
        {"convert", "cast quantize normalize rescale"},
        {"crop", "cut trim subvolume clip roi"},
        {"diff", "compare equal cmp"},
        {"dump", "print values"},
        {"filter gaussian", "blur smooth denoise gauss"},
        {"flip", "mirror reverse"},
        {"info", "metadata header"},
        {"make", "generate create phantom"},
        {"render", "image thumbnail screenshot view show display plot"},
        {"affine", "transform register registration matrix shear translate tfm"},
        {"resample", "downsample upsample resize shrink zoom"},
        {"rotate", "turn spin euler quaternion reorient"},
        {"scale", "magnify enlarge zoom"},
        {"shm", "memory share publish segment ipc"},
        {"stats", "average histogram mean statistics"},
    };
    return words;
}
std::string synonyms(std::string const& name) {
    auto const found = synonyms().find(name);
    return found == synonyms().end() ? std::string() : text(" ", found->second);
}

/// What may stand for an option's value, as far as it can be known.
std::vector<std::string> values_of(Parameter const& p, Invocation const& invocation) {
    if (p.name == "device") return {"auto", "cpu", "gpu"};
    if (p.name == "colormap") return render::colormap_names();
    if (p.name == "range" && p.choices.empty()) return {"minmax", "p1:p99"};
    if (p.name != "format" || !p.choices.empty()) return p.choices;
    bool const reads = invocation.opener() != nullptr;
    std::vector<std::string> names;
    for (auto const& format : formats())
        if (reads ? format.open != nullptr : format.create != nullptr) names.push_back(format.name);
    if (!reads) names.emplace_back("vkt");
    return names;
}

/// Those of commands that take words of their own; false for all others.
bool body_completions(std::vector<std::string> const& words, std::function<void(std::string const&)> const& offer) {
    if (words.front() == "completion") {
        for (auto const& script : completion_scripts())
            if (words.size() == 1) offer(script.first);
        return true;
    }
    if (words.front() == "shm" && words.size() > 1) {
        offer(words[1] == "remove" ? "--all" : "--json");
        if (words[1] == "remove")
            for (auto const& name : segments()) offer(name.substr(name.find(':') + 1));
        return true;
    }
    if (words.front() != "help") return false;
    std::vector<NamedCommand> const* list = &commands();
    if (words.size() > 1) {
        Verb const verb = find_verb({words[1]});
        list = words.size() == 2 ? &verb.command->verbs : nullptr;
    }
    if (list != nullptr)
        for (auto const& entry : *list) offer(entry.name);
    return true;
}

} // namespace

std::string overview() {
    std::string result =
        "vkt: a volume toolset for pipelines\n\n"
        "  vkt read scan.nrrd | vkt resample --scale 0.5 | vkt filter gaussian --sigma 2 | vkt render -o scan.png\n"
        "  vkt crop scan.nrrd --roi 25%:75%,:,: -o part.nrrd\n"
        "  vkt stats scan.nrrd --json\n\nCommands:\n";
    for (auto const& [name, command] : commands()) result += text(padded("  " + name, 16), command.texts.summary, "\n");
    return result +
           "\n'vkt COMMAND --help' explains a command, 'vkt help --search WORD' finds one, man vkt tells the rest.\n";
}

std::string verb_list() {
    std::string result;
    for (auto const& [name, command] : commands()) {
        if (command.verbs.empty()) result += name + "\n";
        for (auto const& verb : command.verbs) result += text(name, " ", verb.name, "\n");
    }
    return result;
}

std::string command_examples(Command const& command) {
    std::string lines;
    examples_into(lines, command);
    return lines;
}

std::string command_help(Invocation& invocation) {
    Command const& command = invocation.command();
    std::string result = text("vkt ", invocation.verb().name, ": ", command.texts.summary, "\n\n");
    for (auto const& example : command.texts.examples) result += text("  # ", example.what, "\n  ", example.line, "\n");
    result += text("\nUsage: ", usage_line(invocation), "\n");
    if (!command.texts.description.empty()) result += text("\n", command.texts.description, "\n");
    if (!command.verbs.empty()) {
        result += "\nMethods:\n";
        for (auto const& [name, verb] : command.verbs)
            result += text(padded("  " + name, 20), verb.texts.summary, "\n");
    }
    std::string positionals;
    for (auto const& p : invocation.own_parameters().all())
        if (p.positional)
            positionals += text(padded("  " + p.value_name, column), p.help,
                                p.choices.empty() ? "" : text(" [", join(p.choices, "|"), "]"), "\n");
    if (!positionals.empty()) result += "\nArguments:\n" + positionals;
    std::string const own = option_lines(invocation.own_parameters());
    if (!own.empty()) result += "\nOptions:\n" + own;
    if (command.operation || command.consumer || command.opener)
        result += "\nCommon options:\n" + option_lines(invocation.common_parameters());
    return result;
}

std::string common_help() {
    Common common;
    Parameters parameters;
    common.declare(parameters, {true, false, true, true});
    return option_lines(parameters);
}

std::string command_of_synonym(std::string const& word) {
    std::string const needle = lower_case(word);
    for (auto const& [name, words] : synonyms()) {
        auto const known = split(words, ' ');
        if (std::find(known.begin(), known.end(), needle) != known.end()) return name;
    }
    return {};
}

std::string search(std::string const& word) {
    std::string const needle = lower_case(word);
    std::string result;
    auto const look = [&](std::string const& name, Command const& command) {
        std::string all = name + " " + command.texts.summary + " " + command.texts.description + synonyms(name);
        Invocation invocation({name, &command, {}});
        for (auto const& p : invocation.own_parameters().all())
            all += " " + p.name + " " + p.help + " " + join(p.choices, " ");
        if (lower_case(all).find(needle) != std::string::npos)
            result += text(padded("  " + name, 22), command.texts.summary, "\n");
    };
    for (auto const& [name, command] : commands()) {
        look(name, command);
        for (auto const& [sub, verb] : command.verbs) look(name + " " + sub, verb);
    }
    return result;
}

std::vector<std::string> completions(std::vector<std::string> words) {
    std::vector<std::string> candidates;
    if (words.empty()) words.emplace_back();
    std::string const prefix = words.back();
    words.pop_back();
    auto const offer = [&](std::string const& candidate) {
        if (candidate.starts_with(prefix)) candidates.push_back(candidate);
    };
    if (words.empty()) {
        for (auto const& entry : commands()) offer(entry.name);
        return candidates;
    }
    try {
        if (is_segment(prefix))
            for (auto const& name : segments()) offer(name);
        if (!candidates.empty() || body_completions(words, offer)) return candidates;
        Invocation invocation(find_verb(words));
        Command const& command = invocation.command();
        if (!command.verbs.empty() && words.size() == 1) {
            for (auto const& verb : command.verbs) offer(verb.name);
            return candidates;
        }
        std::string const& before = words.back();
        for (Parameters* list : {&invocation.own_parameters(), &invocation.common_parameters()}) {
            Parameter const* const p = before.starts_with("--") ? list->find(before.substr(2)) : nullptr;
            if (p != nullptr && !p->flag) {
                for (auto const& value : values_of(*p, invocation)) offer(value);
                return candidates;
            }
        }
        for (Parameters* list : {&invocation.own_parameters(), &invocation.common_parameters()})
            for (auto const& p : list->all()) {
                if (!p.positional && prefix.starts_with("-")) offer("--" + p.name);
                if (p.positional && prefix.starts_with("-"))
                    for (auto const& alias : p.aliases) offer("--" + alias);
                if (p.positional && !prefix.starts_with("-"))
                    for (auto const& choice : p.choices) offer(choice);
            }
    } catch (Error const&) {
        return {}; // half-typed words complete to nothing
    }
    return candidates;
}

} // namespace vkt::shell
