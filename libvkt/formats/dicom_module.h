// What the module gdcm hands to the library: a reader and a writer of DICOM files and folders.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/io/module.h"

#include <memory>
#include <string>

namespace vkt {

struct DicomFunctions {
    std::unique_ptr<VolumeWriter> (*writer)(std::string const& path, WriteOptions const& options);
};

namespace dicom {

/// The reader of a file or of all DICOM files of a folder, which runs in a child. Slices (frames of files of several)
/// are sorted by their position along the normal of their planes; slices that lie in the same places again are further
/// volumes, which frames are parts of by their stack and their indices of other dimensions. Several series, or images
/// of several orientations or sizes, are variables. Refuses gaps and slants unless it is told to force_uniform. Of what
/// a file says besides, only modality, units and kind of values are kept, since anything else may tell who the patient
/// is, unless that is asked for.
std::unique_ptr<GridsParser> open(std::string const& path);

/// Writes NAME.dcm as one file of several frames, any other name as a folder with a file for each slice: Secondary
/// Captures of a new study, in which nothing stands about anybody. Integers of 8 and 16 bits; lengths become
/// millimetres in the left-posterior-superior frame.
std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options);

} // namespace dicom

} // namespace vkt
