// What the module gdcm hands to the library: a reader of DICOM files and folders.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_grids.h"
#include "libvkt/io/module.h"

#include <memory>
#include <string>

namespace vkt::dicom {

/// The reader of a file or of all DICOM files of a folder, which runs in a child. Slices (frames of files of several)
/// are sorted by their position along the normal of their planes; slices that lie in the same places again are further
/// volumes. Several series, or images of several orientations or sizes, are variables. Refuses gaps and slants unless
/// it is told to force_uniform. Of what a file says besides, only modality, units and kind of values are kept, since
/// anything else may tell who the patient is, unless that is asked for.
std::unique_ptr<GridsParser> open(std::string const& path);

} // namespace vkt::dicom
