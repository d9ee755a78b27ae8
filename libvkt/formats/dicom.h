// DICOM: which folders hold it.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt {

/// True if some file of the folder begins as DICOM files do. Reads 132 bytes of each until then.
bool is_dicom_folder(std::string const& path);

} // namespace vkt
