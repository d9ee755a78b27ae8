// vkt diff: how much two volumes differ.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"
#include "libvkt/engine/spool.h"
#include "libvkt/operations/difference.h"
#include "libvkt/operations/similarity.h"
#include "shell/command.h"

#include <cmath>

namespace vkt::shell {
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
    void finish() override {}

private:
    Source& source_;
};

class Diff : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.option("tolerance", tolerance_, "T", "largest absolute difference that counts as equal (0)");
        p.flag("geometry", geometry_, "also fail if origin, spacing or direction differ");
        p.flag("ssim", ssim_, "also the mean structural similarity: Gaussian window of 11 voxels, sigma 1.5");
        p.option("ssim-range", ssim_range_, "R", "range of the data for it (that of the first volume)");
        p.flag("mutual-information", information_, "also the mutual information, plain (nats) and normalised");
        p.option("bins", bins_, "N", "bins of each volume for it, 2 to 1024 (64)");
    }
    void check() const override {
        if (!(tolerance_ >= 0)) throw Error(ErrorKind::usage, text("--tolerance: ", tolerance_, " is negative"));
        if (ssim_range_ && !ssim_) throw Error(ErrorKind::usage, "--ssim-range is for --ssim");
        if (ssim_range_ && !(*ssim_range_ > 0 && std::isfinite(*ssim_range_)))
            throw Error(ErrorKind::usage, text("--ssim-range: ", *ssim_range_, " is not a positive number"));
        if (bins_ && !information_) throw Error(ErrorKind::usage, "--bins is for --mutual-information");
        if (bins_ && (*bins_ < 2 || *bins_ > 1024))
            throw Error(ErrorKind::usage, text("--bins ", *bins_, " is not between 2 and 1024"));
    }
    int inputs() const override { return 2; }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        std::vector<Report> reports;
        bool equal = true;
        while (true) {
            bool const a = inputs[0]->next_volume(), b = inputs[1]->next_volume();
            if (a != b) {
                context.note("one of the inputs holds more volumes");
                equal = false;
            }
            if (!a || !b) break;
            Similarity similarity;
            DifferenceResult const r = ssim_ || information_ ? compare_more(*inputs[0], *inputs[1], context, similarity)
                                                             : compare(*inputs[0], *inputs[1], context.execution());
            if (!r.same_dims) context.note("the volumes differ in size");
            equal = equal && r.same_dims && r.max_abs <= tolerance_ && (!geometry_ || r.same_geometry);
            reports.push_back(report(r));
            if (ssim_) reports.back().add("ssim", similarity.ssim).add("ssim_range", similarity.range);
            if (information_)
                reports.back()
                    .add("mutual_information", similarity.information.information)
                    .add("normalized_mutual_information", similarity.information.normalised);
        }
        context.print(context.json() ? Report::json(reports) : Report::text(reports));
        return equal ? 0 : 1;
    }

private:
    struct Similarity {
        double ssim = std::nan(""), range = std::nan("");
        MutualInformation information{std::nan(""), std::nan("")};
    };

    /// Streams are kept, in memory or in a file, since all of this takes several passes.
    DifferenceResult compare_more(Source& a, Source& b, Context& context, Similarity& found) const {
        Execution const& execution = context.execution();
        bool const comparable = a.header().kind == Kind::structured && b.header().kind == Kind::structured &&
                                a.header().dims == b.header().dims && !a.header().dry_run && !b.header().dry_run;
        if (!comparable) return compare(a, b, execution);
        auto const again = [&](Source& source) -> std::unique_ptr<Source> {
            if (source.access() == Access::random) return std::make_unique<ReadAgain>(source);
            return spooled(source, 2, execution, context.stage_info());
        };
        auto const one = again(a), other = again(b);
        DifferenceResult const r = compare(*one, *other, execution);
        if (ssim_) {
            found.range = ssim_range_.value_or(r.range);
            found.ssim = structural_similarity(*one, *other, found.range, execution);
        }
        if (information_) found.information = mutual_information(*one, *other, bins_.value_or(64), execution);
        for (Source* const source : {&a, &b})
            if (source->access() == Access::random) source->finish();
        return r;
    }

    static Report report(DifferenceResult const& r) {
        double const unknown = std::nan("");
        Report report;
        report.add("max_abs", r.same_dims ? r.max_abs : unknown);
        report.add("rmse", r.same_dims ? r.rmse : unknown);
        report.add("psnr", r.same_dims ? r.psnr : unknown);
        report.add("same_geometry", r.same_geometry);
        report.add("same_dims", r.same_dims).add("same_dtype", r.same_type);
        report.add("count", r.count).add("differing", r.differing);
        if (r.differing > 0) report.add("first", r.first);
        return report;
    }

    double tolerance_ = 0;
    bool geometry_ = false, ssim_ = false, information_ = false;
    std::optional<double> ssim_range_;
    std::optional<int> bins_;
};

} // namespace

Command diff_command() {
    return consumer_command<Diff>(
        {"Compare two volumes.",
         "Exit code 0 if no voxel differs by more than the tolerance, 1 if one does or if the sizes differ. Physical "
         "values are "
         "compared, whatever the data types. NaN equals NaN.",
         {{"Is a round trip exact?",
           "vkt make noise --dims 20 30 40 -o a.vkt && vkt flip x a.vkt | vkt flip x | vkt diff a.vkt"},
          {"What does a smaller type cost?", "vkt make noise --dims 20 30 40 -o b.vkt && vkt convert b.vkt --dtype "
                                             "uint8 --range 0:1 | vkt diff b.vkt --tolerance 0.002"},
          {"How alike do they look?", "vkt filter gaussian volume.nrrd --sigma 1 | vkt diff volume.nrrd --ssim "
                                      "--mutual-information --tolerance 1000"}}});
}

} // namespace vkt::shell
