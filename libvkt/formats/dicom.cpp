// DICOM, files and folders: read by a child.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/dicom.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/parsed_grids.h"

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace vkt {
namespace {

bool begins_as_dicom(std::span<std::byte const> head) {
    return head.size() >= 132 && std::memcmp(head.data() + 128, "DICM", 4) == 0;
}

std::unique_ptr<Source> open_dicom(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::string const what = text(bytes->name(), ": reading DICOM");
    std::int64_t size = 0;
    if (bytes->directory()) {
        std::error_code error;
        for (auto const& entry : std::filesystem::directory_iterator(bytes->name(), error))
            if (entry.is_regular_file(error)) size += static_cast<std::int64_t>(entry.file_size(error));
    } else {
        bytes = seekable_bytes(std::move(bytes));
        size = bytes->size();
    }
    return parsed_grids("gdcm", what, std::move(bytes), size, options);
}

} // namespace

bool is_dicom_folder(std::string const& path) {
    namespace fs = std::filesystem;
    std::error_code error;
    for (auto const& entry : fs::directory_iterator(path, error)) {
        if (!entry.is_regular_file(error)) continue;
        std::array<char, 132> head{};
        std::ifstream file(entry.path(), std::ios::binary);
        file.read(head.data(), head.size());
        if (file.gcount() == 132 && std::memcmp(head.data() + 128, "DICM", 4) == 0) return true;
    }
    return false;
}

Format dicom_format() {
    return {"dicom", "DICOM, a file or a folder of slices", {".dcm"}, begins_as_dicom, open_dicom, nullptr};
}

} // namespace vkt
