// Bricks put together again: from files, by what they or their manifest say of their places, or from a stream.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/operations/bricks/bricks.h"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// What a directory of bricks says of itself, in the file bricks.json.
struct BrickManifest {
    struct Entry {
        std::string file; ///< in the directory
        BrickPlace place;
    };
    Index3 whole;
    DataType dtype = DataType::uint8;
    BrickOptions options;
    Geometry geometry; ///< of the whole
    std::vector<Entry> bricks;
};

inline constexpr std::string_view manifest_name = "bricks.json";

std::string to_json(BrickManifest const& manifest);
/// Throws Error{data} naming `name` for anything that to_json() does not write.
BrickManifest manifest_from_json(std::string_view json, std::string const& name);

/// A sink for the bricks of one volume: a directory of files "brick_000.nrrd" and the manifest, which appears whole or
/// not at all. `extension` with its dot; `create` makes the sinks of single files.
std::unique_ptr<Sink> brick_directory(std::string const& path, bool force, std::string const& extension,
                                      BrickOptions const& options,
                                      std::function<std::unique_ptr<Sink>(std::string const&)> create);

/// Where a brick is to be found, and where it belongs if that is known already.
struct BrickFile {
    std::string path;
    std::optional<BrickPlace> place;
};

/// The bricks of a directory or a manifest: all that the manifest lists; without one all files. Throws Error{data} if
/// one is missing, or one more is there, and unless it is `trusted` for those that lead elsewhere or are no files.
std::vector<BrickFile> bricks_of(std::string const& path, bool trusted);

using OpenBrick = std::function<std::unique_ptr<Source>(std::string const& path)>;

/// The volume whose bricks lie in these files, each opened when it is read. All headers are read first: bricks must
/// have one type, value map, frame and lattice, and hold each voxel once, ghosts apart; Error{data} names the first
/// that does not. Forward access if that is what files offer (compressed ones).
std::unique_ptr<Source> merged_files(std::vector<BrickFile> files, OpenBrick open, Execution const& execution,
                                     StageInfo const& info);

/// The volumes whose bricks follow each other in a source, in the order of brick_source(). Holds a layer of bricks.
std::unique_ptr<Source> merged_stream(std::unique_ptr<Source> source, std::string name, Execution const& execution,
                                      StageInfo const& info);

} // namespace vkt
