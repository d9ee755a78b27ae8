// NRRD headers as fields and key/value pairs, and what they mean (http://teem.sourceforge.net/nrrd/format.html).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/formats/raw_source.h"

#include <map>
#include <optional>
#include <string>
#include <string_view>
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

/// Dims, type, geometry and place of the voxels. Axes of one sample that are not spatial are dropped where there are
/// more than three; a fourth axis at the end becomes a sequence of volumes, and so do the values of a voxel along a
/// first axis that is not spatial (colours, vectors, lists). Throws Error{data}, also for such an axis among the
/// spatial ones, with a hint what to do, and for files elsewhere, unless the header is trusted.
RawLayout nrrd_layout(NrrdHeader const& header, bool trust_paths);

/// NRRD's name of a type; empty if it has none.
std::string nrrd_type_name(DataType type);

/// The full name of a three-dimensional space that NRRD knows, also for a short one ("RAS") and for one with time;
/// empty for all others.
std::string nrrd_space(std::string_view name);

/// The entries of a list like `"mm" "a \" b"`, with their quotes and backslashes; nullopt if one has no quotes or no
/// end.
std::optional<std::vector<std::string>> quoted_entries(std::string_view list);

/// Attributes of the axis that enumerates volumes, besides those in raw_source.h. The first is an NRRD kind, the others
/// are text in quotes.
inline constexpr char const *sequence_kind = "sequence kind", *sequence_units = "sequence units",
                            *sequence_label = "sequence label";

} // namespace vkt
