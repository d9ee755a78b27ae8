// Measuring and printing.
// SPDX-License-Identifier: MIT
#include "shell/measure.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

namespace vkt::shell {

void Measure::parameters(Parameters& p) {
    operation_->parameters(p);
    prints_json_ = operation_->prints(ReportForm::json);
    if (operation_->prints(ReportForm::csv))
        p.flag("csv", csv_, "print CSV: names, then a line for each volume or row").not_in_history();
}

void Measure::check() const {
    operation_->check();
    if (csv_ && !operation_->prints(ReportForm::csv))
        throw Error(ErrorKind::usage, "--csv contradicts what else is asked for, which is printed as JSON");
}

void Measure::print(std::vector<Report> const& reports, ReportForm form, Context& context) const {
    Report::print_blocks(reports, form, [&](std::string_view block) { context.print(std::string(block)); });
}

int Measure::consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) {
    if (csv_ && context.json()) throw Error(ErrorKind::usage, "--csv and --json: the report has one form");
    // What can be printed in one form alone is.
    bool const json = context.json() || !operation_->prints(ReportForm::text);
    std::vector<Report> reports;
    Measurement measurement{
        .inputs = inputs,
        .execution = context.execution(),
        .info = context.stage_info(),
        .form = csv_   ? ReportForm::csv
                : json ? ReportForm::json
                       : ReportForm::text,
        .report =
            [&](Report report) {
                reports.push_back(std::move(report));
                found(*operation_);
            },
        .print = [&](std::string_view lines) { context.print(std::string(lines)); },
    };
    std::vector<Error> failures;
    if (inputs.size() > 1) measurement.failed = [&](Error const& e) { failures.push_back(e); };
    measurement.info.format = [&context](std::string const& input) { return context.format(input); };
    operation_->measure(measurement);
    if (!reports.empty()) print(reports, measurement.form, context); // none: a dry run
    if (!failures.empty())                                           // with the code of the first
        throw Error(failures.front().kind(),
                    join(collect(failures, [](Error const& e) { return std::string(e.what()); }), "; "),
                    failures.front().hint());
    return operation_->satisfied() ? 0 : 1;
}

} // namespace vkt::shell
