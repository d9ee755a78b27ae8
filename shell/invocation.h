// One command with its parameters parsed: a stage that is ready to run.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/command.h"
#include "shell/common.h"

#include <memory>
#include <string>
#include <vector>

namespace vkt::shell {

/// A verb and what it names. `name` is "filter gaussian" for sub-verbs.
struct Verb {
    std::string name;
    Command const* command = nullptr;
    std::vector<std::string> words; ///< what follows the verb
};

/// Finds the command; throws Error{usage} with a suggestion for unknown verbs and missing sub-verbs.
Verb find_verb(std::vector<std::string> const& words);

class Invocation {
public:
    /// Whether a process is the stage, or `vkt pipe` runs it.
    enum class Place : bool { process, pipeline };
    /// Declares the parameters; parse() reads them.
    explicit Invocation(Verb verb, Place place = Place::process);
    Invocation(Invocation const&) = delete; // the parameters point at its members
    Invocation& operator=(Invocation const&) = delete;

    /// Parses the words and checks what can be checked without input. Unless help was asked for.
    void parse();

    /// What lines of the process begin with, errors included.
    std::string process() const {
        return "vkt " + (label().empty() ? verb_.name.substr(0, verb_.name.find(' ')) : "pipe");
    }
    /// What follows it where the process has several stages: the stage's name; else empty.
    std::string label() const { return place_ == Place::pipeline ? verb_.name : ""; }
    /// Both: what remarks of the stage begin with.
    std::string stage() const { return label().empty() ? process() : process() + ": " + label(); }
    Verb const& verb() const { return verb_; }
    Command const& command() const { return *verb_.command; }
    Common const& common() const { return common_; }
    Common& common() { return common_; }
    Parameters& own_parameters() { return own_; }
    Parameters& common_parameters() { return shared_; }

    Operation* operation() const { return operation_.get(); } ///< that makes volumes; a Measure holds the others
    Consumer* consumer() const { return consumer_.get(); }
    Opener* opener() const { return opener_.get(); }

    /// Paths of the inputs, "-" for standard input or the stage before.
    std::vector<std::string> const& inputs() const { return inputs_; }
    /// True if it takes descriptions of bare voxels, as vkt read does.
    bool describes_raw() const;
    /// True if volumes come out.
    bool yields_volumes() const { return operation_ != nullptr || opener_ != nullptr; }
    /// The words that the history keeps, with placeholders for inputs (see StageInfo).
    std::vector<std::string> history_words() const;

private:
    void take_output();
    void resolve_inputs();

    Verb verb_;
    Place place_;
    Common common_;
    Parameters own_, shared_, positional_inputs_;
    std::vector<std::string> given_inputs_, inputs_;
    bool inputs_are_parameters_ = false;
    std::unique_ptr<Operation> operation_;
    std::unique_ptr<Consumer> consumer_;
    std::unique_ptr<Opener> opener_;
};

} // namespace vkt::shell
