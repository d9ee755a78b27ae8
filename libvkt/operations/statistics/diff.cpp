// Comparing two volumes as an operation: what differs, how much, and how alike they look.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/spool.h"
#include "libvkt/operations/common/stepped_region.h"
#include "libvkt/operations/statistics/difference.h"
#include "libvkt/operations/statistics/similarity.h"

#include <cmath>
#include <optional>
#include <utility>

namespace vkt {

namespace {

/// A source that is finished later, since it is read more than once.
class ReadAgain : public Source {
public:
    explicit ReadAgain(Source& source) : source_(source) {}
    bool next_volume() override { return false; }
    Header const& header() const override { return source_.header(); }
    Access access() const override { return source_.access(); }
    void read(AnyView out) override { source_.read(out); }
    std::optional<ConstView> borrow(Box const& region) override { return source_.borrow(region); }
    void expect(Box const& region) override { source_.expect(region); }
    Space space() const override { return source_.space(); }
    void finish() override {}

private:
    Source& source_;
};

Report report_of(DifferenceResult const& r, bool trees) {
    double const unknown = std::nan("");
    Report report;
    report.add("max_abs", r.comparable() ? r.max_abs : unknown);
    report.add("rmse", r.comparable() ? r.rmse : unknown);
    report.add("psnr", r.comparable() ? r.psnr : unknown);
    report.add("same_geometry", r.same_geometry);
    report.add("same_dims", r.same_dims).add("same_dtype", r.same_type);
    if (trees) report.add("same_tree", r.same_tree);
    report.add("count", r.count).add("differing", r.differing);
    if (r.differing > 0) report.add("first", r.first);
    return report;
}

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
    Texts texts() const override {
        return {"Compare two volumes.",
                "Exit code 0 if no voxel differs by more than the tolerance, 1 if one does or if the sizes differ. "
                "Physical values are compared, whatever the data types. NaN equals NaN. Hierarchical volumes are "
                "compared cell by cell, if they have the same bricks."
                "\n\n"
                "Accuracy: The largest difference is exact in double precision, RMSE to about 1e-15, SSIM to about "
                "1e-12 (estimate); counts behind the mutual information are exact.",
                {{"Is a round trip exact?",
                  "vkt make noise --dims 20 30 40 -o a.vkt && vkt flip x a.vkt | vkt flip x | vkt diff a.vkt"},
                 {"What does a smaller type cost?", "vkt make noise --dims 20 30 40 -o b.vkt && vkt convert b.vkt "
                                                    "--dtype uint8 --range 0:1 | vkt diff b.vkt --tolerance 0.002"},
                 {"How alike do they look?", "vkt filter gaussian volume.nrrd --sigma 1 | vkt diff volume.nrrd --ssim "
                                             "--mutual-information --tolerance 1000"}}};
    }

    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return 2; }
    void parameters(Parameters& p) override {
        p.option("roi", roi, "X0:X1,Y0:Y1,Z0:Z1", "compare only these voxels (half-open); X0:X1:S is every S-th");
        p.option("tolerance", tolerance, "T", "largest absolute difference that counts as equal, a physical value (0)");
        p.flag("geometry", geometry, "also fail if origin, spacing or direction differ");
        p.flag("ssim", ssim, "also the mean structural similarity: Gaussian window of 11 voxels, sigma 1.5");
        p.option("ssim-range", ssim_range, "R",
                 "range of the data for it (that of the first volume; if it is constant, the largest difference)");
        p.flag("mutual-information", information, "also the mutual information, plain (nats) and normalised");
        p.option("bins", bins, "N", "bins of each volume for it, 2 to 1024 (64)");
    }

    void check() const override {
        if (!(tolerance >= 0)) throw Error(ErrorKind::usage, text("--tolerance: ", tolerance, " is negative"));
        if (ssim_range && !ssim) throw Error(ErrorKind::usage, "--ssim-range is for --ssim");
        if (ssim_range && !(*ssim_range > 0 && std::isfinite(*ssim_range)))
            throw Error(ErrorKind::usage, text("--ssim-range: ", *ssim_range, " is not a positive number"));
        if (bins && !information) throw Error(ErrorKind::usage, "--bins is for --mutual-information");
        if (bins && (*bins < 2 || *bins > 1024))
            throw Error(ErrorKind::usage, text("--bins ", *bins, " is not between 2 and 1024"));
    }

    Plan plan(std::span<Header const> inputs) const override {
        require_same_kind(inputs.front(), inputs.back());
        if (inputs.front().kind == Kind::hierarchical && (ssim || information))
            throw Error(
                ErrorKind::usage,
                text(ssim ? "--ssim" : "--mutual-information", " compares grids, and the volumes are hierarchical"),
                "make grids of them first: vkt resample --cells 50M, the other one --like the first");
        Plan plan;
        plan.output = inputs.front();
        plan.scans = ssim || information;
        plan.method = text("differences of physical values", ssim ? ", structural similarity" : "",
                           information ? ", joint histogram" : "");
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = 1e-15;
        plan.cost = 70 + (ssim ? 1200 : 0) + (information ? 240 : 0);
        return plan;
    }

    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override {
        satisfied_ = true;
        if (!roi.empty()) region_.take(to.inputs, roi);
        Source &one = *to.inputs[0], &other = *to.inputs[1];
        auto const note = [&](char const* message) {
            if (to.info.listener) to.info.listener(to.info.name, message, false);
        };
        while (true) {
            bool const a = one.next_volume(), b = other.next_volume();
            if (a != b) {
                note("one of the inputs holds more volumes");
                satisfied_ = false;
            }
            if (!a || !b) break;
            if (only_planned(*this, to)) continue;
            if (!(one.header().dims == other.header().dims)) note("the volumes differ in size");
            to.report(compared(to));
        }
    }

    bool runs_on_gpu() const override { return true; }
    bool satisfied() const override { return satisfied_; }

private:
    Report compared(Measurement& to) {
        Source &one = *to.inputs[0], &other = *to.inputs[1];
        Execution const& execution = to.execution;
        bool const several_passes = (ssim || information) && one.header().dims == other.header().dims;
        // Streams are kept, in memory or in a file, where all of this takes several passes.
        auto const again = [&](Source& source) -> std::unique_ptr<Source> {
            if (source.access() == Access::random) return std::make_unique<ReadAgain>(source);
            return spooled(source, 2, execution, to.info);
        };
        std::unique_ptr<Source> const kept_one = several_passes ? again(one) : nullptr;
        std::unique_ptr<Source> const kept_other = several_passes ? again(other) : nullptr;
        Source &a = several_passes ? *kept_one : one, &b = several_passes ? *kept_other : other;
        // A structural similarity takes a hundred times as long as the differences, a joint histogram three times.
        double const compared = ssim && several_passes ? 0.02 : several_passes ? 0.25 : 1;
        std::optional<ProgressPart> share(std::in_place, execution.monitor, 0.0, compared);
        DifferenceResult r = compare(a, b, execution);
        if (one.header().kind == Kind::structured) r.first = region_.in_whole(r.first);
        double const similar = information ? 0.9 : 0.98;
        if (ssim && several_passes) share.emplace(execution.monitor, compared, similar);
        if (!r.same_tree && to.info.listener)
            to.info.listener(
                to.info.name,
                "the volumes are hierarchical and have different bricks: make grids of them first, with vkt resample",
                false);
        satisfied_ = satisfied_ && r.comparable() && r.max_abs <= tolerance && (!geometry || r.same_geometry);
        Report report = report_of(r, one.header().kind == Kind::hierarchical);
        if (ssim) {
            // Of a constant volume there is no range; differences from it have one.
            double const of_data = r.range > 0 ? r.range : r.max_abs;
            double const range = !several_passes ? std::nan("") : ssim_range.value_or(of_data);
            report.add("ssim", several_passes ? structural_similarity(a, b, range, execution) : range);
            report.add("ssim_range", range);
        }
        if (information) {
            if (several_passes) {
                double const before = ssim ? compared + similar : compared;
                share.emplace(execution.monitor, before, 1 - before);
            }
            MutualInformation const found = several_passes ? mutual_information(a, b, bins.value_or(64), execution)
                                                           : MutualInformation{std::nan(""), std::nan("")};
            report.add("mutual_information", found.information).add("normalized_mutual_information", found.normalised);
        }
        if (several_passes)
            for (Source* const source : {&one, &other})
                if (source->access() == Access::random) source->finish();
        return report;
    }

    SteppedRegion region_;
    bool satisfied_ = true;
};

} // namespace

VKT_OPERATION(Diff, "diff")

} // namespace vkt
