// The shared options and what they mean for execution.
// SPDX-License-Identifier: MIT
#include "shell/common.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/request.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

namespace vkt::shell {
namespace {

std::string environment(char const* name) {
    char const* const value = std::getenv(name);
    return value == nullptr ? "" : value;
}

} // namespace

bool is_about_output(std::string const& option) {
    auto const names = {"output", "force", "format", "compress", "no-checksum"};
    return std::find(names.begin(), names.end(), option) != names.end();
}

void Common::declare(Parameters& p, CommonKind kind) {
    if (kind.volume_output || kind.file_output) {
        p.option("output", output, "OUT", "output file, '-' for standard output (the default)")
            .short_form('o')
            .not_in_history();
        p.flag("force", force, "overwrite an existing output file").not_in_history();
    }
    if (kind.volume_output) {
        p.option("format", format, "F", "output format, if the file name does not tell it").not_in_history();
        p.flag("compress", compress, "compress the output file, where the format can").not_in_history();
        p.flag("no-checksum", no_checksum, "do not checksum the voxels in the stream").not_in_history();
        p.flag("no-history", no_history, "do not record this command in the volume's history").not_in_history();
        p.option("transport", transport, "T", "how voxels travel to the next stage: pipe, shm or gpu (VKT_TRANSPORT)")
            .not_in_history();
    }
    if (kind.report_file)
        p.option("report", report_file, "FILE",
                 "write what was found to this file: .csv a table, .txt a text, else JSON")
            .not_in_history();
    if (kind.input) ReadRequest::declare_trust(p, trust_paths);
    if (kind.report) p.flag("json", json, "report as JSON").not_in_history();
    ExecutionOptions::declare(p);
    p.flag("dry-run", dry_run, "print the plan, move no voxels").short_form('n').not_in_history();
    if (kind.input)
        p.option("budget", budget, "E",
                 "after a dry run: print the pipeline that keeps its error to E, a physical value, and costs least")
            .not_in_history();
    p.flag("explain", explain, "print method, error bound and cost").not_in_history();
    p.flag("timing", timing, "let the last stage print a table of times (VKT_TIMING=1)").not_in_history();
    p.flag("strict", strict, "fail if voxels are clipped, or not a number where the result has none").not_in_history();
    p.flag("quiet", quiet, "print errors only").short_form('q').not_in_history();
    p.flag("verbose", verbose, "print more").short_form('v').not_in_history();
    p.flag("help", help, "print this help").short_form('h').not_in_history();
    p.flag("examples", examples, "print the examples as commands, one a line").not_in_history();
}

bool Common::streams() const { return ipc::is_stream_file(output, format) || (format.empty() && output == "-"); }

void Common::check_output() const {
    if (compress && streams()) throw Error(ErrorKind::usage, "--compress: streams are not compressed");
    if (no_checksum && !streams()) throw Error(ErrorKind::usage, "--no-checksum: only streams have checksums");
    if (transport && (output != "-" || !streams()))
        throw Error(ErrorKind::usage, "--transport: no other command reads this output");
}

ReportForm Common::report_form() const {
    std::string const suffix = lower_case(std::filesystem::path(report_file).extension().string());
    if (suffix.empty() || suffix == ".json") return ReportForm::json;
    if (suffix == ".csv") return ReportForm::csv;
    if (suffix == ".txt") return ReportForm::text;
    throw Error(ErrorKind::usage, text("--report ", report_file, ": reports of that kind are not written"),
                "end the name in .json, .csv or .txt");
}

ipc::Transport Common::resolved_transport() const {
    if (transport) return *transport;
    std::string const asked = environment("VKT_TRANSPORT");
    return asked.empty() ? ipc::Transport::pipe : parse_enum<ipc::Transport>(asked, "VKT_TRANSPORT");
}

bool Common::wants_timing() const {
    std::string const asked = environment("VKT_TIMING");
    return timing || (!asked.empty() && asked != "0");
}

} // namespace vkt::shell
