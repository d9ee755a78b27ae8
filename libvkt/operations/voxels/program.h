// From an expression's operations to the instructions that kernels run, and what values they may yield.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/losses.h"
#include "libvkt/operations/voxels/expression.h"

#include <span>
#include <vector>

namespace vkt {

/// Voxels that the operations are applied to at a time: rows of so many doubles, a dozen of them, stay in the first
/// cache.
inline constexpr std::int64_t program_piece = 512;

/// slots[to] = op(slots[in]…) for all voxels of a piece.
struct Instruction {
    Op op = Op::number;
    std::uint16_t to = 0;
    std::array<std::uint16_t, 3> in{};
    bool spread = false; ///< computed for one voxel, wanted for all
};

/// A piece of a row of an input, at an offset; what the expression takes of it lies `from` to `until` voxels aside.
struct ProgramRow {
    int volume = 0;
    std::int64_t from = 0, until = 0, y = 0, z = 0;
};
struct ProgramVoxel {
    std::uint16_t slot = 0, row = 0;
    std::int64_t aside = 0; ///< from the row's first
};
struct ProgramNumber {
    std::uint16_t slot = 0;
    double value = 0;
};

/// An expression as a line of instructions. Slots hold the values of pieces: numbers and what depends on nothing but x,
/// or on nothing but y and z, are made once for many pieces.
struct Program {
    std::vector<ProgramNumber> numbers;
    std::vector<Instruction> along_x, per_row, per_voxel;
    std::vector<ProgramRow> rows;
    std::vector<ProgramVoxel> voxels;
    int slots = 0;
    int buffers = 0; ///< slots 0 to buffers - 1 are buffers, the next are the voxels'
    int result = 0;  ///< the slot that is the output
    bool positions = false;

    /// Bytes that a thread needs to run it.
    std::size_t workspace(std::size_t size_of_value) const;
};

/// Positions of voxel i along an axis: first + step * i, in voxels and in the world.
struct ProgramPlace {
    Vec3 first{0, 0, 0}, step{1, 1, 1};
    Vec3 origin;                ///< world position of voxel 0,0,0
    std::array<Vec3, 3> column; ///< world vector to the next voxel along x, y, z
};

/// What is lost: undefined results among the losses, and voxels for which 53 bits did not do.
struct TransformLosses {
    Losses losses;
    std::int64_t inexact = 0;
    std::vector<std::int64_t*> counters() {
        auto all = losses.counters();
        all.push_back(&inexact);
        return all;
    }
};

/// Instructions for an expression without extents (see Expression::with_extent).
Program compile(Expression const& expression);

/// What is known of a node's values: whole numbers or not, and bounds.
struct Values {
    bool whole = false;
    double low = 0, high = 0;
    bool bounded() const;
};

/// The values of every node, given those of the volumes and the positions along x, y, z.
std::vector<Values> values_of(Expression const& expression, std::span<Values const> volumes,
                              std::span<Values const> positions);

} // namespace vkt
