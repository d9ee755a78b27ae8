// What all readers of hierarchical files share: what to read, and what a file says it holds.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tree.h"
#include "libvkt/core/brick_sequence.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/roi.h"

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt {

struct AmrReadOptions {
    std::string variable;          ///< empty: the only one, or refused with the list of names
    std::optional<DataType> dtype; ///< float32 or float64; none keeps the file's type
    Roi roi;                       ///< in finest cells: only bricks whose domain meets the region are read
    WorldRoi world_roi;            ///< the same in world units
};

struct AmrVariable {
    std::string name;
    DataType dtype = DataType::float32;
    std::optional<double> minimum, maximum; ///< as the file states them
    std::string extent{};                   ///< where variables differ in it: what the file states, as text
};

/// What a file holds, found without reading cells.
struct AmrListing {
    std::string format;
    int dimensions = 3;
    std::vector<AmrVariable> variables;
    std::vector<std::string> not_read; ///< what else there is: "grid 'v' of type vec3s"
    Header header;                     ///< kind, dims, geometry, attributes and counts that every variable shares
    std::vector<Brick> bricks;         ///< the tree
    std::int64_t blocks_in_file = 0;   ///< with parents or covered boxes
};

/// An open file of hierarchical volumes: its tables are read once, cells when they are asked for.
class AmrFile {
public:
    virtual ~AmrFile() = default;
    virtual AmrListing const& listing() const = 0;
    /// One variable, or the bricks of it whose domain meets the region: the header's attributes "variable" and "roi"
    /// name them. Throws Error{usage} for variables and types the file does not have. The sequence keeps the file open,
    /// and gives no more cells once another is read.
    virtual BrickSequence read(AmrReadOptions const& options, Execution const& execution) = 0;
};

/// The region the options ask for in finest cells, and whether they ask for one. Throws Error{usage}.
std::optional<Box> wanted_box(AmrReadOptions const& options, Header const& header);

/// Positions of the bricks whose domain meets the region; all of them without one.
std::vector<std::size_t> bricks_within(std::optional<Box> const& region, BrickTable const& bricks, Index3 dims);

/// The position of the wanted variable. Throws Error{usage} naming those there are, with the nearest one as a hint.
std::size_t choose_variable(std::vector<AmrVariable> const& variables, std::string const& wanted,
                            std::string const& file);

} // namespace vkt
