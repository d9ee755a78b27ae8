// Permute: the axes of a volume in another order, or turned towards those of the body.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"

#include <array>

namespace vkt {

/// "zyx": the axes of the result, x first, by their names in the input. "ras": where the axes of the result point, as
/// index grows: right or left, anterior or posterior, superior or inferior, each of which an axis is chosen for and
/// reversed if need be, so that the sum of their cosines is largest. Bytes are moved, and voxels keep their world
/// positions: spacings and directions move with their axes. Axes that change places with z read slices in another
/// order.
class Permute : public Operation {
public:
    Permute() = default;
    explicit Permute(std::string order) : order_(std::move(order)) {}

    std::string_view name() const override { return "permute"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    /// Throws Error{usage} if the volume must be turned and does not say what its world's axes mean.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    std::optional<BrickSequence> move_bricks(BrickSequence input, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

private:
    /// What becomes of the axes.
    struct Turn {
        std::array<int, 3> axes{0, 1, 2}; ///< axis k of the result is axis axes[k] of the input
        std::array<bool, 3> reversed{};   ///< by axes of the input
        Index3 dims;                      ///< of the input

        Index3 permuted(Index3 v) const { return {v[axes[0]], v[axes[1]], v[axes[2]]}; }
        /// The box of the input that an output box is made of, or of a tree's input, what becomes of it.
        Box source(Box const& output) const;
        Box target(Box const& input) const;
    };
    Turn turn_of(Header const& in) const;
    Turn turn_towards_body(Header const& in) const;

    std::string order_;
    Turn turn_;
};

} // namespace vkt
