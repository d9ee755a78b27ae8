// Finding operations and applying them from words.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/registry.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/divided.h"

#include <algorithm>

namespace vkt {
namespace {

RegisteredOperation const* find_operation(std::string_view name) {
    auto const& list = operations();
    auto const found =
        std::ranges::find(list, operation_name(name), [](RegisteredOperation const& entry) { return entry.name; });
    return found == list.end() ? nullptr : &*found;
}

/// "filter gaussian" and "make sphere" are names of two words.
std::size_t words_of_name(std::vector<std::string> const& words) {
    if (words.empty()) throw Error(ErrorKind::usage, "the name of the operation is missing");
    bool const one = words.size() == 1 || words[1].starts_with('-') || find_operation(words[0]) != nullptr;
    return one ? 1 : 2;
}

} // namespace

std::vector<OperationAlias> const& operation_aliases() {
    static std::vector<OperationAlias> const aliases{{"edit", "set"}, {"reorient", "permute"}};
    return aliases;
}

std::string_view operation_name(std::string_view name) {
    for (auto const& alias : operation_aliases())
        if (alias.name == name) return alias.operation;
    return name;
}

std::unique_ptr<Operation> make_operation(std::string_view name) {
    if (auto const* const entry = find_operation(name)) return entry->make();
    auto names = collect(operations(), [](RegisteredOperation const& entry) { return std::string(entry.name); });
    for (auto const& alias : operation_aliases()) names.emplace_back(alias.name);
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

namespace {

constexpr std::string_view numbered_input = "\x01";

/// Operations may name their inputs in another order than the words do: --mask before --markers. So each "-" becomes a
/// name of its own. Returns how many there are.
std::size_t number_inputs(std::vector<std::string>& words) {
    std::size_t count = 0;
    for (std::string& word : words)
        if (word == "-") word = text(numbered_input, static_cast<std::uint64_t>(count++));
    return count;
}

/// Which of the inputs each name stands for. Those that were not said come first.
std::vector<std::size_t> order_of_inputs(std::string const& operation, std::vector<std::string> const& names) {
    auto const unsaid = static_cast<std::size_t>(std::ranges::count(names, "-"));
    std::vector<std::size_t> order;
    std::size_t next = 0;
    for (std::string const& name : names) {
        bool const numbered = name.starts_with(numbered_input);
        if (name != "-" && !numbered)
            throw Error(ErrorKind::usage, text(operation, ": '", name, "' is not a number"),
                        "read a file first, pass the volume beside the words, and say '-' for it here");
        order.push_back(numbered ? unsaid + std::stoul(name.substr(numbered_input.size())) : next++);
    }
    return order;
}

/// Takes the "-" from the words that stands in the place of a file of a volume that is no input, and returns which of
/// the volumes it means; nothing if there is no volume more than the operation has inputs.
std::optional<std::size_t> take_volume_file(Operation const& operation, Parameters& own,
                                            std::vector<std::string>& words, std::size_t volumes) {
    Parameter const* const file = operation.volume_file().empty() ? nullptr : own.find(operation.volume_file());
    if (file == nullptr || volumes != static_cast<std::size_t>(operation.inputs()) + 1) return {};
    auto const said = static_cast<std::size_t>(std::ranges::count(words, "-"));
    std::size_t index = volumes - std::min(said, volumes); // those that are not said come first
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (words[i] != "-") continue;
        if (file->positional || (i > 0 && words[i - 1] == file->spelling())) {
            words[i] = "(a volume of the program)"; // as the history keeps it
            if (index < volumes) return index;
        }
        ++index;
    }
    return {};
}

/// An operation with its parameters read and its inputs checked.
struct PreparedCall {
    std::unique_ptr<Operation> operation;
    StageInfo info;
    Execution execution;
    std::vector<Header> headers;
    std::vector<std::unique_ptr<Source>> sources;
};

PreparedCall prepare(std::vector<std::string> words, std::vector<Volume> inputs, CallOptions const& call) {
    std::size_t const n = words_of_name(words);
    std::string const name(operation_name(n == 1 ? words[0] : words[0] + " " + words[1]));
    words.erase(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(n));
    PreparedCall prepared;
    prepared.operation = make_operation(name);
    Operation& operation = *prepared.operation;

    Parameters own, shared;
    ExecutionOptions options = call.execution;
    operation.parameters(own);
    options.declare(shared);
    bool const inputs_are_parameters = !operation.input_names().empty();
    auto const beside = take_volume_file(operation, own, words, inputs.size());
    Parameter const* const in = own.find("in");
    if (in != nullptr && in->positional && in->max_values < 0) // those that are not said come first
        for (auto unsaid = std::ssize(inputs) - std::ranges::count(words, "-"); unsaid > 0; --unsaid)
            words.insert(words.begin(), "-");
    std::size_t const said = inputs_are_parameters ? number_inputs(words) : std::erase(words, "-");
    auto const left = read_words(words, {&own, &shared});
    if (!left.empty())
        throw Error(ErrorKind::usage, text(name, ": unexpected argument '", left.front(), "'"),
                    "volumes are passed beside the words");
    operation.check();
    if (beside) {
        operation.take_volume(*volume_source({inputs[*beside]}));
        inputs.erase(inputs.begin() + static_cast<std::ptrdiff_t>(*beside));
    }
    std::vector<std::string> const names =
        inputs_are_parameters ? operation.input_names() : std::vector<std::string>(inputs.size(), "-");
    std::vector<std::size_t> const order = order_of_inputs(name, names);
    auto const wanted = static_cast<std::size_t>(operation.inputs());
    bool const none_missing = std::ranges::all_of(order, [&](std::size_t i) { return i < inputs.size(); });
    if (inputs.size() != wanted || said > wanted || order.size() != wanted || !none_missing)
        throw Error(ErrorKind::usage,
                    text(name, " takes ", static_cast<std::uint64_t>(wanted), wanted == 1 ? " volume" : " volumes",
                         ", not ", static_cast<std::uint64_t>(inputs.size() != wanted ? inputs.size() : said)));

    prepared.info.name = name;
    prepared.info.words = history_words(name, own, names, inputs_are_parameters);
    prepared.info.input_names.assign(inputs.size(), "-");
    prepared.info.listener = call.listener;
    prepared.headers = collect(order, [&](std::size_t i) { return inputs[i].header(); });
    prepared.sources = collect(order, [&](std::size_t i) { return volume_source({inputs[i]}); });
    prepared.execution = options.execution();
    prepared.execution.monitor = call.monitor;
    keep_blocks(prepared.execution.memory);
    return prepared;
}

} // namespace

Volume apply(std::vector<std::string> words, std::vector<Volume> const& inputs, CallOptions const& options) {
    PreparedCall prepared = prepare(words, inputs, options);
    if (prepared.operation->shape() == Shape::reduction)
        throw Error(ErrorKind::usage, text(prepared.info.name, " makes no volume"), "it has a report: measure with it");
    Volume volume;
    {
        int const gpus = prepared.execution.gpus;
        std::vector<PreparedCall> others;
        if (gpus > 1) // threads of their own will read them: nothing is moved then
            for (Volume const& input : inputs)
                if (input.header().kind == Kind::structured) (void)input.view();
        for (int i = 1; i < gpus; ++i) {
            others.push_back(prepare(words, inputs, options));
            others.back().info.listener = {};
        }
        std::vector<Share> shares;
        Execution const whole = on_whole_volumes(prepared.execution, *prepared.operation, prepared.headers);
        auto const add = [&](PreparedCall& one, int gpu) {
            Execution execution = gpus > 1 ? share_of(whole, gpus) : whole;
            execution.gpu += gpu;
            shares.push_back({attach(std::move(one.sources), *one.operation, execution, std::move(one.info)),
                              {one.operation.get()}});
        };
        add(prepared, 0);
        for (std::size_t i = 0; i < others.size(); ++i) add(others[i], static_cast<int>(i) + 1);
        auto const result =
            gpus == 1 ? std::move(shares.front().source) : divided(std::move(shares), prepared.execution);
        result->next_volume();
        volume = load(*result, whole);
    }
    if (options.reporter != nullptr && prepared.operation->reports()) *options.reporter = std::move(prepared.operation);
    return volume;
}

std::vector<Report> measure(std::vector<std::string> words, std::vector<Volume> const& inputs,
                            CallOptions const& options) {
    PreparedCall prepared = prepare(std::move(words), inputs, options);
    if (prepared.operation->shape() != Shape::reduction)
        throw Error(ErrorKind::usage, text(prepared.info.name, " makes a volume"), "apply it");
    if (prepared.execution.only_gpu && !prepared.operation->runs_on_gpu()) refuse_cpu(prepared.info.name);
    std::vector<Report> reports;
    std::string printed;
    Measurement measurement{
        .inputs = prepared.sources,
        .execution = prepared.execution,
        .info = std::move(prepared.info),
        .form = ReportForm::json,
        .report = [&](Report report) { reports.push_back(std::move(report)); },
        .print =
            [&](std::string_view lines) {
                check_budget(printed.size() + lines.size(), prepared.execution);
                printed += lines;
            },
        .named = false,
    };
    prepared.operation->measure(measurement);
    if (!printed.empty()) reports.emplace_back().add("text", printed);
    return reports;
}

} // namespace vkt
