// The text headers of AMReX plotfiles.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace vkt::amrex {

/// A box of a level's FAB file: which file, and where its record begins.
struct BoxData {
    Box box; ///< in the level's own cells, half-open, without ghost cells
    std::string file;
    std::int64_t offset = 0;
};

/// How a FAB record stores its numbers, and of which cells.
struct FabHeader {
    int bytes = 8;
    bool big_endian = false;
    Box box; ///< with ghost cells
    int components = 1;
};

struct Level {
    Box domain;                  ///< in the level's own cells
    std::string folder_and_stem; ///< "Level_0/Cell"
    Index3 ghosts;               ///< cells around every box that its record holds too
    int components = 1;          ///< of every record
    std::vector<BoxData> boxes;
    std::optional<FabHeader> numbers;   ///< how they are stored, if records have no lines that say it
    std::vector<double> minima, maxima; ///< per box and component; empty if not stated
};

struct PlotHeader {
    std::vector<std::string> names;
    int dimensions = 3;
    double time = 0;
    Vec3 lower{0, 0, 0}, upper{1, 1, 1};
    std::vector<int> ratios; ///< between level i and i + 1
    int coordinate_system = 0;
    std::vector<Level> levels; ///< coarsest first
};

/// Reads Header and every Level_*/Cell_H. Throws Error{data} naming file and what is wrong, Error{io}.
PlotHeader read_headers(std::string const& directory);

/// Opens a file of a plotfile. Throws Error{data} for pipes and devices, which would be read for ever, and Error{io}.
std::ifstream open_part(std::string const& path);

/// Parses a record's line. Throws Error{data}.
FabHeader parse_fab(std::string const& line, std::string const& file, int dimensions);

/// A few integers, each within ±2^40, out of text like "((0,0,0) (63,31,15) (0,0,0))". Throws Error{data}.
std::vector<std::int64_t> integers_of(std::string const& text_line, std::string const& file);

} // namespace vkt::amrex
