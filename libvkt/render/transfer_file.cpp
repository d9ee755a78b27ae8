// Transfer functions from files.
// SPDX-License-Identifier: MIT
#include "libvkt/render/transfer_file.h"

#include "libvkt/io/whole_text.h"

namespace vkt::render {

TransferFunction read_transfer(std::string const& file) {
    return transfer_from_json(whole_text(file, std::size_t{16} << 20));
}

TransferFunction transfer_of_word(std::string const& word) {
    bool const inlined = word.starts_with('{') || word.starts_with('[');
    return inlined ? transfer_from_json(word) : read_transfer(word);
}

} // namespace vkt::render
