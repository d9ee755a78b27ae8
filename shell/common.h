// Options that every command shares, declared in one place.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/stream.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/core/report.h"

#include <optional>
#include <string>

namespace vkt {
template <> struct EnumNames<ipc::Transport> {
    static std::vector<std::pair<ipc::Transport, char const*>> all() {
        return {{ipc::Transport::pipe, "pipe"}, {ipc::Transport::shm, "shm"}, {ipc::Transport::gpu, "gpu"}};
    }
};
} // namespace vkt

namespace vkt::shell {

/// True of options that say where the output goes, and how.
bool is_about_output(std::string const& option);

/// What kinds of output a command has decides which options it gets.
struct CommonKind {
    bool volume_output = false; ///< writes volumes: -o, --force, --format, --no-checksum
    bool file_output = false;   ///< writes its own file: -o, --force
    bool report = false;        ///< --json
    bool report_file = false;   ///< --report FILE
    bool input = false;         ///< reads volumes: --trust-paths
};

struct Common : ExecutionOptions {
    std::optional<ipc::Transport> transport;
    bool dry_run = false, explain = false, timing = false, strict = false, quiet = false, verbose = false, json = false;
    bool trust_paths = false;
    bool force = false, no_checksum = false, no_history = false, compress = false;
    std::string output = "-";
    std::string report_file; ///< where the operation's report goes; empty: nowhere
    std::string format;
    std::optional<double> budget; ///< of the error of a pipeline that is only planned
    bool help = false, examples = false;

    void declare(Parameters& parameters, CommonKind kind);
    /// Throws Error{usage} for options that the output, a stream or a file, has no use for.
    void check_output() const;
    /// What the name of the report's file asks for; throws Error{usage} for names of other kinds of files.
    ReportForm report_form() const;
    bool streams() const; ///< volumes leave as a stream, through a pipe or into a file
    ipc::Transport resolved_transport() const;
    bool wants_timing() const;
};

} // namespace vkt::shell
