// vkt diff: how much two volumes differ.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"
#include "libvkt/operations/difference.h"
#include "shell/command.h"

#include <cmath>

namespace vkt::shell {
namespace {

class Diff : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.option("tolerance", tolerance_, "T", "largest absolute difference that counts as equal (0)");
        p.flag("geometry", geometry_, "also fail if origin, spacing or direction differ");
    }
    void check() const override {
        if (!(tolerance_ >= 0)) throw Error(ErrorKind::usage, text("--tolerance: ", tolerance_, " is negative"));
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
            DifferenceResult const r = compare(*inputs[0], *inputs[1], context.execution());
            if (!r.same_dims) context.note("the volumes differ in size");
            equal = equal && r.same_dims && r.max_abs <= tolerance_ && (!geometry_ || r.same_geometry);
            reports.push_back(report(r));
        }
        context.print(context.json() ? Report::json(reports) : Report::text(reports));
        return equal ? 0 : 1;
    }

private:
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
    bool geometry_ = false;
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
                                             "uint8 --range 0:1 | vkt diff b.vkt --tolerance 0.002"}}});
}

} // namespace vkt::shell
