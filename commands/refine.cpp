// vkt refine: a structured volume as a hierarchical one.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/refine.h"

#include "libvkt/core/error.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/pipeline.h"
#include "shell/command.h"
#include "shell/terminal.h"

#include <cmath>

namespace vkt::shell {
namespace {

/// What the user asks for; tolerance and background are physical values.
struct Request {
    RefineOptions options;
    std::optional<double> background;
};

/// Volumes are read whole, since a tree has no slabs.
class RefineSource : public SourceDecorator {
public:
    RefineSource(std::unique_ptr<Source> source, Request request, Execution execution, std::vector<std::string> words)
        : SourceDecorator(std::move(source)), request_(request), execution_(std::move(execution)),
          words_(std::move(words)) {}

    bool next_volume() override {
        if (!inner().next_volume()) return false;
        header_ = inner().header();
        if (header_.kind == Kind::hierarchical)
            throw Error(ErrorKind::usage, "the volume is hierarchical already", "make it a grid first: vkt resample");
        if (header_.history) header_.history = History{words_, {*header_.history}};
        if (header_.dry_run) return true;
        RefineOptions options = request_.options;
        ValueMap const values = header_.values;
        options.tolerance /= std::abs(values.slope);
        if (request_.background) options.background = values.stored(*request_.background);
        std::optional<History> const history = header_.history;
        tree_ = refine(load(inner(), execution_), options, execution_);
        tree_.header().history = history;
        tree_.header().timing = header_.timing;
        header_ = tree_.header();
        return true;
    }

    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    std::optional<ConstView> borrow(Box const&) override { return std::nullopt; }
    bool narrow(Roi const&, WorldRoi const&) override { return false; }
    Volume load_hierarchical() override { return std::move(tree_); }
    void finish() override {
        if (header_.dry_run) inner().finish(); // otherwise load() has read to the end
    }

private:
    Request request_;
    Execution execution_;
    std::vector<std::string> words_;
    Header header_;
    Volume tree_;
};

class Refine : public Opener {
public:
    void parameters(Parameters& p) override {
        RefineOptions& options = request_.options;
        p.positional("in", path_, "input: a file of any known format, a stream, or '-'").optional();
        p.option("tolerance", options.tolerance, "T", "largest difference at voxel centres, in physical values")
            .needed();
        p.option("block-size", options.block, "N", "cells of a block along each axis, 1 to 64 (8)");
        p.option("levels", options.levels, "N", "most levels, 1 to 16 (8)");
        p.option("method", options.method, "METHOD",
                 "the reconstruction that keeps to the tolerance: basis or nearest");
        p.option("background", request_.background, "VALUE",
                 "leave out blocks that stay within the tolerance of this value");
    }

    void check() const override {
        RefineOptions const& options = request_.options;
        if (!(options.tolerance >= 0))
            throw Error(ErrorKind::usage, text("--tolerance ", options.tolerance, " is negative"));
        if (options.method != Reconstruction::basis && options.method != Reconstruction::nearest)
            throw Error(ErrorKind::usage,
                        text("--method ", enum_name(options.method), " cannot promise a tolerance at voxel centres"),
                        "use --method basis or --method nearest");
    }

    std::unique_ptr<Source> open(Context& context) override {
        std::string const path = path_.empty() ? "-" : path_;
        if (path == "-" && input_is_terminal())
            throw Error(ErrorKind::usage, "no input: standard input is a terminal",
                        "name a file, or pipe a volume in; see 'vkt refine --help'");
        std::vector<std::string> words{"refine", "--tolerance", to_text(request_.options.tolerance)};
        auto const add = [&words](char const* option, std::string const& value) {
            words.emplace_back(option);
            words.push_back(value);
        };
        RefineOptions const usual;
        RefineOptions const& options = request_.options;
        if (options.block != usual.block) add("--block-size", to_text(options.block));
        if (options.levels != usual.levels) add("--levels", to_text(options.levels));
        if (options.method != usual.method) add("--method", enum_name(options.method));
        if (request_.background) add("--background", to_text(*request_.background));
        return std::make_unique<RefineSource>(context.open(path), request_, context.execution(), std::move(words));
    }

private:
    std::string path_;
    Request request_;
};

} // namespace

Command refine_command() {
    return opener_command<Refine>(
        {"Make a structured volume hierarchical.",
         "Keeps fine blocks only where coarser ones do not reproduce the voxels: what vkt resample makes of the result "
         "at the voxels' centres differs by no more than the tolerance.",
         {{"Within a hundredth",
           "vkt make sphere --dims 64 48 48 --edge coverage | vkt refine --tolerance 0.01 | vkt info"},
          {"There and back", "vkt refine volume.nrrd --tolerance 1 | vkt resample --scale 1 | vkt diff volume.nrrd - "
                             "--tolerance 1"}}});
}

} // namespace vkt::shell
