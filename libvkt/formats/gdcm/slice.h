// DICOM: a slice, which is an image or a frame of one, and what the elements of its data set say of it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"

#include <gdcmDataSet.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vkt::dicom {

/// One plane of voxels.
struct Slice {
    std::string file; ///< its name in the folder, or empty for the file itself
    std::int64_t frame = 0, frames = 1;
    std::string series, series_number, modality, photometric, rescale_type, units, uid;
    bool table = false, mosaic = false;      ///< values have a modality LUT; slices stand side by side in an image
    std::string stack;                       ///< of frames: those of other stacks are other volumes
    std::vector<double> order;               ///< of frames: those at the same place follow one another by this
    std::size_t counted = 0;                 ///< of `order`: numbers of dimensions, the same at every place
    std::map<std::string, std::string> told; ///< of frames: what says which volume it is
    std::int64_t columns = 0, rows = 0, bits = 0, stored = 0, samples = 1, instance = 0, time = 0;
    bool is_signed = false, placed = false;
    /// Where its pixels begin in the file, if no library needs to decode them: as they are, or in runs, one fragment
    /// for each frame.
    std::int64_t pixels_at = -1;
    bool runs = false, big_endian = false, words = false, planar = false;
    Vec3 position, across{1, 0, 0}, down{0, 1, 0};
    double spacing_across = 1, spacing_down = 1;
    std::optional<double> spacing_slices;
    double slope = 1, intercept = 0;
    double along = 0; ///< position along the normal
};

/// Place, spacing and values, from the elements of a classic file or of a functional group.
void read_plane(gdcm::DataSet const& set, Slice& slice);

/// What dimensions of frames count (Dimension Index Sequence), in the order of their significance.
enum class Dimension { place, stack, other };

std::vector<Dimension> dimensions_of(gdcm::DataSet const& set);

/// The planes that the functional groups of a frame, or those that all frames share, say.
void read_group(gdcm::DataSet const& group, Slice& slice);

/// To which volume a frame belongs: its stack or segment, its indices of dimensions that are no places, and without
/// those the values that such dimensions count.
void read_membership(gdcm::DataSet const& group, std::vector<Dimension> const& dimensions, Slice& slice);

} // namespace vkt::dicom
