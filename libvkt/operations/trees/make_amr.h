// A made hierarchical volume as an operation.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/make_amr.h"
#include "libvkt/engine/operation.h"

#include <optional>

namespace vkt {

/// The tree and the field of an AmrRecipe.
class MakeAmr : public Operation {
public:
    std::optional<std::int64_t> blocks, block_size; ///< 1000, of 8 cells along each axis
    std::optional<int> levels;                      ///< 6
    bool silcc = false;                             ///< silcc_like() says all of these
    AmrField field = AmrField::disk;
    DataType dtype = DataType::float32;

    std::string_view name() const override { return "make"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::source; }
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    std::optional<BrickSequence> make_bricks(Execution const& execution) override;
    /// That not all of the levels that were asked for have bricks, and why.
    std::vector<Remark> remarks() const override;

private:
    AmrRecipe recipe() const;

    int coarsest_ = 0, finest_ = 0; ///< levels with bricks; the finest of the recipe is 0
};

} // namespace vkt
