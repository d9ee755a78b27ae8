// What the registry knows of an operation, as JSON: for packages that make functions and their help of it.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

namespace vkt {

/// One object: "name"; "alias_of", the operation that the name is another one of, or ""; "summary", "description",
/// "accuracy", the paragraph of the description that begins with that word, and "examples" (objects of "what" and
/// "line"); "result", which is "volume" or "report"; "inputs", how many volumes come before all arguments, 0 where
/// arguments name them; "parameters" and "execution", which are lists of objects: "name", "aliases", "value" (a
/// placeholder), "help", "kind" (flag, choice, type, integer, number, vector, which is a number or three, or text),
/// "positional", "flag", "required", "volume" (it may name an input), "volume_file" (it names a file of a volume that
/// is no input, in whose place a volume in memory may come), "least" and "most" words (most -1: all that follow),
/// "choices", and "default", the words of the default, none if there is none. Throws Error{usage}, with a suggestion,
/// for unknown names.
std::string operation_help(std::string_view name);

} // namespace vkt
