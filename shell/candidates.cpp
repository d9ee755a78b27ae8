// Candidates for words.
// SPDX-License-Identifier: MIT
#include "shell/candidates.h"

#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/shared_memory.h"
#include "libvkt/render/colormap.h"
#include "shell/completion_scripts.h"
#include "shell/invocation.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <sys/stat.h>

namespace vkt::shell {
namespace {

/// Names of the variables of those words that are files with several.
std::vector<std::string> variables_of(std::vector<std::string> const& words) {
    constexpr std::string_view key = "variable ";
    std::vector<std::string> names;
    for (auto const& word : words) {
        struct stat status {};
        bool const file = ::stat(word.c_str(), &status) == 0 && (S_ISREG(status.st_mode) || S_ISDIR(status.st_mode));
        if (!file) continue;
        try {
            auto const source = open_volume(open_bytes(word), {});
            if (!source->next_volume()) continue;
            auto const& attributes = source->header().attributes;
            for (auto at = attributes.lower_bound(std::string(key)); at != attributes.end(); ++at)
                if (at->first.starts_with(key)) names.push_back(at->first.substr(key.size()));
            if (auto const only = attributes.find("variable"); only != attributes.end()) names.push_back(only->second);
        } catch (Error const&) { // no volume: its name stood for something else
        }
    }
    return names;
}

/// What may stand for an option's value, as far as it can be known; `words` are those before it.
std::vector<std::string> values_of(Parameter const& p, Invocation const& invocation,
                                   std::vector<std::string> const& words) {
    if (p.name == "device") return {"auto", "cpu", "gpu", "gpu:all"};
    if (p.name == "colormap") {
        std::vector<std::string> maps = render::colormap_names();
        for (std::string const& map : render::colormap_names())
            if (auto const other = render::other_name(map); !other.empty()) maps.emplace_back(other);
        return maps;
    }
    if (p.name == "view") return {"oblique", "x", "-x", "y", "-y", "z", "-z"};
    if (p.name == "variable") return variables_of(words);
    if (p.name == "range" && p.choices.empty()) return {"minmax", "p1:p99"};
    if (p.name != "format" || !p.choices.empty()) return p.choices;
    bool const reads = invocation.opener() != nullptr;
    std::vector<std::string> names;
    for (auto const& format : formats())
        if (reads ? format.open != nullptr : format.create != nullptr) names.push_back(format.name);
    if (!reads) names.emplace_back("vkt");
    return names;
}

/// Names of files and directories that begin so.
std::vector<std::string> files_beginning(std::string const& prefix) {
    std::string const folder = prefix.substr(0, prefix.rfind('/') + 1); // empty where there is no slash
    std::error_code none;
    std::vector<std::string> names;
    for (std::filesystem::directory_iterator it(folder.empty() ? "." : folder, none), end; it != end;
         it.increment(none)) {
        std::string const name = it->path().filename().string();
        bool const hidden = name.starts_with('.') && !prefix.substr(folder.size()).starts_with('.');
        if (!hidden && (folder + name).starts_with(prefix))
            names.push_back(folder + name + (it->is_directory(none) ? "/" : ""));
    }
    std::sort(names.begin(), names.end());
    return names;
}

/// Whether a command, or what its sub-verbs do, can be part of a pipeline.
bool is_stage(Command const& command) {
    return !command.body && std::all_of(command.verbs.begin(), command.verbs.end(),
                                        [](auto const& verb) { return is_stage(verb.command); });
}

/// Those of a pipeline that is one word, begun and perhaps quoted: each is the word as it would go on.
std::vector<std::string> pipeline_completions(std::string pipeline) {
    if (pipeline.starts_with('\'') || pipeline.starts_with('"')) pipeline.erase(0, 1);
    char quote = 0;
    std::size_t stage = 0, word = 0; // where the last of each begins
    for (std::size_t i = 0; i < pipeline.size(); ++i) {
        char const c = pipeline[i];
        if (quote != 0 || c == '\'' || c == '"')
            quote = quote == 0 ? c : c == quote ? '\0' : quote;
        else if (c == '|')
            stage = word = i + 1;
        else if (c == ' ')
            word = i + 1;
    }
    if (quote != 0) return {};
    std::vector<std::string> words = shell_words(pipeline.substr(stage, word - stage));
    if (!words.empty() && words.front() == "vkt") words.erase(words.begin());
    bool const names_verb = words.empty();
    std::string const prefix = pipeline.substr(word);
    words.push_back(prefix);
    std::vector<std::string> candidates = completions(words);
    if (names_verb) std::erase_if(candidates, [](auto const& name) { return !is_stage(*find_verb({name}).command); });
    if (candidates.empty() && !names_verb) candidates = files_beginning(prefix);
    for (auto& candidate : candidates) candidate.insert(0, pipeline, 0, word);
    return candidates;
}

/// Those of commands that take words of their own; false for all others.
bool body_completions(std::vector<std::string> const& words, std::function<void(std::string const&)> const& offer) {
    if (words.front() == "pipe") {
        Common common;
        Parameters options;
        common.declare(
            options, {.volume_output = true, .file_output = true, .report = true, .report_file = true, .input = true});
        for (auto const& p : options.all()) offer("--" + p.name);
        return true;
    }
    if (words.front() == "doctor") {
        for (char const* const option : {"--calibrate", "--json", "--help"}) offer(option);
        return true;
    }
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
        bool const pipeline =
            words.front() == "pipe" || ((words.front() == "chart" || words.front() == "stress") && words.size() == 1);
        bool const wanted_for = words.front() == "slim" && words.back() == "--for";
        if ((pipeline || wanted_for) && !prefix.starts_with('-')) return pipeline_completions(prefix);
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
                for (auto const& value : values_of(*p, invocation, words)) offer(value);
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
