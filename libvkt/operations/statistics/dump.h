// The values of a volume as text, in volkit's layout.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Prints physical values, slice by slice.
class Dump : public Operation {
public:
    Roi roi;                           ///< part to print; empty: all
    std::optional<Index3> first, last; ///< the same in volkit's spelling

    std::string_view name() const override { return "dump"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    std::vector<std::string> input_names() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    /// Text is all there is.
    bool prints(ReportForm form) const override { return form == ReportForm::text; }
    Plan plan(std::span<Header const> inputs) const override;
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override;

private:
    SteppedBox region(Index3 dims) const;

    std::string in_, file_;
};

/// volkit's name for it, with a range that must be given.
class DumpRange : public Dump {
public:
    std::string_view name() const override { return "dump-range"; }
    Texts texts() const override;
    void check() const override;
};

} // namespace vkt
