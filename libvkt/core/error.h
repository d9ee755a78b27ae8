// Errors: one exception type with a kind, thrown anywhere below the shell and caught once above it.
// SPDX-License-Identifier: MIT
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace vkt {

/// What went wrong, seen from the user's side. The numbers are the exit codes of the shell and the codes of the C API.
enum class ErrorKind {
    failure = 1,   ///< the operation itself failed, or a check answered "no"
    usage = 2,     ///< the request makes no sense: option, argument, region
    data = 3,      ///< input is malformed, truncated, or an upstream stage failed
    io = 4,        ///< a file, pipe or disk cannot be read or written
    resources = 5, ///< memory, shared memory, device or limit exhausted
    cancelled = 6, ///< the program that calls the library ended the work
};

/// Message: a lower-case phrase without full stop that names the culprit. Hint: what to do instead; may be empty.
class Error : public std::runtime_error {
public:
    Error(ErrorKind kind, std::string const& message, std::string hint = {})
        : std::runtime_error(message), kind_(kind), hint_(std::move(hint)) {}

    ErrorKind kind() const { return kind_; }
    std::string const& hint() const { return hint_; }

private:
    ErrorKind kind_;
    std::string hint_;
};

/// The same failure was already reported by the stage where it happened; this process only passes the exit code on.
class UpstreamError : public Error {
public:
    explicit UpstreamError(std::string const& message) : Error(ErrorKind::data, message) {}
};

} // namespace vkt
