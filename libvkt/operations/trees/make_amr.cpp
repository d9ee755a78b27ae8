// A made hierarchical volume as an operation.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/make_amr.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/operation.h"

#include <algorithm>
#include <optional>

namespace vkt {

namespace {

/// The tree and the field of an AmrRecipe.
class MakeAmr : public Operation {
public:
    std::optional<std::int64_t> blocks, block_size; ///< 1000, of 8 cells along each axis
    std::optional<int> levels;                      ///< 6
    bool silcc = false;                             ///< silcc_like() says all of these
    AmrField field = AmrField::disk;
    DataType dtype = DataType::float32;

    std::string_view name() const override { return "make"; }
    Texts texts() const override {
        return {"Make a hierarchical volume (adaptive mesh refinement).",
                "A balanced octree of equal blocks, refined around clouds and the mid-plane; cells hold exact averages "
                "of the field."
                "\n\n"
                "Accuracy: Fields of integers are exact; those of floats are computed in double precision and rounded "
                "once.",
                {{"A few levels", "vkt make amr | vkt info"},
                 {"Averages of a linear field", "vkt make amr --field linear --dtype float64 | vkt stats"}}};
    }

    Shape shape() const override { return Shape::source; }
    void parameters(Parameters& p) override {
        p.option("blocks", blocks, "N",
                 "leaf blocks: the first possible number that is not below (1000), or all that the levels allow");
        p.option("levels", levels, "N",
                 "levels of refinement at most, 1 to 19 (6); which of them have bricks is a matter of --blocks");
        p.option("block-size", block_size, "N", "cells of a block along each axis (8)");
        p.flag("silcc", silcc, "the tree of a SILCC snapshot: 142,190 blocks on 7 levels, 4096 x 4096 x 81920");
        p.option("field", field, "FIELD", "disk (stratified, with clouds), linear (x + 2 y + 3 z) or constant (1)");
        p.option("dtype", dtype, "TYPE", "float32 or float64 (float32)").alias("data-format");
    }

    void check() const override {
        if (silcc && (blocks || levels || block_size))
            throw Error(ErrorKind::usage, "--silcc says blocks, levels and block size", "leave the others out");
        if (levels && (*levels < 1 || *levels > 19))
            throw Error(ErrorKind::usage, text("--levels ", *levels, " is not in 1…19"));
        if (blocks && *blocks < 1) throw Error(ErrorKind::usage, text("--blocks ", *blocks, " is not positive"));
        if (block_size && (*block_size < 1 || *block_size > 1024))
            throw Error(ErrorKind::usage, text("--block-size ", *block_size, " is not in 1…1024"));
        if (dtype != DataType::float32 && dtype != DataType::float64)
            throw Error(ErrorKind::usage, text("--dtype ", dtype, ": cells are float32 or float64"));
    }

    Plan plan(std::span<Header const>) const override {
        Plan plan;
        plan.output = amr_bricks(recipe(), {}).header();
        plan.passing = ErrorPassing::moved({}); // given
        return plan;
    }

    void begin(std::span<Header const>, Plan const&) override { coarsest_ = finest_ = 0; }

    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    std::optional<BrickSequence> make_bricks(Execution const& execution) override {
        BrickSequence bricks = amr_bricks(recipe(), execution);
        finest_ = recipe().finest, coarsest_ = 0;
        for (Brick const& brick : bricks.bricks())
            finest_ = std::min(finest_, brick.level), coarsest_ = std::max(coarsest_, brick.level);
        return bricks;
    }

    /// That not all of the levels that were asked for have bricks, and why.
    std::vector<Remark> remarks() const override {
        int const asked = levels.value_or(0), there = coarsest_ - finest_ + 1, undivided = asked - 1 - coarsest_;
        if (!levels || there == asked) return {};
        std::string const wanted = text(recipe().blocks);
        std::vector<std::string> why;
        if (undivided > 0)
            why.push_back(text("the coarsest ", undivided, undivided == 1 ? " is" : " are", " divided everywhere"));
        if (finest_ > 0) why.push_back(text("the finest ", finest_, finest_ == 1 ? " is" : " are", " not reached"));
        return {
            {text("bricks are on ", there, " of ", asked, " levels: with --blocks ", wanted, ", ", join(why, " and ")),
             false}};
    }

private:
    AmrRecipe recipe() const {
        AmrRecipe recipe = silcc ? silcc_like() : AmrRecipe{};
        if (!silcc) {
            std::int64_t const n = block_size.value_or(8);
            recipe.block = {n, n, n};
            recipe.finest = levels.value_or(6);
            recipe.blocks = blocks.value_or(1000);
        }
        recipe.field = field;
        recipe.dtype = dtype;
        return recipe;
    }

    int coarsest_ = 0, finest_ = 0; ///< levels with bricks; the finest of the recipe is 0
};

} // namespace

VKT_OPERATION(MakeAmr, "make amr")

} // namespace vkt
