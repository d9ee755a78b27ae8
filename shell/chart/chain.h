// A pipeline of operations on volumes in memory, or of one that ends with a picture: run under settings of its knobs,
// with what its plans promise.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"
#include "libvkt/engine/tunable.h"
#include "shell/invocation.h"
#include "shell/machine/calibration.h"
#include "shell/picture/picturing.h"

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

/// Of the finite stored values; zeros if there are none.
struct Extremes {
    double low = 0, high = 0, magnitude = 0;
};
Extremes extremes_of(Volume const& volume);

Volume in_float64(Volume const& volume);

class Chain {
public:
    /// Throws Error{usage} unless every stage is an operation that makes one volume of the one before, but for the
    /// last, which may make a picture of it.
    explicit Chain(std::string const& line);

    std::deque<Invocation>& stages() { return stages_; }
    /// Null if the stage has no knobs.
    Tunable const* tunable(std::size_t stage) const;
    /// What makes a picture at the end; null if a volume comes out.
    Picturing const* picturing() const;
    /// Gives a stage's option another value, or sets a flag, whatever the value. Throws Error{usage} where it does not
    /// go together with the others.
    void set(std::size_t stage, std::string const& option, std::string const& value);
    /// The knobs whose values the bounds are about, at their most exact. After plan() or run(): knobs are those of a
    /// volume.
    void set_exact();
    /// The stages as words for a shell.
    std::vector<std::string> lines();

    /// Throws what the stages throw, and Error{usage} if the result is hierarchical.
    Volume run(Volume const& input, Execution const& execution, PictureRequest const& request = {});

    /// What would be computed, without computing it: methods, types, costs and bounds as one text. Reasons for a
    /// method, which plans tell after a semicolon, are left out. From then on the stages tell of their knobs for this
    /// volume.
    std::string plan(Volume const& input, Execution const& execution);

    /// True if what the stages do to a part of a volume is what they do to that part in the whole: nothing depends on
    /// all voxels, on how many there are, or on where they lie.
    bool fits_part(Header const& whole, Header const& part);

    /// Describes what comes out of the operations, without computing it.
    Header output(Volume const& input, Execution const& execution);
    /// The part of the input that what comes out of the operations is made of: their footprints, the last one's first.
    Box part_read(Volume const& input, Execution const& execution);

    /// Multiply-adds of the last run, as planned.
    double cost() const;
    /// Seconds that the last run computes by what was measured of this machine; none where that tells nothing: of
    /// pictures and hierarchical volumes.
    std::optional<double> seconds(Calibration const& calibration, int threads) const;
    /// Seconds that the last run drew pictures.
    double drawing() const { return drawing_; }
    /// True if the last run could use a GPU where that was asked for.
    bool uses_gpu() const;
    /// True if the last run clipped values, or met some that are no numbers.
    bool lossy() const { return lossy_; }
    /// How far the last run's output may be from the exact result computed in float64, as physical values: known where
    /// one stage computes and the others only move voxels, and that stage knows it from the input's extremes alone,
    /// none of which is within a factor of a million of its type's largest.
    std::optional<double> bound(Volume const& input, Volume const& output, Execution const& execution);

private:
    /// Of operations, which come first.
    std::size_t operations() const { return stages_.size() - (picturing() != nullptr ? 1 : 0); }
    std::unique_ptr<Source> attached(Volume const& input, Execution const& execution, std::size_t count);
    Volume run_first(Volume const& input, Execution const& execution, std::size_t count);

    std::deque<Invocation> stages_;
    std::vector<Plan> plans_;
    std::vector<Header> headers_; ///< of the stages' inputs
    Header drawn_;                ///< of what the picture is made of
    double drawing_ = 0;
    bool drawn_on_gpu_ = false;
    bool lossy_ = false;
};

} // namespace vkt::shell
