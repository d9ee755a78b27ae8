// NRRD headers as fields and key/value pairs, and what they mean (http://teem.sourceforge.net/nrrd/format.html).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/formats/raw_source.h"

#include <map>
#include <string>
#include <vector>

namespace vkt {

struct NrrdHeader {
    std::string name;                          ///< of the file, for messages
    std::map<std::string, std::string> fields; ///< by canonical field name; values trimmed
    std::map<std::string, std::string> pairs;  ///< key/value pairs, unescaped
    std::vector<std::string> listed_files;     ///< lines after "data file: LIST"

    bool has(std::string const& field) const { return fields.count(field) > 0; }
    /// The field's value, or empty.
    std::string const& operator[](std::string const& field) const;
};

/// Reads from the magic to the blank line that ends the header, or to the end of a detached one.
/// Throws Error{data} for unknown and repeated fields, and for headers over 16 MiB.
NrrdHeader read_nrrd_header(ByteSource& bytes);

/// Dims, type, geometry and place of the voxels. Axes of one sample that are not spatial are dropped; a fourth axis at
/// the end becomes a sequence of volumes. Throws Error{data}, also for vectors and colours, with a hint what to do.
RawLayout nrrd_layout(NrrdHeader const& header);

/// NRRD's name of a type; empty if it has none.
std::string nrrd_type_name(DataType type);

/// Names of attributes that stand for NRRD fields in Header::attributes, each under the field's own name.
bool is_nrrd_attribute(std::string const& key);

} // namespace vkt
