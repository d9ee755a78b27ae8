// The pages of TIFF files.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/tiff/pages.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/tiff/complaint.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdarg>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>

namespace vkt::tiff {
namespace {

constexpr std::int64_t most_pages = std::int64_t{1} << 20;
constexpr std::uint32_t tag_of_zeiss = 34412; ///< CZ_LSMINFO

/// libtiff makes single precision of ratios: the decimal that it most likely was.
double as_written(float ratio) {
    std::array<char, 40> digits{};
    auto const end = std::to_chars(digits.data(), digits.data() + digits.size(), ratio).ptr;
    double value = 0;
    std::from_chars(digits.data(), end, value);
    return value;
}

/// Notes where the voxels of libtiff's page lie, if they are dense.
void find_voxels(TIFF* tiff, Page& page) {
    if (page.compression != COMPRESSION_NONE || page.tiled || page.samples != 1 || page.bits % 8 != 0 ||
        page.bits == 24)
        return;
    std::uint16_t order = FILLORDER_MSB2LSB;
    TIFFGetFieldDefaulted(tiff, TIFFTAG_FILLORDER, &order);
    std::uint32_t rows = 0;
    TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows);
    rows = std::min(rows, page.height);
    if (order != FILLORDER_MSB2LSB || rows == 0) return;
    std::uint64_t const row = std::uint64_t{page.width} * page.bits / 8, begin = TIFFGetStrileOffset(tiff, 0);
    if (begin > std::uint64_t{1} << 62) return;
    std::uint64_t next = begin;
    for (std::uint32_t i = 0, strips = TIFFNumberOfStrips(tiff); i < strips; ++i) {
        if (TIFFGetStrileOffset(tiff, i) != next) return;
        next += row * std::min<std::uint64_t>(rows, page.height - std::uint64_t{i} * rows);
    }
    page.begin = begin;
    page.end = next;
}

/// A page's directory as it lies in the file: libtiff drops what it cannot read of it, or does not know.
class Directory {
public:
    struct Entry {
        std::uint64_t tag, type, count;
        unsigned char const* value; ///< or where it lies
    };

    Directory(TIFF* tiff, std::uint64_t offset)
        : file_(TIFFFileno(tiff)), big_endian_(TIFFIsBigEndian(tiff) != 0), big_(TIFFIsBigTIFF(tiff) != 0) {
        std::size_t const word = big_ ? 8 : 4, head = big_ ? 8 : 2;
        std::array<unsigned char, 8> count{};
        whole_ = read(offset, count.data(), head);
        bytes_.resize(std::min<std::size_t>(whole_ ? number(count.data(), head) : 0, 65535) * entry_bytes() + word);
        whole_ = whole_ && read(offset + head, bytes_.data(), bytes_.size()); // with the place of the next one
    }

    std::size_t size() const { return whole_ ? bytes_.size() / entry_bytes() : 0; }
    Entry entry(std::size_t i) const {
        unsigned char const* const at = bytes_.data() + i * entry_bytes();
        return {number(at, 2), number(at + 2, 2), number(at + 4, big_ ? 8 : 4), at + (big_ ? 12 : 8)};
    }
    std::uint64_t number(unsigned char const* bytes, std::size_t n) const {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < n; ++i) value = value << 8 | bytes[big_endian_ ? i : n - 1 - i];
        return value;
    }
    /// False if it, or a value of the standard's tags or ImageJ's, goes on beyond the end of the file.
    bool is_whole() const {
        struct stat status {};
        if (!whole_ || ::fstat(file_, &status) != 0) return false;
        auto const end = static_cast<std::uint64_t>(status.st_size);
        constexpr std::array<std::uint64_t, 19> sizes{0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8, 8, 8};
        constexpr std::uint64_t first_private = 32768, image_j = 50838;
        for (std::size_t i = 0; i < size(); ++i) {
            Entry const e = entry(i);
            bool const known = e.tag < first_private || e.tag == image_j || e.tag == image_j + 1;
            std::uint64_t const one = e.type < sizes.size() ? sizes[e.type] : 0, word = big_ ? 8 : 4;
            if (!known || one == 0 || e.count <= word / one) continue;
            std::uint64_t const begin = number(e.value, word);
            if (e.count > end / one || begin > end - e.count * one) return false;
        }
        return true;
    }

private:
    std::size_t entry_bytes() const { return big_ ? 20 : 12; }
    bool read(std::uint64_t offset, unsigned char* to, std::size_t n) const {
        return ::pread(file_, to, n, static_cast<off_t>(offset)) == static_cast<ssize_t>(n);
    }

    int file_;
    bool big_endian_, big_, whole_ = false;
    std::vector<unsigned char> bytes_;
};

/// The Predictor that a page's directory states, 1 if none. libtiff knows the tag only with compressions that have one,
/// and drops it with all others, so that the entry is read here.
std::uint16_t predictor_of(TIFF* tiff, Page const& page) {
    TIFFField const* const field = TIFFFindField(tiff, TIFFTAG_PREDICTOR, TIFF_ANY);
    if (field == nullptr || TIFFFieldIsAnonymous(field) == 0) return PREDICTOR_NONE; // not there, or undone by libtiff
    Directory const directory(tiff, page.offset);
    for (std::size_t i = 0; i < directory.size(); ++i) {
        Directory::Entry const e = directory.entry(i);
        if (e.tag != TIFFTAG_PREDICTOR) continue;
        std::size_t const bytes = e.type == TIFF_BYTE ? 1 : e.type == TIFF_LONG ? 4 : 2;
        auto const stated = static_cast<std::uint16_t>(directory.number(e.value, bytes));
        return stated == 0 ? std::uint16_t{PREDICTOR_NONE} : stated;
    }
    return PREDICTOR_NONE;
}

/// Whether every reader takes the pixels of that compression as they are decoded, whatever Predictor there is.
bool encodes_pictures(std::uint16_t compression) {
    return compression == COMPRESSION_OJPEG || compression == COMPRESSION_JPEG || compression == COMPRESSION_WEBP ||
           compression == COMPRESSION_JXL;
}

} // namespace

Pages::Pages(std::string const& path) : path_(path) {
    TIFFSetErrorHandler(complain);
    TIFFSetWarningHandler(nullptr);
    tiff_ = TIFFOpen(path.c_str(), "rOm"); // tables of strips are read as they are needed
    if (tiff_ == nullptr) fail(text("libtiff cannot open it: ", complaint()));
    own_ = tiff_;
    std::error_code error;
    std::filesystem::path const place = std::filesystem::read_symlink(path, error); // it is handed over open
    home_ = error ? path : place.string();
    bytes_ = static_cast<double>(std::filesystem::file_size(path_, error));
}

Pages::~Pages() {
    if (other_ != nullptr) TIFFClose(other_);
    if (own_ != nullptr) TIFFClose(own_);
}

void Pages::fail(std::string const& what, std::string const& hint) const {
    throw Error(ErrorKind::data, text("'", path_, "': ", what), hint);
}

Page Pages::page_here() {
    Page p;
    p.offset = TIFFCurrentDirOffset(tiff_);
    TIFFGetField(tiff_, TIFFTAG_IMAGEWIDTH, &p.width);
    TIFFGetField(tiff_, TIFFTAG_IMAGELENGTH, &p.height);
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_BITSPERSAMPLE, &p.bits);
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_SAMPLEFORMAT, &p.format);
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_SAMPLESPERPIXEL, &p.samples);
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_PLANARCONFIG, &p.planar);
    TIFFGetField(tiff_, TIFFTAG_PHOTOMETRIC, &p.photometric);
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_COMPRESSION, &p.compression);
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_ORIENTATION, &p.orientation);
    p.tiled = TIFFIsTiled(tiff_) != 0;
    std::uint32_t kind = 0;
    TIFFGetField(tiff_, TIFFTAG_SUBFILETYPE, &kind);
    p.reduced = (kind & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) != 0;
    std::uint16_t levels = 0;
    std::uint64_t const* offsets = nullptr;
    if (TIFFGetField(tiff_, TIFFTAG_SUBIFD, &levels, &offsets) != 0) p.levels = levels;
    for (auto const& [tag, name] : {std::pair{TIFFTAG_IMAGEDEPTH, "ImageDepth"}, {TIFFTAG_TILEDEPTH, "TileDepth"}}) {
        std::uint32_t depth = 1;
        if (TIFFGetField(tiff_, static_cast<std::uint32_t>(tag), &depth) != 0 && depth > 1)
            fail(text("a page holds ", static_cast<std::int64_t>(depth), " slices in one (", name,
                      "), which is not read"),
                 "write it with a page for each slice, in Python: tifffile.imwrite(name, tifffile.imread(file))");
    }
    if (p.samples == 1) p.planar = PLANARCONFIG_CONTIG;
    if (every_.empty()) laser_microscope_ = TIFFFindField(tiff_, tag_of_zeiss, TIFF_ANY) != nullptr;
    // Zeiss's LSM 510 has it in pages that hold no differences.
    if (!encodes_pictures(p.compression) && !(laser_microscope_ && p.compression == COMPRESSION_NONE))
        p.predictor = predictor_of(tiff_, p);
    find_voxels(tiff_, p);
    return p;
}

/// False behind the last page, of which there are `number`. libtiff says the same of one that it cannot read.
bool Pages::next_page(std::int64_t number) {
    if (TIFFLastDirectory(tiff_) != 0) return false;
    complaint().clear();
    if (TIFFReadDirectory(tiff_) == 0)
        fail(text("page ", number, " cannot be read", complaint().empty() ? "" : ": ", complaint()));
    return true;
}

void Pages::read_pages() {
    std::int64_t number = 0;
    do {
        if (++number > most_pages) fail(text("it has more than ", most_pages, " pages"));
        every_.push_back(page_here());
        if (every_.back().width == 0 || every_.back().height == 0) fail(text("page ", number - 1, " has no extent"));
        if (!Directory(tiff_, every_.back().offset).is_whole())
            fail(text("ended early: what describes page ", number - 1, " goes on beyond the end of the file"));
    } while (next_page(number));
}

void Pages::take_like(std::size_t first) {
    pages_.clear();
    numbers_.clear();
    for (std::size_t i = 0; i < every_.size(); ++i)
        if (i >= first && every_[i].alike(every_[first])) {
            pages_.push_back(every_[i]);
            numbers_.push_back(i);
        }
    here_ = static_cast<std::size_t>(-1);
}

void Pages::read_words() {
    go_to(0);
    char const* words = nullptr;
    words_.description.clear();
    if (TIFFGetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, &words) != 0 && words != nullptr) words_.description = words;
    float x = 0, y = 0;
    words_.resolution_x = words_.resolution_y = 0;
    if (TIFFGetField(tiff_, TIFFTAG_XRESOLUTION, &x) != 0 && TIFFGetField(tiff_, TIFFTAG_YRESOLUTION, &y) != 0) {
        words_.resolution_x = as_written(x);
        words_.resolution_y = as_written(y);
    }
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_RESOLUTIONUNIT, &words_.resolution_unit);
}

/// Reads a sub-image of each page instead, 1 being the first.
void Pages::take_level(std::int64_t level) {
    full_ = pages_.front();
    for (std::size_t i = 0; i < pages_.size(); ++i) {
        go_to(i);
        std::uint16_t levels = 0;
        std::uint64_t const* offsets = nullptr;
        if (TIFFGetField(tiff_, TIFFTAG_SUBIFD, &levels, &offsets) == 0 || level > levels)
            throw Error(ErrorKind::usage, text("'", path_, "': page ", static_cast<std::int64_t>(numbers_[i]),
                                               " has no level ", level, "; its last is level ", std::int64_t{levels}));
        std::uint64_t const offset = offsets[level - 1];
        here_ = static_cast<std::size_t>(-1);
        if (TIFFSetSubDirectory(tiff_, offset) == 0)
            fail(text("level ", level, " of page ", static_cast<std::int64_t>(numbers_[i]), " cannot be read"));
        pages_[i] = page_here();
        if (pages_[i].width == 0 || pages_[i].height == 0 || !pages_[i].alike(pages_.front()))
            fail(text("level ", level, " is of different sizes in different pages"));
    }
}

bool Pages::asked_by_number(std::string const& variable) {
    auto const number = [&](std::string_view word) -> std::optional<std::int64_t> {
        if (!variable.starts_with(word)) return std::nullopt;
        return integer_in(std::string_view(variable).substr(word.size()));
    };
    if (auto const page = number("page "); page && *page >= 0) {
        if (*page >= std::ssize(every_))
            throw Error(ErrorKind::usage,
                        text("'", path_, "' has no page ", *page, "; its last is page ", std::ssize(every_) - 1));
        bool const reduced = every_[static_cast<std::size_t>(*page)].reduced;
        if (reduced) full_ = pages_.front(); // whose words count
        take_like(static_cast<std::size_t>(*page));
        if (!reduced) read_words();
        return true;
    }
    if (auto const level = number("level "); level && *level >= 1) {
        take_level(*level);
        return true;
    }
    return false;
}

/// Continues with the file of that number.
void Pages::open_file(std::size_t number) {
    if (number == file_) return;
    if (other_ != nullptr) TIFFClose(std::exchange(other_, nullptr));
    here_ = static_cast<std::size_t>(-1);
    tiff_ = own_;
    file_ = 0;
    if (number == 0) return;
    std::string const& name = files_[number - 1];
    complaint().clear();
    other_ = TIFFOpen(name.c_str(), "rOm");
    if (other_ == nullptr)
        fail(text("the file '", name, "' that its description names cannot be opened: ", complaint()),
             "put all files of the image into one folder");
    tiff_ = other_;
    file_ = number;
}

void Pages::take_files(TiffDescription& about, bool trust_paths) {
    std::vector<std::vector<Page>> all{every_};
    for (std::string const& name : about.files) {
        files_.push_back(beside(home_, name, trust_paths));
        std::error_code error;
        std::filesystem::path const place = files_.back();
        if (!std::filesystem::is_regular_file(place, error))
            fail(text("the file '", name, "' that its description names is not there"),
                 "put all files of the image into one folder");
        bytes_ += static_cast<double>(std::filesystem::file_size(place, error));
        open_file(files_.size());
        every_.clear();
        read_pages();
        for (Page& page : every_) page.file = files_.size();
        all.push_back(std::move(every_));
    }
    every_ = all.front();
    open_file(0);
    std::vector<Page> pages;
    std::map<std::pair<std::size_t, std::int64_t>, std::int64_t> seen;
    numbers_.clear();
    for (std::size_t i = 0; i < about.pages.size(); ++i) {
        std::size_t const file = about.file_of[i];
        std::int64_t& page = about.pages[i];
        if (page >= std::ssize(all[file]))
            fail(text("its description names page ", page, " of '", file == 0 ? path_ : about.files[file - 1],
                      "', which has ", std::ssize(all[file])));
        Page const& found = all[file][static_cast<std::size_t>(page)];
        if (!pages.empty() && !found.alike(pages.front()))
            fail("its OME description places planes of one image on pages of different sizes");
        auto const [entry, added] = seen.try_emplace({file, page}, std::ssize(pages));
        if (added) pages.push_back(found);
        if (added && file == 0) numbers_.push_back(static_cast<std::size_t>(page));
        page = entry->second;
    }
    std::sort(numbers_.begin(), numbers_.end());
    pages_ = std::move(pages);
    here_ = static_cast<std::size_t>(-1);
}

void Pages::say_not_read(std::vector<std::string>& not_read) {
    auto const size = [](Page const& page) {
        return text(" of ", static_cast<std::int64_t>(page.width), " by ", static_cast<std::int64_t>(page.height),
                    " pixels");
    };
    std::int64_t others = 0;
    for (std::size_t i = 0; i < every_.size(); ++i)
        if (!std::binary_search(numbers_.begin(), numbers_.end(), i) && ++others <= 8)
            not_read.push_back(text("page ", static_cast<std::int64_t>(i),
                                    every_[i].reduced ? " (reduced or a mask)" : "", size(every_[i])));
    if (others > 8) not_read.push_back(text(others - 8, " more pages of other sizes"));
    for (std::int64_t level = 1; level <= pages_.front().levels && level <= 32; ++level) {
        go_to(0);
        std::uint16_t levels = 0;
        std::uint64_t const* offsets = nullptr;
        if (TIFFGetField(tiff_, TIFFTAG_SUBIFD, &levels, &offsets) == 0 || level > levels) break;
        std::uint64_t const offset = offsets[level - 1];
        here_ = static_cast<std::size_t>(-1);
        if (TIFFSetSubDirectory(tiff_, offset) != 0) not_read.push_back(text("level ", level, size(page_here())));
    }
}

void Pages::go_to(std::size_t page) {
    open_file(pages_[page].file);
    if (here_ == page) return;
    complaint().clear();
    if (TIFFSetSubDirectory(tiff_, pages_[page].offset) == 0)
        fail(text("page ", static_cast<std::int64_t>(page), " cannot be read: ", complaint()));
    if (pages_[page].photometric == PHOTOMETRIC_YCBCR && pages_[page].compression == COMPRESSION_JPEG)
        TIFFSetField(tiff_, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    here_ = page;
}

} // namespace vkt::tiff
