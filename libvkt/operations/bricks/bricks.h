// Bricks of a volume: where each lies, what says so in its header, and the sequence of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/boundary_rule.h"
#include "libvkt/core/parameters.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/voxels/pad.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Voxels along each axis, "N" or "X,Y,Z"; at least 1.
struct BrickSize {
    Index3 dims{64, 64, 64};
    friend bool operator==(BrickSize const&, BrickSize const&) = default;
};

template <> struct ValueText<BrickSize> : OneWord {
    static BrickSize read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(BrickSize const& v);
};

/// Where a brick lies: the voxels of the whole that are its own, and how many more it holds of its neighbours' (or of
/// what continues the volume outside).
struct BrickPlace {
    Index3 whole; ///< dims
    Box core;     ///< in voxels of the whole
    Padding ghost;

    Box stored() const { return {core.lower - ghost.below, core.upper + ghost.above}; }
    friend bool operator==(BrickPlace const&, BrickPlace const&) = default;
};

/// A volume cut into bricks of one size, the last along each axis smaller where it does not divide the extent. Bricks
/// are numbered with x fastest.
struct BrickLattice {
    Index3 whole;
    Index3 size;
    Padding ghost;
    bool filled = false; ///< ghosts reach outside the whole

    Index3 counts() const; ///< bricks along each axis
    std::int64_t count() const { return counts().x * counts().y * counts().z; }
    BrickPlace place(std::int64_t brick) const;
};

/// Says in the attributes brick-whole, brick-core and brick-ghost where a brick lies.
void say_place(Header& header, BrickPlace const& place);
/// What they say; nothing if the header has none of them. Throws Error{data} if they make no sense together, or not
/// with the header's dims.
std::optional<BrickPlace> place_in(Header const& header);
/// The header without them.
Header without_place(Header header);

struct BrickOptions {
    BrickSize size;
    Padding ghost;
    std::optional<BoundaryRule> boundary; ///< continues the whole in ghosts outside of it; none: they end at its faces

    void declare(Parameters& p);
};

/// The bricks of every volume of a source, one after the other, each a volume with the geometry of its place. Bricks of
/// sources that can be read anywhere are read from there; of others a layer of bricks is held, or all of the volume
/// spooled where that takes more than half of the budget. Refuses hierarchical volumes.
std::unique_ptr<Source> brick_source(std::unique_ptr<Source> source, BrickOptions const& options,
                                     Execution const& execution, StageInfo info);

} // namespace vkt
