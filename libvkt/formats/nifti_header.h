// NIfTI-1 and NIfTI-2 headers, read and made (https://nifti.nimh.nih.gov), and what they mean.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/raw_source.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// The fields that are kept, under the names of the standard.
struct NiftiFields {
    std::array<std::int64_t, 8> dim{};
    std::array<double, 8> pixdim{}; ///< the first one is qfac
    std::int64_t datatype = 0, bitpix = 0, vox_offset = 0, xyzt_units = 0, qform_code = 0, sform_code = 0;
    double scl_slope = 0, scl_inter = 0, toffset = 0, cal_min = 0, cal_max = 0;
    std::array<double, 3> quatern{}, qoffset{};
    std::array<double, 12> srow{}; ///< three rows of four
    std::int64_t intent_code = 0;
    std::array<double, 3> intent_p{};
    std::string intent_name, descrip, aux_file;
    /// How the scanner went through the slices, and which axes it encoded.
    std::int64_t slice_code = 0, slice_start = 0, slice_end = 0, dim_info = 0;
    double slice_duration = 0;

    friend bool operator==(NiftiFields const&, NiftiFields const&) = default;
};

struct NiftiHeader {
    std::string name; ///< of the file, for messages
    int version = 1;
    bool big_endian = false;
    bool single = true; ///< the voxels are in the same file
    NiftiFields fields;
    std::int64_t position = 0;         ///< behind what was read
    std::optional<Header> ours;        ///< what vkt wrote into an extension of the file, if it did
    std::string comment;               ///< text that others wrote into extensions
    std::vector<std::string> not_read; ///< other extensions
};

/// The frame of the format.
inline constexpr std::string_view nifti_frame = "right-anterior-superior";

/// Attribute of that text.
inline constexpr char const* nifti_comment = "comment";

/// True for the first bytes of a header of either version, byte order and kind.
bool is_nifti(std::span<std::byte const> head);

/// Reads the header and, of the extensions behind it, texts. Throws Error{data}.
NiftiHeader read_nifti_header(ByteSource& bytes);

/// Dims, type, geometry and place of the voxels; a fourth dimension becomes a sequence of volumes. The world is
/// right-anterior-superior. The geometry is that of the sform if its code is positive, else of the qform if its code
/// is, else as nibabel has it: x to the left, the middle of the volume at the origin. Of what vkt wrote itself, the
/// extension counts, which has all digits, as long as the other fields are still those that were made from it.
/// Throws Error{data}.
RawLayout nifti_layout(NiftiHeader const& header, bool trust_paths);

/// Of a pair: the voxels in NAME.img, or NAME.img.gz, beside NAME.hdr. Throws Error{data}.
void find_image(RawLayout& layout, std::string const& header_name, bool trust_paths);

/// The bytes of a header, with the extension: of version 2 where an extent needs it. Throws Error{usage} for what the
/// format cannot hold.
std::string nifti_bytes(HeaderText const& header);

/// NIfTI's name of a type; empty if it has none.
std::string nifti_type_name(DataType type);

} // namespace vkt
