// Synthetic hierarchical volumes: balanced block trees of any size that hold exact cell averages of analytic fields.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/brick_sequence.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/volume.h"

#include <vector>

namespace vkt {

/// constant: 1. linear: x + 2 y + 3 z with x, y, z in 0…1 over the domain. disk: a stratified, rippled disk with dense
/// clouds over a thin floor, about six decades; smooth, and separable so that cell averages are exact.
enum class AmrField : std::uint8_t { constant, linear, disk };

template <> struct EnumNames<AmrField> {
    static std::vector<std::pair<AmrField, char const*>> all() {
        return {{AmrField::constant, "constant"}, {AmrField::linear, "linear"}, {AmrField::disk, "disk"}};
    }
};

/// A forest of octrees (quadtrees, binary trees along axes of one cell) of equal blocks.
struct AmrRecipe {
    Index3 roots{1, 1, 1}; ///< blocks of refinement level 1
    Index3 block{8, 8, 8}; ///< cells of a block; 1 along an axis with one root leaves that axis flat
    int coarsest = 1;      ///< refinement level everywhere at least, 1 … finest
    int finest = 4;        ///< refinement level at most; the logical grid is roots * block * 2^(finest - 1)
    std::int64_t blocks =
        0; ///< leaf blocks wanted: the tree stops at the first count that is not below; 0: coarsest everywhere
    AmrField field = AmrField::disk;
    DataType dtype = DataType::float32; ///< float32 or float64
};

/// Shape and size of a SILCC snapshot: root blocks 1 x 1 x 20 of 8^3 cells, leaf levels 4…10, a logical grid of
/// 4096 x 4096 x 81920 and 142,190 leaf blocks: leaves come in steps of seven, 142,188 is not one of their counts.
AmrRecipe silcc_like();

/// Builds the tree: refines towards shells around the clouds and the mid-plane, neighbours differ by one level at
/// most. Deterministic. Throws Error{usage} for recipes that make no sense, Error{resources} for more than 2^26 blocks.
/// Cells are computed when they are asked for.
BrickSequence amr_bricks(AmrRecipe const& recipe, Execution const& execution);
/// The same in memory.
Volume make_amr(AmrRecipe const& recipe, Execution const& execution);

/// The field at a position in finest cells, and its mean over a box of them.
double amr_field_value(AmrField field, Index3 logical_dims, Vec3 position);
double amr_field_average(AmrField field, Index3 logical_dims, Vec3 lower, Vec3 upper);

} // namespace vkt
