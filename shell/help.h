// Help texts, all from the declarations.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/invocation.h"

#include <string>
#include <vector>

namespace vkt::shell {

std::string overview();                               ///< `vkt help`
std::string verb_list();                              ///< one verb a line, sub-verbs as "filter gaussian"
std::string command_help(Invocation& invocation);     ///< examples first
std::string command_examples(Command const& command); ///< one command line a line
std::string common_help();                            ///< the options that all commands share
std::string search(std::string const& word);          ///< verbs whose texts mention the word
/// The command that people mean who use another word for it ("blur"), or a method's alone ("gaussian"), among those
/// whose names begin so; empty if none is known.
std::string command_of_synonym(std::string const& word, std::string const& among = {});

} // namespace vkt::shell
