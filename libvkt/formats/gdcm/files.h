// DICOM: finding the slices in a file, in the files of a folder, or in those that a DICOMDIR names.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/gdcm/input.h"
#include "libvkt/formats/gdcm/slice.h"

#include <string>
#include <vector>

namespace vkt::dicom {

/// Every slice there is, of these files if any are named, at least one, each image once. A DICOMDIR makes the input a
/// folder. What is left out is added to `not_read`. Throws Error{data} for files that are damaged or hold what vkt does
/// not read.
std::vector<Slice> find_slices(Input& input, std::vector<std::string> const& files, bool trust_paths,
                               std::vector<std::string>& not_read);

} // namespace vkt::dicom
