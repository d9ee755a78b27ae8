// Expressions over voxels, "v * 2 + sin(x / 10)": from text to a list of operations without repetitions.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Leaves first, then operations on one value, on two, on three.
enum class Op : std::uint8_t {
    number,
    voxel,
    x,
    y,
    z,
    nx,
    ny,
    nz,
    wx,
    wy,
    wz,
    neg,
    abs,
    sqrt,
    exp,
    log,
    log10,
    log2,
    exp2,
    cbrt,
    sin,
    cos,
    tan,
    asin,
    acos,
    sinh,
    cosh,
    tanh,
    erf,
    atan,
    floor,
    ceil,
    round,
    trunc,
    sign,
    not_,
    isnan,
    isinf,
    isfinite,
    add,
    sub,
    mul,
    div,
    min,
    max,
    pow,
    atan2,
    fmod,
    mod,
    hypot,
    lt,
    le,
    eq,
    ne,
    and_,
    or_,
    select,
    clamp,
};

inline bool is_position(Op op) { return op >= Op::x && op <= Op::z; }
inline bool is_extent(Op op) { return op >= Op::nx && op <= Op::nz; }
inline bool is_world(Op op) { return op >= Op::wx && op <= Op::wz; }
/// Yields 0 or 1.
inline bool is_predicate(Op op) { return (op >= Op::not_ && op <= Op::isfinite) || (op >= Op::lt && op <= Op::or_); }
/// Number of values that it takes.
inline int operands_of(Op op) { return op < Op::neg ? 0 : op < Op::add ? 1 : op < Op::select ? 2 : 3; }

/// One operation: what it takes are nodes before it.
struct Node {
    Op op = Op::number;
    std::array<int, 3> in{-1, -1, -1};
    double number = 0; ///< of Op::number
    int volume = 0;    ///< of Op::voxel
    Index3 offset;     ///< … voxels from the one that is computed
};

/// Letters of the volumes of an expression, in their order; e is Euler's number.
inline constexpr std::string_view volume_letters = "vabcdfgh";

/// What an expression says, constants folded, equal parts once, and nothing that the result does not need.
class Expression {
public:
    static constexpr std::size_t most_characters = 16384;
    static constexpr std::size_t most_nodes = 4096;
    static constexpr int most_nesting = 100;
    static constexpr std::int64_t most_offset = 128;

    /// Throws Error{usage} that names the column, counted in characters from 1.
    static Expression parse(std::string_view text);

    /// Nodes before those that take them; the last one is the result.
    std::vector<Node> const& nodes() const { return nodes_; }
    /// Volumes that the text needs: up to the last letter that it names, at least 1.
    int volumes() const { return volumes_; }
    /// True if the text says nan or inf itself.
    bool says_infinite() const { return says_infinite_; }
    template <class Test> bool any(Test test) const {
        for (Node const& node : nodes_)
            if (test(node)) return true;
        return false;
    }
    /// The same with the numbers of voxels along x, y, z as numbers.
    Expression with_extent(Index3 dims) const;

private:
    std::vector<Node> nodes_;
    int volumes_ = 1;
    bool says_infinite_ = false;
};

/// Smallest box of offsets that holds 0 and those of a volume's voxels.
Box offsets_of(Expression const& expression, int volume);

} // namespace vkt
