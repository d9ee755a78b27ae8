// Lines on standard error. The only place with spdlog.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt::shell {

enum class Verbosity : int { quiet = 0, normal = 1, verbose = 2 };

/// Prefixes every line with the stage ("vkt crop: …"). A message is one line: what a terminal would act on is escaped.
/// Errors are printed at any verbosity.
class Log {
public:
    explicit Log(Verbosity verbosity = Verbosity::normal);
    void error(std::string const& stage, std::string const& message) const;
    void note(std::string const& stage, std::string const& message) const;   ///< unless quiet
    void detail(std::string const& stage, std::string const& message) const; ///< if verbose
    Verbosity verbosity() const { return verbosity_; }

private:
    Verbosity verbosity_;
};

} // namespace vkt::shell
