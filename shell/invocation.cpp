// Finding verbs and parsing their words.
// SPDX-License-Identifier: MIT
#include "shell/invocation.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "shell/help.h"
#include "shell/measure.h"
#include "shell/options.h"

#include <algorithm>

namespace vkt::shell {
namespace {

Command const* lookup(std::vector<NamedCommand> const& list, std::string const& name) {
    auto const found = std::find_if(list.begin(), list.end(), [&](auto const& entry) { return entry.name == name; });
    return found == list.end() ? nullptr : &found->command;
}

std::vector<std::string> names_of(std::vector<NamedCommand> const& list) {
    return collect(list, [](NamedCommand const& entry) { return entry.name; });
}

[[noreturn]] void unknown_verb(std::string const& word) {
    std::string const other = command_of_synonym(word);
    std::string const near = other.empty() ? nearest_name(word, names_of(commands())) : other;
    throw Error(ErrorKind::usage, text("'", word, "' is not a command"),
                near.empty() ? text("'vkt help' lists the commands") : text("did you mean 'vkt ", near, "'?"));
}

/// A command that needs a method was given a word that is none.
[[noreturn]] void unknown_method(std::string const& command, std::string const& word,
                                 std::vector<std::string> const& names) {
    std::string const other = command_of_synonym(word, command + " ");
    std::string const near = other.empty() ? nearest_name(word, names) : other.substr(command.size() + 1);
    bool const file = word == "-" || word.find_first_of("./") != std::string::npos;
    throw Error(ErrorKind::usage,
                file ? text("'vkt ", command, "' needs a method before '", word, "'")
                     : text("'", command, " ", word, "' is not a command"),
                near.empty() ? text("'vkt ", command, "' is followed by one of: ", join(names, ", "))
                             : text("did you mean 'vkt ", command, " ", near, "'?"));
}

} // namespace

std::vector<NamedCommand> methods_of(std::string_view name) {
    std::vector<NamedCommand> result;
    std::string const prefix = std::string(name) + " ";
    for (RegisteredOperation const& entry : operations()) {
        if (!entry.name.starts_with(prefix)) continue;
        std::string const full(entry.name);
        result.push_back({full.substr(prefix.size()), operation_command(full)});
    }
    std::sort(result.begin(), result.end(),
              [](NamedCommand const& a, NamedCommand const& b) { return a.name < b.name; });
    return result;
}

Verb find_verb(std::vector<std::string> const& words) {
    if (words.empty()) throw Error(ErrorKind::usage, "missing command", "'vkt help' lists the commands");
    Verb verb{words.front(), lookup(commands(), words.front()), {words.begin() + 1, words.end()}};
    if (verb.command == nullptr) unknown_verb(verb.name);
    if (verb.command->verbs.empty()) return verb;
    if (verb.words.empty() || verb.words.front().starts_with("-"))
        return verb; // help, or a complaint by whoever runs it
    Command const* const sub = lookup(verb.command->verbs, verb.words.front());
    if (sub == nullptr) unknown_method(verb.name, verb.words.front(), names_of(verb.command->verbs));
    return {verb.name + " " + verb.words.front(), sub, {verb.words.begin() + 1, verb.words.end()}};
}

Invocation::Invocation(Verb verb, Place place) : verb_(std::move(verb)), place_(place) {
    Command const& c = *verb_.command;
    CommonKind kind;
    int inputs = 0;
    if (c.operation) operation_ = c.operation();
    if (c.consumer) consumer_ = c.consumer();
    if (operation_ && operation_->shape() == Shape::reduction)
        consumer_ = std::make_unique<Measure>(std::move(operation_));
    if (operation_) {
        operation_->parameters(own_);
        inputs = operation_->inputs();
        inputs_are_parameters_ = !operation_->input_names().empty();
        kind.volume_output = true;
        kind.report_file = operation_->reports();
        kind.input = inputs > 0 || operation_->like() != nullptr;
    } else if (consumer_) {
        consumer_->parameters(own_);
        inputs = consumer_->inputs();
        inputs_are_parameters_ = !consumer_->input_names().empty();
        kind.file_output = consumer_->writes() && own_.find("output") == nullptr;
        kind.report = consumer_->reports();
        kind.input = true;
    } else if (c.opener) {
        opener_ = c.opener();
        opener_->parameters(own_);
        inputs_are_parameters_ = !opener_->input_names().empty();
        kind.volume_output = true;
        kind.input = opener_->reads();
    }
    common_.declare(shared_, kind);
    // A command that gives an option its own meaning (read --format) takes it from the common ones.
    std::erase_if(shared_.all(), [&](Parameter const& p) { return own_.find(p.name) != nullptr; });
    if (inputs > 0 && !inputs_are_parameters_) {
        Parameter& p =
            positional_inputs_.positional("in", given_inputs_, "input: a file of any known format, a stream, or '-'");
        p.optional().values(1, inputs + (c.takes_output ? 1 : 0)).not_in_history();
    }
}

void Invocation::parse() {
    auto const& words = verb_.words;
    bool const asks = std::any_of(words.begin(), words.end(),
                                  [](auto const& w) { return w == "--help" || w == "-h" || w == "--examples"; });
    if (asks) {
        common_.examples = std::find(words.begin(), words.end(), "--examples") != words.end();
        common_.help = !common_.examples;
        return;
    }
    if (!verb_.command->verbs.empty() && !operation_) {
        std::vector<std::string> names;
        for (auto const& entry : verb_.command->verbs) names.push_back(entry.name);
        throw Error(ErrorKind::usage, text("'vkt ", verb_.name, "' needs one of: ", join(names, ", ")),
                    text("try 'vkt ", verb_.name, " --help'"));
    }
    parse_words(words, {&own_, &positional_inputs_, &shared_}, verb_.name);
    if (verb_.command->takes_output) take_output();
    if (operation_) operation_->check();
    if (consumer_) consumer_->check();
    if (opener_) opener_->check();
    if (yields_volumes()) common_.check_output();
    resolve_inputs();
}

/// IN OUT stands for IN -o OUT.
void Invocation::take_output() {
    if (given_inputs_.size() <= static_cast<std::size_t>(operation_->inputs())) return;
    std::string const out = given_inputs_.back();
    given_inputs_.pop_back();
    if (shared_.given("output"))
        throw Error(ErrorKind::usage, text("two outputs: '", common_.output, "' and '", out, "'"));
    shared_.set("output", {out});
}

void Invocation::resolve_inputs() {
    if (operation_) {
        inputs_ = inputs_are_parameters_ ? operation_->input_names() : given_inputs_;
        auto const n = static_cast<std::size_t>(operation_->inputs());
        while (inputs_.size() < n) inputs_.insert(inputs_.begin(), "-"); // what comes down the pipe is the first
    }
    if (consumer_) {
        inputs_ = inputs_are_parameters_ ? consumer_->input_names() : given_inputs_;
        auto const n = static_cast<std::size_t>(consumer_->inputs());
        // A missing first of two inputs would be surprising; a missing last one is standard input.
        while (inputs_.size() < n) inputs_.emplace_back("-");
    }
    if (opener_) {
        inputs_ = opener_->input_names();
        inputs_are_parameters_ = !inputs_.empty(); // some know only now
    }
    if (std::count(inputs_.begin(), inputs_.end(), "-") > 1)
        throw Error(ErrorKind::usage, "standard input can be read only once",
                    "give the other input as a file or as <(vkt …)");
}

bool Invocation::describes_raw() const {
    return opener_ != nullptr && std::ranges::any_of(own_.all(), [](Parameter const& p) { return p.name == "dims"; });
}

std::vector<std::string> Invocation::history_words() const {
    return vkt::history_words(verb_.name, own_, inputs_, inputs_are_parameters_);
}

} // namespace vkt::shell
