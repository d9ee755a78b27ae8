// Fuzzes the text parts of the interface: stream headers and transfer functions as JSON, regions, shell words, names of
// raw files, numbers.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/header.h"
#include "libvkt/core/roi.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/raw_name.h"
#include "libvkt/render/transfer.h"

#include <cstdint>
#include <cstdlib>
#include <string>

namespace {

template <class Work> void tried(Work work) {
    try {
        work();
    } catch (vkt::Error const&) {
    } // the only thing that may come out
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    std::string const text(reinterpret_cast<char const*>(data), size);
    tried([&] {
        auto const header = vkt::header_from_json(text);
        vkt::check(header);
        // What was read is written so that it reads back the same.
        if (vkt::header_from_json(vkt::to_json(header)) != header) std::abort();
        if (header.history) vkt::history_as_shell(*header.history);
    });
    tried([&] {
        auto const box = vkt::Roi{text}.resolve({61, 53, 37});
        if (box.empty() || !vkt::box_of({61, 53, 37}).contains(box)) std::abort();
    });
    tried([&] {
        auto const transfer = vkt::render::transfer_from_json(text);
        // What was read is written so that it reads back the same.
        auto const written = vkt::render::transfer_to_json(transfer);
        if (vkt::render::transfer_to_json(vkt::render::transfer_from_json(written)) != written) std::abort();
    });
    tried([&] { vkt::parse_raw_name(text); });
    tried([&] { vkt::shell_words(text); });
    tried([&] {
        if (vkt::shell_words(vkt::shell_quoted(text)) != std::vector<std::string>{text}) std::abort();
    });
    tried([&] { vkt::parse_size(text); });
    tried([&] { vkt::parse_double(text); });
    tried([&] { vkt::parse_data_type(text); });
    return 0;
}
