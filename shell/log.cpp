// spdlog on standard error, without time or level: several stages share one terminal and the stage is what matters.
// SPDX-License-Identifier: MIT
#include "shell/log.h"

#include "libvkt/core/text.h"

#include <spdlog/logger.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>

namespace vkt::shell {
namespace {

namespace level = spdlog::level;

level::level_enum level_of(Verbosity verbosity) {
    switch (verbosity) {
    case Verbosity::quiet:
        return level::err;
    case Verbosity::normal:
        return level::info;
    case Verbosity::verbose:
        break;
    }
    return level::debug;
}

/// The text is no format string, and is put together only if its level is on.
void write(spdlog::logger& logger, level::level_enum of, std::string const& stage, std::string const& message) {
    if (logger.should_log(of)) logger.log(of, spdlog::string_view_t(text(printable(stage), ": ", printable(message))));
}

} // namespace

Log::Log(Verbosity verbosity)
    : verbosity_(verbosity),
      logger_(std::make_shared<spdlog::logger>("vkt", std::make_shared<spdlog::sinks::stderr_sink_mt>())) {
    logger_->set_pattern("%v");
    logger_->set_level(level_of(verbosity));
    logger_->set_error_handler([](std::string const&) {}); // there is no other place to complain in
}

void Log::error(std::string const& stage, std::string const& message) const {
    write(*logger_, level::err, stage, message);
}
void Log::note(std::string const& stage, std::string const& message) const {
    write(*logger_, level::info, stage, message);
}
void Log::detail(std::string const& stage, std::string const& message) const {
    write(*logger_, level::debug, stage, message);
}
void Log::answer(std::string lines) const {
    if (lines.ends_with('\n')) lines.pop_back();
    logger_->log(level::err, spdlog::string_view_t(lines));
}

} // namespace vkt::shell
