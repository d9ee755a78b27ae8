// TIFF: reading by a child, writing through the module tiff.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/tiff_module.h"

#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace vkt {
namespace {

using namespace std::string_view_literals;

/// Not so DICOM files that some scanners begin with a directory of TIFF, which leads nowhere once they were edited.
bool is_tiff(std::span<std::byte const> head) {
    if (head.size() >= 132 && std::memcmp(head.data() + 128, "DICM", 4) == 0) return false;
    for (std::string_view const magic : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv})
        if (head.size() >= magic.size() && std::memcmp(head.data(), magic.data(), magic.size()) == 0) return true;
    return false;
}

/// Tells of whole pages that are not of the volume. Reduced ones and masks are there to be left out.
class TellingOfPages : public SourceDecorator {
public:
    TellingOfPages(std::unique_ptr<Source> source, std::string name, Notice notice)
        : SourceDecorator(std::move(source)), name_(std::move(name)), notice_(std::move(notice)) {}
    bool next_volume() override {
        if (!inner().next_volume()) return false;
        if (std::exchange(told_, true)) return true;
        std::vector<std::string> pages = inner().not_read();
        std::erase_if(pages, [](std::string const& what) {
            return !what.starts_with("page ") || what.find(" (reduced") != std::string::npos;
        });
        if (!pages.empty())
            notice_(text("'", name_, "' holds pages of other sizes than its volume's (", pages.front(),
                         pages.size() > 1 ? ", and others" : "", "): not read"));
        return true;
    }

private:
    std::string name_;
    Notice notice_;
    bool told_ = false;
};

std::unique_ptr<Source> open_tiff(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::string const what = text(bytes->name(), ": reading TIFF");
    std::shared_ptr<ByteSource const> const file = seekable_bytes(std::move(bytes));
    auto source = parsed_grids("tiff", what, file, file->size(), options);
    if (!options.notice) return source;
    return std::make_unique<TellingOfPages>(std::move(source), file->name(), options.notice);
}

std::unique_ptr<Sink> create_tiff(std::string const& path, WriteOptions const& options) {
    void const* const functions = module_functions("tiff", text(path, ": writing TIFF"));
    return slab_sink(static_cast<TiffFunctions const*>(functions)->writer(path, options));
}

} // namespace

Format tiff_format() {
    return {"tiff", "TIFF stacks: classic, BigTIFF, ImageJ, OME", {".tif", ".tiff"}, is_tiff, open_tiff, create_tiff};
}

} // namespace vkt
