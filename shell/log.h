// Lines on standard error. The only place with spdlog.
// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>

namespace spdlog {
class logger;
}

namespace vkt::shell {

enum class Verbosity : int { quiet = 0, normal = 1, verbose = 2 };

/// A logger whose levels are error, note and detail. Prefixes every line with the stage ("vkt crop: …"). A message is
/// one line: what a terminal would act on is escaped. Copies share the logger; threads may use it at the same time.
class Log {
public:
    explicit Log(Verbosity verbosity = Verbosity::normal);
    void error(std::string const& stage, std::string const& message) const;  ///< at any verbosity
    void note(std::string const& stage, std::string const& message) const;   ///< unless quiet
    void detail(std::string const& stage, std::string const& message) const; ///< if verbose
    /// Whole lines as they are, each with its stage: what was asked for (--dry-run, --explain, --timing), at any
    /// verbosity.
    void answer(std::string lines) const;
    Verbosity verbosity() const { return verbosity_; }

private:
    Verbosity verbosity_;
    std::shared_ptr<spdlog::logger> logger_;
};

} // namespace vkt::shell
