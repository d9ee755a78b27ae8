// spdlog on standard error, without time or level: several stages share one terminal and the stage is what matters.
// SPDX-License-Identifier: MIT
#include "shell/log.h"

#include "libvkt/core/text.h"

#include <spdlog/logger.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>

namespace vkt::shell {
namespace {

void write(std::string const& stage, std::string const& message) {
    spdlog::logger logger("vkt", std::make_shared<spdlog::sinks::stderr_sink_st>());
    logger.set_pattern("%v");
    logger.log(spdlog::level::info, printable(stage) + ": " + printable(message));
}

} // namespace

Log::Log(Verbosity verbosity) : verbosity_(verbosity) {}
void Log::error(std::string const& stage, std::string const& message) const { write(stage, message); }
void Log::note(std::string const& stage, std::string const& message) const {
    if (verbosity_ >= Verbosity::normal) write(stage, message);
}
void Log::detail(std::string const& stage, std::string const& message) const {
    if (verbosity_ >= Verbosity::verbose) write(stage, message);
}

} // namespace vkt::shell
