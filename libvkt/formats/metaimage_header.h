// MetaImage headers: "Key = Value" lines, and what they mean (https://itk.org/Wiki/MetaIO/Documentation).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/formats/raw_source.h"

#include <map>
#include <string>
#include <vector>

namespace vkt {

struct MetaImageHeader {
    std::string name;                          ///< of the file, for messages
    std::map<std::string, std::string> fields; ///< as spelt in the file; values trimmed
    std::vector<std::string> listed_files;     ///< lines after "ElementDataFile = LIST"
};

/// Reads up to ElementDataFile, which ends the header, and the list of files behind it, if there is one.
/// Throws Error{data} for lines without "=", repeated fields, and headers over 16 MiB.
MetaImageHeader read_metaimage_header(ByteSource& bytes);

/// Dims, type, geometry and place of the voxels; a fourth dimension becomes a sequence of volumes. As in ITK the rows
/// of the matrix need not have unit length: their lengths are factors of the spacing. Several channels are a volume
/// each. Throws Error{data}, also for files elsewhere, unless the header is trusted.
RawLayout metaimage_layout(MetaImageHeader const& header, bool trust_paths);

/// MetaImage's name of a type; empty if it has none.
std::string metaimage_type_name(DataType type);

/// Field of a series of which nobody said where its volumes lie along the fourth axis.
inline constexpr char const* unknown_sequence = "VktSequence";

/// True for keys that MetaImage itself gives a meaning, so that they cannot be attributes.
bool is_metaimage_field(std::string const& key);

} // namespace vkt
