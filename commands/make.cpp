// vkt make: test fields.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/make_amr.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "shell/command.h"

namespace vkt::shell {

namespace {

/// A hierarchical volume, opened as if it were a file.
class MakeAmr : public Opener {
public:
    void parameters(Parameters& p) override {
        p.option("blocks", blocks_, "N",
                 "leaf blocks: the first possible number that is not below (1000), or all that the levels allow");
        p.option("levels", levels_, "N", "levels of refinement, 1 to 20 (6)");
        p.option("block-size", block_size_, "N", "cells of a block along each axis (8)");
        p.flag("silcc", silcc_, "the tree of a SILCC snapshot: 142,190 blocks on 7 levels, 4096 x 4096 x 81920");
        p.option("field", field_, "FIELD", "disk (stratified, with clouds), linear (x + 2 y + 3 z) or constant (1)");
        p.option("dtype", dtype_, "TYPE", "float32 or float64 (float32)").alias("data-format");
    }

    void check() const override {
        if (silcc_ && (blocks_ || levels_ || block_size_))
            throw Error(ErrorKind::usage, "--silcc says blocks, levels and block size", "leave the others out");
        if (levels_ && (*levels_ < 1 || *levels_ > 20))
            throw Error(ErrorKind::usage, text("--levels ", *levels_, " is not in 1…20"));
        if (blocks_ && *blocks_ < 1) throw Error(ErrorKind::usage, text("--blocks ", *blocks_, " is not positive"));
        if (block_size_ && (*block_size_ < 1 || *block_size_ > 1024))
            throw Error(ErrorKind::usage, text("--block-size ", *block_size_, " is not in 1…1024"));
        if (dtype_ != DataType::float32 && dtype_ != DataType::float64)
            throw Error(ErrorKind::usage, text("--dtype ", dtype_, ": cells are float32 or float64"));
    }

    std::unique_ptr<Source> open(Context& context) override {
        AmrRecipe recipe = silcc_ ? silcc_like() : AmrRecipe{};
        if (!silcc_) {
            std::int64_t const n = block_size_.value_or(8);
            recipe.block = {n, n, n};
            recipe.finest = levels_.value_or(6);
            recipe.blocks = blocks_.value_or(1000);
        }
        recipe.field = field_;
        recipe.dtype = dtype_;
        return brick_source(amr_bricks(recipe, context.execution()));
    }

private:
    std::optional<std::int64_t> blocks_, block_size_;
    std::optional<int> levels_;
    bool silcc_ = false;
    AmrField field_ = AmrField::disk;
    DataType dtype_ = DataType::float32;
};

} // namespace

Command make_command() {
    Command c;
    c.texts = {"Make a test volume.",
               "The same bytes on every machine, whatever the threads and slabs. Values given are stored values.",
               {{"Noise", "vkt make noise --dims 64 48 32 --dtype uint8 --seed 7 | vkt stats"},
                {"A soft ball", "vkt make sphere --dims 64 64 64 --edge coverage | vkt stats"}}};
    c.verbs = {
        {"amr", opener_command<MakeAmr>(
                    {"Make a hierarchical volume (adaptive mesh refinement).",
                     "A balanced octree of equal blocks, refined around clouds and the mid-plane; cells hold exact "
                     "averages of the field.",
                     {{"A few levels", "vkt make amr --blocks 500 --levels 4 | vkt info"},
                      {"Averages of a linear field", "vkt make amr --field linear --dtype float64 | vkt stats"}}})},
        {"checkerboard",
         operation_command("make checkerboard",
                           {"Make cubes of two alternating values.",
                            "",
                            {{"Cubes of four voxels",
                              "vkt make checkerboard --dims 32 32 32 --period 4 --dtype uint8 | vkt stats"}}})},
        {"constant",
         operation_command("make constant",
                           {"Make a volume of one value.",
                            "",
                            {{"All sevens", "vkt make constant --dims 16 16 8 --dtype uint8 --value 7 | vkt stats"}}})},
        {"marschner-lobb",
         operation_command("make marschner-lobb",
                           {"Make the test signal of Marschner and Lobb.",
                            "On [-1, 1] in each axis, sampled at voxel centres; with 40 voxels an axis close to "
                            "the limit that the samples can hold.",
                            {{"As in the paper", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"}}})},
        {"noise",
         operation_command("make noise",
                           {"Make uniform white noise.",
                            "Philox4x32-10, counted by voxel: any part of a volume has the same noise as the whole.",
                            {{"Bytes", "vkt make noise --dims 64 48 32 --dtype uint8 --seed 7 | vkt stats"}}})},
        {"ramp", operation_command("make ramp", {"Make values that rise along an axis.",
                                                 "By default a voxel's value is its index.",
                                                 {{"From 0 to 1 along z",
                                                   "vkt make ramp --dims 16 16 33 --axis z --to 1 | vkt stats"}}})},
        {"sphere",
         operation_command(
             "make sphere",
             {"Make a ball.",
              "With a hard edge, with each voxel's exact share inside, or as signed distance to the surface. Radius "
              "and centre count voxels.",
              {{"A ball with soft edges", "vkt make sphere --dims 64 64 64 --radius 20 --edge coverage | vkt stats"},
               {"Distance field", "vkt make sphere --dims 64 64 64 --edge distance | vkt stats"}}})},
    };
    return c;
}

} // namespace vkt::shell
