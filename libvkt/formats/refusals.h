// What writers say of volumes that their formats do not hold.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/formats/format.h"

#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// For writers of files with one grid each: `what` is "Zarr arrays". Throws Error{usage} for bricks.
void refuse_bricks(Header const& header, std::string_view what);

/// Throws Error{usage} for a second volume: begun is whether there was one before, and becomes true. `file` is "a Zarr
/// array", `extension` ".zarr".
void refuse_series(bool& begun, std::string_view file, std::string_view extension);

/// Both.
void refuse_bricks_and_series(Header const& header, bool& begun, std::string_view what, std::string_view file,
                              std::string_view extension);

/// Of an output that is a part of a file, its name there, empty if `path` is the file itself: `what` is "dataset",
/// `example` a good name, as it follows the colon. Throws Error{usage} for names that are missing, and for those that
/// are no way down from the root of a file (an empty part, "." or ".."), which programs that make files of what they
/// find would follow anywhere.
std::string part_to_write(std::string const& path, std::string_view what, std::string_view example);

/// What a user has to say of bare voxels that no name describes: the options that are missing, or the command that
/// takes them where the one that asked has none.
std::string raw_description(std::string const& name, ReadOptions const& options, std::string_view missing);

/// For formats whose map of values only vkt finds, "NRRD", and perhaps one other program: says so of a header that has
/// one.
void tell_private_values(WriteOptions const& options, Header const& header, std::string_view format,
                         std::string_view but_for = {});

/// What a format has places for.
struct Kept {
    bool spacing = true, directions = true;  ///< spacing: and the origin
    bool frame = true;                       ///< what the axes of the world mean
    bool values = true;                      ///< the map of values, and its units
    bool sidecar = false;                    ///< the attribute of that name, which NIfTI keeps beside it
    bool attributes = true;                  ///< all others, labels of segmentations among them
    std::vector<std::string_view> named{};   ///< attributes that are kept all the same
    bool provenance = true;                  ///< the error and the history
    bool history = false;                    ///< that alone is kept
    std::vector<std::string_view> besides{}; ///< what else is lost
};

/// Bare voxels.
inline Kept const nothing_kept{.spacing = false,
                               .directions = false,
                               .frame = false,
                               .values = false,
                               .attributes = false,
                               .named = {},
                               .provenance = false,
                               .besides = {}};

/// Tells the user in one line what of this header files of `what` do not hold, if anything. Error and history are named
/// with the rest: every command adds to them, so that of themselves they are worth no line.
void tell_losses(WriteOptions const& options, Header const& header, std::string_view what, Kept const& kept);

} // namespace vkt
