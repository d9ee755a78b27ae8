// Volumes put together along z, or one after another as a series, and the reverse: the slices of a volume one by one.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Along which axis volumes are put together or taken apart: z, or the one that enumerates the volumes of a series.
enum class StackAxis : std::uint8_t { z, series };
template <> struct EnumNames<StackAxis> {
    static std::vector<std::pair<StackAxis, char const*>> all() {
        return {{StackAxis::z, "z"}, {StackAxis::series, "series"}};
    }
};

using OpenInput = std::function<std::unique_ptr<Source>(std::string const& path)>;

/// The volumes of these inputs in the order named. Along z they become one volume: all headers are read first, and must
/// agree in extent along x and y, type, value map, unit and orientation. Inputs without a place of their own (all of
/// one origin) are put one on another with the spacing of the first; those that have one must continue each other, and
/// single slices give the spacing by their distance; unless `force_uniform`, Error{data} names the first that does not.
/// As a series each volume stays as it is. Without `along`, single slices make a volume and volumes a series;
/// Error{usage} for a mixture. Files are opened when they are read, at most 64 at a time; pipes at once.
std::unique_ptr<Source> stacked(std::vector<std::string> paths, OpenInput open, std::optional<StackAxis> along,
                                bool force_uniform, StageInfo const& info);

/// Opens several files as one input, of which `together` are ReadOptions.
using OpenTogether = std::function<std::unique_ptr<Source>(std::string const& first, ReadOptions const& together)>;

/// The volume of DICOM images, each a file: sorted and checked as those of a folder are, in whatever order they are
/// named. Null if these are no such files. `variable` chooses one of several series.
std::unique_ptr<Source> stacked_dicom(std::vector<std::string> const& paths, OpenTogether const& open,
                                      std::string const& variable, bool force_uniform, StageInfo const& info);

/// What a path stands for: the volume that its slices make, for a folder of pictures or TIFF files, or a path with a
/// number's place (slice%04d.tif); the volumes of all files that a pattern matches, one after another; or a file.
std::unique_ptr<Source> open_path(std::string const& path, OpenInput const& open, Notice const& notice = {});

/// The slices of each volume of a source, one after another, each a volume with its place in the world. Error{usage}
/// for hierarchical volumes.
std::unique_ptr<Source> slices_of(std::unique_ptr<Source> source, StageInfo info);

} // namespace vkt
