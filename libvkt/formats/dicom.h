// DICOM: which files and folders hold it.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace vkt {

/// What begins_as_dicom() looks at.
inline constexpr std::size_t dicom_head_bytes = 512;

/// True if a file that begins so is DICOM: "DICM" at byte 128, or, as in files without that preamble, at least four
/// elements in ascending order from group 8 on, of implicit or explicit types, little-endian (PS3.5, 7.1).
bool begins_as_dicom(std::span<std::byte const> head);

/// True if all of these are regular files that begin as DICOM files do.
bool are_dicom_files(std::vector<std::string> const& paths);

/// True if some file of the folder begins as DICOM files do. Reads dicom_head_bytes of each until then.
bool is_dicom_folder(std::string const& path);

/// The first folder within, as discs have them by patient and series, that holds DICOM files; empty if there is none
/// among the first few hundred.
std::string dicom_folder_within(std::string const& path);

} // namespace vkt
