// Operations that make no volume but report: what the command line adds to them.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/command.h"

#include <vector>

namespace vkt::shell {

/// Reads its inputs and prints the reports.
class Measure : public Consumer {
public:
    explicit Measure(std::unique_ptr<Operation> operation) : operation_(std::move(operation)) {}
    void parameters(Parameters& p) override;
    void check() const override;
    int inputs() const override { return operation_->inputs(); }
    std::vector<std::string> input_names() const override { return operation_->input_names(); }
    bool reports() const override { return prints_json_; }
    bool runs_on_gpu() const override { return operation_->runs_on_gpu(); }
    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override;

protected:
    Operation const& operation() const { return *operation_; }
    bool csv() const { return csv_; } ///< --csv was given
    /// Sees the operation as it is after each volume.
    virtual void found(Operation const&) {}
    virtual void print(std::vector<Report> const& reports, ReportForm form, Context& context) const;

private:
    std::unique_ptr<Operation> operation_;
    bool prints_json_ = false, csv_ = false;
};

} // namespace vkt::shell
