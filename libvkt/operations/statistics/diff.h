// Comparing two volumes as an operation: what differs, how much, and how alike they look.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/stepped_region.h"
#include "libvkt/operations/statistics/difference.h"

#include <optional>

namespace vkt {

/// Reports a DifferenceResult for each pair of volumes of its two inputs. Not satisfied if a pair differs by more than
/// the tolerance, or in size.
class Diff : public Operation {
public:
    Roi roi; ///< part to look at; empty: all
    double tolerance = 0;
    bool geometry = false; ///< not satisfied either if origin, spacing or direction differ
    bool ssim = false, information = false;
    std::optional<double> ssim_range; ///< that of the first volume if not given
    std::optional<int> bins;          ///< of each volume for the mutual information

    std::string_view name() const override { return "diff"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return 2; }
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override;
    bool runs_on_gpu() const override { return !ssim && !information && !roi.has_steps(); }
    bool satisfied() const override { return satisfied_; }

private:
    Report compared(Measurement& to);

    SteppedRegion region_;
    bool satisfied_ = true;
};

} // namespace vkt
