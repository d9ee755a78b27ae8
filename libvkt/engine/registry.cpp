// Finding operations and applying them from words.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/registry.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"

#include <algorithm>

namespace vkt {
namespace {

RegisteredOperation const* find_operation(std::string_view name) {
    auto const& list = operations();
    auto const found = std::find_if(list.begin(), list.end(), [&](auto const& entry) { return entry.name == name; });
    return found == list.end() ? nullptr : &*found;
}

/// "filter gaussian" and "make sphere" are names of two words.
std::size_t words_of_name(std::vector<std::string> const& words) {
    if (words.empty()) throw Error(ErrorKind::usage, "the name of the operation is missing");
    bool const one = words.size() == 1 || words[1].starts_with('-') || find_operation(words[0]) != nullptr;
    return one ? 1 : 2;
}

} // namespace

std::unique_ptr<Operation> make_operation(std::string_view name) {
    if (auto const* const entry = find_operation(name)) return entry->make();
    auto const names = collect(operations(), [](RegisteredOperation const& entry) { return std::string(entry.name); });
    std::string const near = nearest_name(name, names);
    throw Error(ErrorKind::usage, text("'", name, "' is not an operation"),
                near.empty() ? text("known are ", join(names, ", ")) : text("did you mean '", near, "'?"));
}

std::vector<std::string> history_words(std::string_view name, Parameters const& own,
                                       std::vector<std::string> const& inputs, bool inputs_are_parameters) {
    // What belongs to an input becomes a placeholder, which the engine replaces once it knows the input's own history.
    std::vector<std::string> words = shell_words(std::string(name)), operands, options = own.words();
    std::ptrdiff_t positionals = 0;
    for (auto const& p : own.all()) {
        if (!p.given || !p.in_history || !p.positional) continue;
        std::vector<std::string> const said = p.get();
        positionals += std::ssize(said);
        // What has choices names no file.
        std::vector<std::string>& to = inputs_are_parameters && p.choices.empty() ? operands : words;
        to.insert(to.end(), said.begin(), said.end());
    }
    options.erase(options.begin(), options.begin() + positionals);
    std::size_t left = inputs.size();
    if (inputs_are_parameters) {
        // Inputs that have no place among the operands are named by options, in their order.
        for (std::size_t i = options.size(); i-- > 1 && left > std::max<std::size_t>(operands.size(), 1);)
            if (options[i] == inputs[left - 1] && options[i - 1].starts_with("--"))
                options[i] = input_placeholder(--left, true);
        // From the last one back: the first operand may have been left unsaid.
        for (std::size_t i = operands.size(); i-- > 0;)
            if (left > 0 && operands[i] == inputs[left - 1]) operands[i] = input_placeholder(--left, true);
        while (left > 0) operands.insert(operands.begin(), input_placeholder(--left, true));
    } else {
        for (std::size_t i = 0; i < left; ++i) operands.push_back(input_placeholder(i, false));
    }
    // Options come last: one that takes all words that follow must not take an input's name.
    words.insert(words.end(), operands.begin(), operands.end());
    words.insert(words.end(), options.begin(), options.end());
    return words;
}

Volume apply(std::vector<std::string> words, std::vector<Volume> const& inputs, Listener const& listener) {
    std::size_t const n = words_of_name(words);
    std::string const name = n == 1 ? words[0] : words[0] + " " + words[1];
    words.erase(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(n));
    auto const operation = make_operation(name);

    Parameters own, shared;
    ExecutionOptions options;
    operation->parameters(own);
    options.declare(shared);
    bool const inputs_are_parameters = !operation->input_names().empty();
    std::size_t named = inputs_are_parameters ? 0 : std::erase(words, "-");
    auto const left = read_words(words, {&own, &shared});
    if (!left.empty())
        throw Error(ErrorKind::usage, text(name, ": unexpected argument '", left.front(), "'"),
                    "volumes are passed beside the words");
    operation->check();
    if (inputs_are_parameters)
        for (auto const& input : operation->input_names()) {
            if (input != "-")
                throw Error(ErrorKind::usage, text(name, ": '", input, "' is not a number"),
                            "read a file first, pass the volume beside the words, and say '-' for it here");
            ++named;
        }
    auto const wanted = static_cast<std::size_t>(operation->inputs());
    if (inputs.size() != wanted || named > wanted)
        throw Error(ErrorKind::usage,
                    text(name, " takes ", static_cast<std::uint64_t>(wanted), wanted == 1 ? " volume" : " volumes",
                         ", not ", static_cast<std::uint64_t>(std::max(named, inputs.size()))));

    StageInfo info;
    info.name = name;
    info.input_names.assign(inputs.size(), "-");
    info.words = history_words(name, own, info.input_names, inputs_are_parameters);
    info.listener = listener;
    auto sources = collect(inputs, [](Volume const& input) { return volume_source({input}); });
    Execution const execution = options.execution();
    keep_blocks(execution.memory);
    auto const result = attach(std::move(sources), *operation, execution, std::move(info));
    result->next_volume();
    return load(*result, execution);
}

} // namespace vkt
