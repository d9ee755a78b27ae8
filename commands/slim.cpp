// vkt slim: no more of a volume than a picture or a result needs.
// SPDX-License-Identifier: MIT
#include "shell/chart/slim.h"

#include "libvkt/core/error.h"
#include "libvkt/core/history.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "shell/command.h"
#include "shell/short_number.h"

#include <cmath>
#include <optional>
#include <utility>

namespace vkt::shell {
namespace {

/// Each volume of a source as its smallest model; volumes that are only planned stay as they are, the most there can
/// be.
class Slimmed : public Source {
public:
    /// `read`: the file that the volumes come from, if the history is to begin with it.
    Slimmed(std::unique_ptr<Source> source, SlimRequest request, std::string read, Context& context)
        : source_(std::move(source)), request_(std::move(request)), read_(std::move(read)), context_(context) {}

    bool next_volume() override {
        model_.reset();
        if (!source_->next_volume()) return false;
        if (source_->header().dry_run) return true;
        if (source_->header().kind == Kind::hierarchical)
            throw Error(ErrorKind::usage, "the input is hierarchical: models are made of grids",
                        "make it a grid first: vkt resample --cells 50M");
        Volume volume = load(*source_, request_.execution);
        if (!volume.header().history && !read_.empty()) { // a file that knows no past begins one
            mark_as_given(volume.header());
            volume.header().history = History{{"read", read_}, {}};
        }
        SlimModel found = slim(volume, request_);
        tell(found);
        model_ = volume_source({std::move(found.volume)});
        return model_->next_volume();
    }
    Header const& header() const override { return model_ ? model_->header() : source_->header(); }
    Access access() const override { return now().access(); }
    void read(AnyView out) override { now().read(out); }
    std::optional<ConstView> borrow(Box const& region) override { return now().borrow(region); }
    void expect(Box const& region) override { now().expect(region); }
    BrickSequence take_bricks() override { return now().take_bricks(); }
    void finish() override { now().finish(); }

private:
    Source& now() const { return model_ ? *model_ : *source_; }

    void tell(SlimModel const& found) const {
        std::string const unit = found.pictures > 0 ? " display levels" : "";
        auto const ms = [](double seconds) { return text(short_number(1000 * seconds), " ms"); };
        if (found.made.empty()) {
            context_.note(text("nothing smaller stays within ", request_.within, unit, " (", found.tried,
                               " models tried): the voxels are those of the input"));
            return;
        }
        auto const bytes = static_cast<double>(found.bytes), before = static_cast<double>(found.bytes_before);
        context_.note(text(bytes_text(bytes), " instead of ", bytes_text(before), " (", short_number(before / bytes),
                           " times smaller), ",
                           found.pictures > 1    ? text(found.pictures, " pictures drawn in ")
                           : found.pictures == 1 ? "drawn in "
                                                 : "computed in ",
                           ms(found.seconds), " instead of ", ms(found.seconds_before)));
        context_.note(text("differs by ", short_number(found.max_error), unit, " at most, root mean square ",
                           short_number(found.rms_error),
                           found.pictures > 0 ? text(", FLIP ", short_number(found.flip)) : std::string(),
                           "; the smallest of ", found.tried, " models tried"));
        std::string ends;
        auto const add = [&](char const* where, std::optional<CutEnd> const& cut) {
            if (cut)
                ends += text(ends.empty() ? "values " : " and ", where, " ", short_number(cut->value), " (",
                             short_number(100 * cut->share), " % of the voxels)");
        };
        add("below", found.below);
        add("above", found.above);
        if (!ends.empty()) context_.note(ends + " are cut off");
        context_.note(text("made by: ", found.made));
    }

    std::unique_ptr<Source> source_, model_;
    SlimRequest request_;
    std::string read_;
    Context& context_;
};

class Slim : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", path_, "input: a file of any known format, a stream, or '-'").optional();
        p.option("for", pipeline_, "PIPELINE", "what the volume is wanted for: operations, perhaps up to a picture")
            .needed();
        p.option("within", within_, "E",
                 "largest difference: display levels of 255 of a picture, physical values of a volume")
            .needed();
    }
    bool reads() const override { return true; }
    std::vector<std::string> input_names() const override { return {path_}; }
    void check() const override {
        if (!(within_ >= 0 && std::isfinite(within_)))
            throw Error(ErrorKind::usage, text("--within ", within_, " is not a finite number >= 0"));
    }
    std::unique_ptr<Source> open(Context& context) override {
        SlimRequest request;
        request.pipeline = pipeline_;
        request.within = within_;
        request.execution = context.execution();
        request.detail = context.detail();
        bool const file = path_ != "-" && !context.stage_info().words.empty();
        return std::make_unique<Slimmed>(context.open(path_), std::move(request), file ? path_ : std::string(),
                                         context);
    }

private:
    std::string path_ = "-", pipeline_;
    double within_ = 0;
};

} // namespace

Command slim_command() {
    return opener_command<Slim>(
        {"No more of a volume than a picture or a result needs.",
         "Models of the volume, the smallest first, are put through the pipeline as it is given, and the first whose "
         "picture (or result) differs by at most --within anywhere is written: cut to what is seen or read, in a "
         "smaller type, over the values that matter with both ends cut off as far as they do not, at a lower "
         "resolution, as bricks that are fine only where they "
         "have to be. What "
         "was saved and what it differs by (the most, the root mean square, and of pictures FLIP) are measured and "
         "said; where nothing smaller holds, the voxels are those of "
         "the input.",
         {{"For this picture, to half a display level", "vkt slim volume.nrrd --for 'render --size 128 --domain 0:500 "
                                                        "--opacity 0,0.2 --unit-distance 1' --within 0.5 "
                                                        "-o small.vkt"},
          {"For a filter whose result is to stay within 2", "vkt make noise --dims 24 24 24 --low 0 --high 500 --dtype "
                                                            "float32 | vkt slim --for 'filter gaussian --sigma "
                                                            "1' --within 2 | vkt info"}}});
}

} // namespace vkt::shell
