// What consumers see of a stage.
// SPDX-License-Identifier: MIT
#include "shell/run/runner.h"

#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/output_file.h"
#include "shell/run/plan_text.h"

#include <utility>

namespace vkt::shell {

bool StageContext::dry_run() const { return runner_.dry_run(); }
bool StageContext::window() const { return runner_.window(); }
StageInfo StageContext::stage_info() const { return runner_.stage_info(invocation_); }
void StageContext::note(std::string const& message) { runner_.log().note(invocation_.stage(), message); }
void StageContext::lossy(std::string const& message) {
    if (invocation_.common().strict) throw Error(ErrorKind::data, text("--strict: ", message));
    runner_.hold_remark(invocation_.stage(), message);
}
void StageContext::refuse_lossy() { runner_.refuse_lossy(); }
std::function<void(std::string const&)> StageContext::detail() {
    return
        [log = runner_.log(), stage = invocation_.stage()](std::string const& message) { log.detail(stage, message); };
}
std::string StageContext::format(std::string const& input) const { return runner_.format(input); }
std::unique_ptr<Source> StageContext::open(std::string const& path, ReadOptions const& stated) {
    if (path == "-" && previous_ && !stated.describes()) return std::move(previous_);
    return runner_.open(invocation_, path, stated);
}

void StageContext::plan(Header const& header, std::string const& output) {
    bool const whole = (invocation_.consumer() != nullptr && invocation_.consumer()->needs_whole()) ||
                       format_of_name(output) == "vdb"; // OpenVDB's trees are made in memory
    std::optional<std::size_t> held;
    if (whole) held = invocation_.consumer()->bytes_held(header, output);
    runner_.log().answer(consumer_plan_text(invocation_.stage(), header, output, held, execution_));
    if (invocation_.verb().name == "write") runner_.predict_writing(invocation_, header);
    explain(header);
}

void StageContext::explain(Header const& header) const {
    for (auto const& line : invocation_.consumer()->explain(header, output()))
        runner_.log().answer(text(invocation_.stage(), ":   ", printable(line)));
}

void StageContext::print(std::string const& report) {
    OutputFile file(output(), force());
    file.write(report.data(), report.size());
    file.commit();
}

} // namespace vkt::shell
