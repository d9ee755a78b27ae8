// Writing headers as attributes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/kept_header.h"

#include "libvkt/formats/hdf5/handle.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"

#include <cstddef>

namespace vkt::hdf5 {
namespace {

/// Attributes of the older file format are no larger than 64 KiB.
constexpr std::size_t most_history = std::size_t{24} << 10, most_attribute = std::size_t{60} << 10;

} // namespace

bool put_words(hid_t object, char const* name, std::string const& value) {
    Handle const space(H5Screate(H5S_SCALAR), H5Sclose), type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type, H5T_VARIABLE);
    H5Tset_cset(type, H5T_CSET_UTF8);
    char const* const words = value.c_str();
    Handle const attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    return attribute && H5Awrite(attribute, type, &words) >= 0;
}

bool put_header(hid_t object, Header const& header) {
    Header kept = header;
    kept.timing = kept.dry_run = false;
    if (kept.history) kept.history = parse_history(history_text(*kept.history, most_history));
    std::string const json = one_line(to_json(kept));
    return json.size() > most_attribute || put_words(object, header_attribute, json);
}

} // namespace vkt::hdf5
