// One tile of a reconstruction: what the drivers of grids, ghost cells and refinement share.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/kernels/tile.h"
#include "libvkt/amr/reconstruct.h"

#include <memory>
#include <span>
#include <vector>

namespace vkt {

inline constexpr Index3 tile_extent{tile::extent_x, tile::extent_y, tile::extent_z};

struct TileMemory;

/// Scratch memory of one thread, about 1 MiB.
class TileWorkspace {
public:
    TileWorkspace();
    ~TileWorkspace();
    TileWorkspace(TileWorkspace&&) noexcept;

    TileMemory& memory() { return *memory_; }

private:
    std::unique_ptr<TileMemory> memory_;
};

/// The rule for a volume whose cells that matter lie in a range.
TileRule tile_rule(Header const& header, Reconstruction method, double background, ValueRange range);

/// The bricks of a volume as kernels see them; its cells are migrated to host memory.
std::vector<tile::Source> tile_sources(Volume const& volume);

/// Says where a brick lies, and its cells.
void place(tile::Source& source, Brick const& brick, Index3 width, std::byte const* cells);

/// Computes the samples of one tile into `out`, whose box contains it; `mask` may be empty.
void compute_tile(tile::Job const& job, TileRule const& rule, AnyView out, AnyView mask, TileWorkspace& workspace,
                  InstructionSet instructions);

/// Computes all samples of out.box from the bricks `ids` (ascending; those that do not matter do no harm), on the
/// calling thread.
void compute_box(std::span<tile::Source const> sources, std::span<std::int32_t const> ids, SampleGrid const& grid,
                 TileRule const& rule, AnyView out, TileWorkspace& workspace, InstructionSet instructions);

} // namespace vkt
