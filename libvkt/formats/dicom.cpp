// DICOM, files and folders: read by a child, written through the module gdcm.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/dicom.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/dicom_module.h"
#include "libvkt/formats/parsed_grids.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

namespace vkt {
namespace {

std::unique_ptr<Source> open_dicom(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::string const what = text(bytes->name(), ": reading DICOM");
    std::int64_t size = 0;
    if (!options.together.empty()) {
        std::error_code error;
        for (std::string const& file : options.together)
            if (auto const n = std::filesystem::file_size(file, error); !error) size += static_cast<std::int64_t>(n);
    } else if (bytes->directory()) {
        std::error_code error;
        for (auto const& entry : std::filesystem::directory_iterator(bytes->name(), error))
            if (entry.is_regular_file(error)) size += static_cast<std::int64_t>(entry.file_size(error));
    } else {
        bytes = seekable_bytes(std::move(bytes));
        size = bytes->size();
    }
    return parsed_grids("gdcm", what, std::move(bytes), size, options);
}

bool is_dicom_file(std::string const& path) {
    std::array<char, dicom_head_bytes> head{};
    std::ifstream file(path, std::ios::binary);
    file.read(head.data(), head.size());
    auto const got = static_cast<std::size_t>(file.gcount());
    return begins_as_dicom(std::as_bytes(std::span(head.data(), got)));
}

std::unique_ptr<Sink> create_dicom(std::string const& path, WriteOptions const& options) {
    void const* const functions = module_functions("gdcm", text(path, ": writing DICOM"));
    return slab_sink(static_cast<DicomFunctions const*>(functions)->writer(path, options));
}

} // namespace

bool begins_as_dicom(std::span<std::byte const> head) {
    if (head.size() >= 132 && std::memcmp(head.data() + 128, "DICM", 4) == 0) return true;
    auto const byte = [&](std::size_t i) { return std::to_integer<std::uint32_t>(head[i]); };
    auto const capital = [&](std::size_t i) { return byte(i) >= 'A' && byte(i) <= 'Z'; };
    std::uint32_t before = 0;
    std::size_t at = 0;
    for (int element = 0; element < 4; ++element) {
        if (at + 8 > head.size()) return false;
        std::uint32_t const tag = (byte(at) | byte(at + 1) << 8) << 16 | byte(at + 2) | byte(at + 3) << 8;
        bool const typed = capital(at + 4) && capital(at + 5);
        std::uint32_t const length = typed ? byte(at + 6) | byte(at + 7) << 8
                                           : byte(at + 4) | byte(at + 5) << 8 | byte(at + 6) << 16 | byte(at + 7) << 24;
        if (tag < 0x00080000 || tag > 0x0010ffff || tag <= before || length % 2 != 0 || length > dicom_head_bytes)
            return false;
        before = tag;
        at += 8 + length;
    }
    return true;
}

bool are_dicom_files(std::vector<std::string> const& paths) {
    return std::all_of(paths.begin(), paths.end(), [](std::string const& path) {
        std::error_code error;
        return std::filesystem::is_regular_file(path, error) && is_dicom_file(path);
    });
}

bool is_dicom_folder(std::string const& path) {
    namespace fs = std::filesystem;
    std::error_code error;
    for (auto const& entry : fs::directory_iterator(path, error)) {
        if (!entry.is_regular_file(error)) continue;
        if (is_dicom_file(entry.path())) return true;
    }
    return false;
}

std::string dicom_folder_within(std::string const& path) {
    namespace fs = std::filesystem;
    constexpr int deepest = 4;
    int left = 300;
    std::error_code error;
    std::vector<std::string> found;
    for (fs::recursive_directory_iterator entry(path, error), end; !error && entry != end && left > 0;
         entry.increment(error)) {
        if (!entry->is_directory(error)) continue;
        --left;
        if (entry.depth() >= deepest) entry.disable_recursion_pending();
        if (is_dicom_folder(entry->path())) found.push_back(entry->path());
    }
    return found.empty() ? "" : *std::min_element(found.begin(), found.end());
}

Format dicom_format() {
    return {"dicom", "DICOM, a file or a folder of slices", {".dcm"}, begins_as_dicom, open_dicom, create_dicom};
}

} // namespace vkt
