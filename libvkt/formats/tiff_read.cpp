// Reading TIFF with libtiff: pages, strips and tiles of integers and floats of any width that a volume can hold.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/tiff_description.h"
#include "libvkt/formats/tiff_module.h"

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <utility>

namespace vkt::tiff {
namespace {

constexpr std::int64_t most_pages = std::int64_t{1} << 20;

/// What libtiff complained of last; there is one file in a process.
std::string complaint; // NOLINT: the handler has no other place for it

void complain(char const* module, char const* format, va_list arguments) {
    char line[300];
    std::vsnprintf(line, sizeof line, format, arguments);
    complaint = text(module != nullptr ? text(module, ": ") : "", line);
}

struct Page {
    std::size_t file = 0; ///< 0: the one that was opened, others are those of its description
    std::uint64_t offset = 0;
    std::uint32_t width = 0, height = 0;
    std::uint16_t bits = 1, format = SAMPLEFORMAT_UINT, samples = 1, planar = PLANARCONFIG_CONTIG, photometric = 0,
                  compression = COMPRESSION_NONE, orientation = ORIENTATION_TOPLEFT;
    bool tiled = false;
    bool reduced = false;    ///< of another page, or a mask
    std::int64_t levels = 0; ///< sub-images, smaller ones of the same

    bool alike(Page const& o) const {
        return reduced == o.reduced && width == o.width && height == o.height && bits == o.bits && format == o.format &&
               samples == o.samples;
    }
};

/// What so many bytes can at most become.
double densest(std::uint16_t compression) {
    switch (compression) {
    case COMPRESSION_NONE:
        return 1;
    case COMPRESSION_PACKBITS:
        return 64;
    case COMPRESSION_LZW:
        return 4096;
    case COMPRESSION_DEFLATE:
    case COMPRESSION_ADOBE_DEFLATE:
        return 1032;
    default:
        return 1e5;
    }
}

/// libtiff makes single precision of ratios: the decimal that it most likely was.
double as_written(float ratio) {
    std::array<char, 40> digits{};
    auto const end = std::to_chars(digits.data(), digits.data() + digits.size(), ratio).ptr;
    double value = 0;
    std::from_chars(digits.data(), end, value);
    return value;
}

class TiffFile : public GridsParser {
public:
    explicit TiffFile(std::string const& path) : path_(path) {
        TIFFSetErrorHandler(complain);
        TIFFSetWarningHandler(nullptr);
        tiff_ = TIFFOpen(path.c_str(), "rO"); // tables of strips are read as they are needed
        if (tiff_ == nullptr) fail(text("libtiff cannot open it: ", complaint));
        own_ = tiff_;
        std::error_code error;
        std::filesystem::path const place = std::filesystem::read_symlink(path, error); // it is handed over open
        home_ = error ? path : place.string();
        bytes_ = static_cast<double>(std::filesystem::file_size(path_, error));
    }
    ~TiffFile() override {
        if (other_ != nullptr) TIFFClose(other_);
        if (own_ != nullptr) TIFFClose(own_);
    }
    TiffFile(TiffFile const&) = delete;
    TiffFile& operator=(TiffFile const&) = delete;

    ParsedGrids open(GridsChoice const& choice) override;
    void read(std::int64_t volume, Box const& box, std::byte* to) override;

private:
    struct Plane {
        std::size_t page = 0;
        std::uint16_t sample = 0;
    };

    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", path_, "': ", what), hint);
    }
    Page page_here();
    bool next_page(std::int64_t number);
    void read_pages();
    void take_like(std::size_t first);
    void take_level(std::int64_t level);
    void read_words();
    bool asked_by_number(std::string const& variable);
    TiffDescription describe(std::string const& image, bool trust_paths);
    void take_files(TiffDescription& about, bool trust_paths);
    void open_file(std::size_t number);
    void say_not_read(std::vector<std::string>& not_read);
    Vec3 lie_over_the_full_image(Geometry& geometry) const;
    DataType type_of(Page const& page) const;
    void check_size(Page const& page, std::int64_t planes) const;
    void read_geometry(Header& header, TiffDescription const& about);
    void arrange(TiffDescription const& about, ParsedGrids& grids);
    void find_places(ParsedGrids& grids, TiffDescription const& about);
    bool dense_at(Page const& page, std::int64_t& place);
    void go_to(std::size_t page);
    std::byte const* unit(std::size_t page, std::uint32_t index, std::size_t bytes);
    void copy_row(Page const& page, std::byte const* row, std::uint32_t first, std::uint32_t count,
                  std::uint16_t sample, std::byte* to) const;

    std::string path_, home_;                                  ///< home_: where it lies
    TIFF *tiff_ = nullptr, *own_ = nullptr, *other_ = nullptr; ///< tiff_: that which is open of the other two
    std::size_t file_ = 0;                                     ///< its number
    std::vector<std::string> files_;                           ///< others, from number 1 on
    double bytes_ = 0;                                         ///< of all of them
    std::vector<Page> every_;                                  ///< in the order of the file
    std::vector<std::size_t> numbers_;                         ///< of pages_ among them
    std::vector<Page> pages_;                                  ///< those that are read, of one size
    std::optional<Page> full_;                                 ///< of which the pages are reduced ones
    std::vector<Plane> planes_;                                ///< slices of all volumes
    std::string description_;
    double resolution_x_ = 0, resolution_y_ = 0;
    std::uint16_t resolution_unit_ = RESUNIT_INCH;
    Index3 dims_;
    DataType type_ = DataType::uint8;
    std::size_t here_ = static_cast<std::size_t>(-1); ///< page of libtiff
    std::size_t held_page_ = static_cast<std::size_t>(-1);
    std::uint32_t held_unit_ = 0;
    std::vector<std::byte> held_; ///< a strip or tile, decoded
};

Page TiffFile::page_here() {
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
    std::uint32_t depth = 1;
    if (TIFFGetField(tiff_, TIFFTAG_IMAGEDEPTH, &depth) != 0 && depth > 1)
        fail(text("a page holds ", static_cast<std::int64_t>(depth), " slices in one (ImageDepth), which is not read"),
             "write it with a page for each slice, in Python: tifffile.imwrite(name, tifffile.imread(file))");
    if (p.samples == 1) p.planar = PLANARCONFIG_CONTIG;
    return p;
}

/// False behind the last page, of which there are `number`. libtiff says the same of one that it cannot read.
bool TiffFile::next_page(std::int64_t number) {
    if (TIFFLastDirectory(tiff_) != 0) return false;
    complaint.clear();
    if (TIFFReadDirectory(tiff_) == 0)
        fail(text("page ", number, " cannot be read", complaint.empty() ? "" : ": ", complaint));
    return true;
}

void TiffFile::read_pages() {
    std::int64_t number = 0;
    do {
        if (++number > most_pages) fail(text("it has more than ", most_pages, " pages"));
        every_.push_back(page_here());
        if (every_.back().width == 0 || every_.back().height == 0) fail(text("page ", number - 1, " has no extent"));
    } while (next_page(number));
}

/// Reads the pages that are like this one, from it on.
void TiffFile::take_like(std::size_t first) {
    pages_.clear();
    numbers_.clear();
    for (std::size_t i = 0; i < every_.size(); ++i)
        if (i >= first && every_[i].alike(every_[first])) {
            pages_.push_back(every_[i]);
            numbers_.push_back(i);
        }
    here_ = static_cast<std::size_t>(-1);
}

/// What the first page says of itself.
void TiffFile::read_words() {
    go_to(0);
    char const* words = nullptr;
    description_.clear();
    if (TIFFGetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, &words) != 0 && words != nullptr) description_ = words;
    float x = 0, y = 0;
    resolution_x_ = resolution_y_ = 0;
    if (TIFFGetField(tiff_, TIFFTAG_XRESOLUTION, &x) != 0 && TIFFGetField(tiff_, TIFFTAG_YRESOLUTION, &y) != 0) {
        resolution_x_ = as_written(x);
        resolution_y_ = as_written(y);
    }
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_RESOLUTIONUNIT, &resolution_unit_);
}

/// Reads a sub-image of each page instead, 1 being the first.
void TiffFile::take_level(std::int64_t level) {
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

/// "page 3" and "level 1", the names that say_not_read() gives.
bool TiffFile::asked_by_number(std::string const& variable) {
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
void TiffFile::open_file(std::size_t number) {
    if (number == file_) return;
    if (other_ != nullptr) TIFFClose(std::exchange(other_, nullptr));
    here_ = static_cast<std::size_t>(-1);
    tiff_ = own_;
    file_ = 0;
    if (number == 0) return;
    std::string const& name = files_[number - 1];
    complaint.clear();
    other_ = TIFFOpen(name.c_str(), "rO");
    if (other_ == nullptr)
        fail(text("the file '", name, "' that its description names cannot be opened: ", complaint),
             "put all files of the image into one folder");
    tiff_ = other_;
    file_ = number;
}

/// Reads planes of other files too, which lie beside this one.
void TiffFile::take_files(TiffDescription& about, bool trust_paths) {
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

/// What the description of the pages says. OME's is in one of them for all, and may speak of pages of another size.
TiffDescription TiffFile::describe(std::string const& image, bool trust_paths) {
    TiffDescribed of{path_,
                     std::ssize(pages_),
                     std::ssize(every_),
                     pages_.front().samples,
                     std::filesystem::path(home_).filename().string(),
                     image};
    TiffDescription about = tiff_description(description_, of);
    if (!about.files.empty() && !full_) {
        take_files(about, trust_paths);
        return about;
    }
    if (full_ && every_[numbers_.front()].reduced) { // of the pages that were reduced nobody says which are there
        about.pages.clear();
        about.slices = about.images = 0;
        about.channels = about.frames = 1;
        about.ours.reset();
    }
    if (about.kind != TiffDescription::Kind::ome || about.pages.empty()) return about;
    auto const first = static_cast<std::size_t>(about.pages.front());
    if (!every_[first].alike(pages_.front()) && !full_) {
        std::string const words = description_;
        take_like(first);
        of.samples = pages_.front().samples;
        about = tiff_description(words, of);
    }
    if (numbers_.front() > first) take_like(first); // planes need not begin on the first page
    for (std::int64_t& page : about.pages) {
        auto const found = std::lower_bound(numbers_.begin(), numbers_.end(), static_cast<std::size_t>(page));
        if (found == numbers_.end() || *found != static_cast<std::size_t>(page))
            fail(text("its OME description places planes of one image on pages of different sizes, such as page ",
                      page));
        page = found - numbers_.begin();
    }
    return about;
}

void TiffFile::say_not_read(std::vector<std::string>& not_read) {
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

DataType TiffFile::type_of(Page const& page) const {
    int const bits = page.bits;
    if (page.compression == COMPRESSION_SGILOG || page.compression == COMPRESSION_SGILOG24 ||
        page.compression == COMPRESSION_OJPEG)
        fail("its pages are encoded for display, as LogLuv or old JPEG", "convert it first: tiffcp -c zip");
    if (page.photometric == PHOTOMETRIC_YCBCR && page.compression != COMPRESSION_JPEG)
        fail("its colours are subsampled (YCbCr)", "convert it first: tiff2rgba");
    if (!TIFFIsCODECConfigured(page.compression))
        fail(text("its compression, number ", static_cast<int>(page.compression), ", is unknown to this libtiff"),
             "convert it first: tiffcp -c zip");
    switch (page.format) {
    case SAMPLEFORMAT_IEEEFP:
        if (bits == 16) return DataType::float16;
        if (bits == 32) return DataType::float32;
        if (bits == 64) return DataType::float64;
        break;
    case SAMPLEFORMAT_INT:
        if (bits == 8) return DataType::int8;
        if (bits == 16) return DataType::int16;
        if (bits == 32) return DataType::int32;
        if (bits == 64) return DataType::int64;
        break;
    case SAMPLEFORMAT_UINT:
    case SAMPLEFORMAT_VOID:
        if (bits == 64) return DataType::uint64;
        if (bits >= 1 && bits <= 32)
            return bits <= 8 ? DataType::uint8 : bits <= 16 ? DataType::uint16 : DataType::uint32;
        break;
    default:
        fail("its values are complex numbers; a volume has one number in each voxel",
             "take a part of them with tifffile");
    }
    fail(text("its values have ", bits, " bits, which no type of voxel has"));
}

/// Nothing is allocated for pages that the file cannot hold.
void TiffFile::check_size(Page const& page, std::int64_t planes) const {
    double const size = bytes_;
    if (!(size > 0)) return;
    double const decoded = static_cast<double>(page.width) * page.height * page.bits / 8 * static_cast<double>(planes);
    if (decoded > size * densest(page.compression) + 64)
        fail(text("ended early: ", planes, " planes of ", static_cast<std::int64_t>(page.width), " by ",
                  static_cast<std::int64_t>(page.height), " pixels are ", bytes_text(decoded), ", the file has ",
                  bytes_text(size)));
}

/// Voxels stay in the order of the file; the geometry says how the picture is to be seen, its origin being the corner
/// that is seen top left.
void orient(Geometry& geometry, Index3 dims, std::uint16_t orientation) {
    bool const rows_are_columns = orientation >= ORIENTATION_LEFTTOP && orientation <= ORIENTATION_LEFTBOT;
    bool const from_right = orientation == ORIENTATION_TOPRIGHT || orientation == ORIENTATION_BOTRIGHT ||
                            orientation == ORIENTATION_RIGHTTOP || orientation == ORIENTATION_RIGHTBOT;
    bool const from_below = orientation == ORIENTATION_BOTRIGHT || orientation == ORIENTATION_BOTLEFT ||
                            orientation == ORIENTATION_RIGHTBOT || orientation == ORIENTATION_LEFTBOT;
    int const across = rows_are_columns ? 1 : 0; // the axis of the volume that is seen as horizontal
    for (int seen = 0; seen < 2; ++seen) {
        int const axis = seen == 0 ? across : 1 - across;
        bool const back = seen == 0 ? from_right : from_below;
        Vec3 direction{0, 0, 0};
        direction[seen] = back ? -1 : 1;
        geometry.direction[static_cast<std::size_t>(axis)] = direction;
        if (back) geometry.origin[seen] = static_cast<double>(dims[axis] - 1) * geometry.spacing[axis];
    }
}

/// Reduced pages show the same as full ones, if their sides are in the same proportion: their pixels are larger, and
/// the middle of the first lies further in, by what is returned along x and y.
Vec3 TiffFile::lie_over_the_full_image(Geometry& geometry) const {
    Vec3 further_in{0, 0, 0};
    if (!full_) return further_in;
    double const x = static_cast<double>(full_->width) / static_cast<double>(dims_.x),
                 y = static_cast<double>(full_->height) / static_cast<double>(dims_.y);
    // Sides are rounded to whole pixels.
    if (std::abs(static_cast<double>(full_->width) / y - static_cast<double>(dims_.x)) > 1 &&
        std::abs(static_cast<double>(full_->height) / x - static_cast<double>(dims_.y)) > 1)
        return further_in; // a picture of something else
    for (int axis = 0; axis < 2; ++axis) {
        double const factor = axis == 0 ? x : y, step = geometry.spacing[axis];
        geometry.spacing[axis] = step * factor;
        further_in[axis] = step * (factor - 1) / 2;
    }
    return further_in;
}

void TiffFile::read_geometry(Header& header, TiffDescription const& about) {
    auto const spacing = [](double resolution, double unit) {
        double const s = unit / resolution;
        return resolution > 0 && std::isfinite(s) && s > 0 ? s : 1;
    };
    std::string unit = about.unit;
    bool const counted = about.kind == TiffDescription::Kind::imagej; // pixels per unit of the description
    if (resolution_x_ > 0 && resolution_y_ > 0) {
        double per = 1;
        if (!counted || (unit.empty() && resolution_unit_ != RESUNIT_NONE)) {
            per = resolution_unit_ == RESUNIT_CENTIMETER ? 10 : resolution_unit_ == RESUNIT_INCH ? 25.4 : 1;
            if (per != 1 && about.kind != TiffDescription::Kind::ome) unit = "mm";
        }
        header.geometry.spacing.x = spacing(resolution_x_, per);
        header.geometry.spacing.y = spacing(resolution_y_, per);
    }
    if (about.kind == TiffDescription::Kind::ome) header.geometry.spacing = {1, 1, 1};
    if (about.spacing_x) header.geometry.spacing.x = *about.spacing_x;
    if (about.spacing_y) header.geometry.spacing.y = *about.spacing_y;
    if (about.spacing_z) header.geometry.spacing.z = *about.spacing_z;
    if (!unit.empty() && unit.find('"') == std::string::npos)
        header.attributes["space units"] = text("\"", unit, "\" \"", unit, "\" \"", unit, "\"");
    if (about.values) header.values = *about.values;
    header.units = about.value_unit;
    Geometry& geometry = header.geometry;
    Vec3 const further_in = lie_over_the_full_image(geometry);
    orient(geometry, dims_, pages_.front().orientation);
    for (int seen = 0; seen < 2; ++seen)
        geometry.origin[seen] +=
            std::abs(geometry.direction[0][seen]) * further_in.x + std::abs(geometry.direction[1][seen]) * further_in.y;
}

/// Which page and sample each slice of each volume is.
void TiffFile::arrange(TiffDescription const& about, ParsedGrids& grids) {
    Page const& first = pages_.front();
    auto const count = static_cast<std::int64_t>(pages_.size());
    std::int64_t slices = about.slices, channels = about.channels, frames = about.frames;
    bool const one_block = count == 1 && about.images > 1;
    std::int64_t const there = one_block ? about.images : count;
    if (slices == 0) slices = there;
    if (about.pages.empty() && slices * channels * frames != there) {
        if (slices * channels * frames > there)
            fail(text("ended early: its description speaks of ", slices * channels * frames, " pages, the file holds ",
                      there));
        slices = there;
        channels = frames = 1;
    }
    std::int64_t const samples = first.samples;
    check_size(first, there * samples);
    grids.volumes = frames * channels * samples;
    dims_ = {first.width, first.height, slices};
    static char const* const rgb[] = {"red", "green", "blue", "alpha"};
    bool const colours = first.photometric == PHOTOMETRIC_RGB || first.photometric == PHOTOMETRIC_YCBCR;
    for (std::int64_t t = 0; t < frames; ++t)
        for (std::int64_t c = 0; c < channels; ++c)
            for (std::int64_t s = 0; s < samples; ++s) {
                for (std::int64_t z = 0; z < slices; ++z) {
                    std::int64_t const page =
                        !about.pages.empty() ? about.pages[static_cast<std::size_t>((t * channels + c) * slices + z)]
                        : about.kind == TiffDescription::Kind::imagej ? (t * slices + z) * channels + c
                                                                      : t * slices + z;
                    planes_.push_back({static_cast<std::size_t>(page), static_cast<std::uint16_t>(s)});
                }
                std::map<std::string, std::string> said;
                std::int64_t const channel = c * samples + s;
                if (channels * samples > 1) {
                    bool const named = channel < std::ssize(about.channel_names) &&
                                       !about.channel_names[static_cast<std::size_t>(channel)].empty();
                    said["channel"] = named              ? about.channel_names[static_cast<std::size_t>(channel)]
                                      : colours && s < 4 ? std::string(rgb[s])
                                                         : to_text(channel);
                }
                if (frames > 1) {
                    said["sequence position"] = to_text(static_cast<double>(t) * about.interval.value_or(1));
                    said["sequence step"] = to_text(about.interval.value_or(1));
                    if (about.interval) said["sequence units"] = "\"s\"";
                }
                if (grids.volumes > 1) grids.attributes.push_back(std::move(said));
            }
}

/// The page's voxels lie in the file as they are wanted, in one piece.
bool TiffFile::dense_at(Page const& page, std::int64_t& place) {
    if (page.compression != COMPRESSION_NONE || page.tiled || page.samples != 1 || page.bits % 8 != 0 ||
        page.bits == 24)
        return false;
    std::uint16_t order = FILLORDER_MSB2LSB;
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_FILLORDER, &order);
    if (order != FILLORDER_MSB2LSB) return false;
    std::uint32_t const strips = TIFFNumberOfStrips(tiff_);
    std::uint64_t next = TIFFGetStrileOffset(tiff_, 0);
    place = static_cast<std::int64_t>(next);
    std::uint64_t const row = std::uint64_t{page.width} * page.bits / 8;
    std::uint32_t rows = 0;
    TIFFGetFieldDefaulted(tiff_, TIFFTAG_ROWSPERSTRIP, &rows);
    rows = std::min(rows, page.height);
    if (rows == 0) return false;
    for (std::uint32_t i = 0; i < strips; ++i) {
        if (TIFFGetStrileOffset(tiff_, i) != next) return false;
        next += row * std::min<std::uint64_t>(rows, page.height - std::uint64_t{i} * rows);
    }
    std::error_code error;
    std::uint64_t const size = std::filesystem::file_size(path_, error);
    if (!error && next > size)
        fail(text("ended early: a page's voxels end at byte ", static_cast<std::int64_t>(next), " of ",
                  static_cast<std::int64_t>(size)));
    return place > 0;
}

void TiffFile::find_places(ParsedGrids& grids, TiffDescription const& about) {
    if (!files_.empty()) return;
    std::vector<std::int64_t> of_page(pages_.size());
    for (std::size_t i = 0; i < pages_.size(); ++i) {
        go_to(i);
        if (!dense_at(pages_[i], of_page[i])) return;
    }
    bool const one_block = pages_.size() == 1 && about.images > 1;
    auto const slice =
        static_cast<std::int64_t>(pages_.front().width) * pages_.front().height * pages_.front().bits / 8;
    for (Plane const& plane : planes_)
        grids.places.push_back(one_block ? of_page[0] + static_cast<std::int64_t>(plane.page) * slice
                                         : of_page[plane.page]);
    grids.big_endian = TIFFIsBigEndian(tiff_) != 0;
}

ParsedGrids TiffFile::open(GridsChoice const& choice) {
    std::string const& variable = choice.variable;
    ParsedGrids grids;
    read_pages();
    std::size_t full = 0; // thumbnails may come first
    while (full < every_.size() && every_[full].reduced) ++full;
    take_like(full < every_.size() ? full : 0);
    read_words();
    bool const by_number = asked_by_number(variable);
    TiffDescription const about = describe(by_number ? "" : variable, choice.trust_paths);
    Page const& first = pages_.front();
    type_ = type_of(first);
    say_not_read(grids.not_read);
    grids.not_read.insert(grids.not_read.end(), about.not_read.begin(), about.not_read.end());
    arrange(about, grids);
    Header& header = grids.header;
    header.dims = dims_;
    header.dtype = type_;
    read_geometry(header, about);
    if (first.photometric == PHOTOMETRIC_MINISWHITE) header.attributes["photometric"] = "min is white";
    if (first.photometric == PHOTOMETRIC_PALETTE) header.attributes["photometric"] = "palette";
    // What vkt wrote has what TIFF has no place for, as long as the rest is still as it was written.
    if (about.ours && about.ours->dims == header.dims && about.ours->dtype == header.dtype &&
        about.ours->kind == Kind::structured) {
        auto const near = [](double a, double b) { return std::abs(a - b) <= 1e-5 * std::abs(b); };
        bool same = true;
        for (int a = 0; a < 3; ++a) same = same && near(header.geometry.spacing[a], about.ours->geometry.spacing[a]);
        Header ours = *about.ours;
        ours.dry_run = ours.timing = false;
        if (!same) ours.geometry = header.geometry;
        header = std::move(ours);
    }
    for (auto const& plane : planes_)
        if (plane.page >= pages_.size() && !(about.images > 1 && pages_.size() == 1))
            fail(text("has no page ", static_cast<std::int64_t>(plane.page)));
    find_places(grids, about);
    if (grids.places.empty() && about.images > 1 && pages_.size() == 1)
        fail(text("its description speaks of ", about.images, " pages, the file holds one"));
    if (!variable.empty() && !by_number && !about.image_found) { // one of the channels
        auto const named = [&](std::size_t v) {
            if (v >= grids.attributes.size()) return false;
            auto const found = grids.attributes[v].find("channel");
            return found != grids.attributes[v].end() && found->second == variable;
        };
        ParsedGrids chosen = grids;
        std::vector<Plane> planes;
        chosen.attributes.clear();
        chosen.places.clear();
        chosen.volumes = 0;
        auto const slices = static_cast<std::size_t>(dims_.z);
        for (std::size_t v = 0; v < static_cast<std::size_t>(grids.volumes); ++v) {
            if (!named(v)) continue;
            ++chosen.volumes;
            chosen.attributes.push_back(grids.attributes[v]);
            for (std::size_t z = v * slices; z < (v + 1) * slices; ++z) {
                planes.push_back(planes_[z]);
                if (!grids.places.empty()) chosen.places.push_back(grids.places[z]);
            }
        }
        if (chosen.volumes == 0) {
            std::vector<std::string> names;
            for (auto const& said : grids.attributes)
                if (auto const found = said.find("channel");
                    found != said.end() && std::find(names.begin(), names.end(), found->second) == names.end())
                    names.push_back(found->second);
            throw Error(ErrorKind::usage,
                        text("'", path_, "' has no channel '", variable, "'",
                             names.empty() ? "" : text("; it holds ", join(names, ", "))),
                        "what else may be named, vkt info says to be not read");
        }
        planes_ = std::move(planes);
        return chosen;
    }
    return grids;
}

void TiffFile::go_to(std::size_t page) {
    open_file(pages_[page].file);
    if (here_ == page) return;
    complaint.clear();
    if (TIFFSetSubDirectory(tiff_, pages_[page].offset) == 0)
        fail(text("page ", static_cast<std::int64_t>(page), " cannot be read: ", complaint));
    if (pages_[page].photometric == PHOTOMETRIC_YCBCR && pages_[page].compression == COMPRESSION_JPEG)
        TIFFSetField(tiff_, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    here_ = page;
}

/// A strip or tile, decoded.
std::byte const* TiffFile::unit(std::size_t page, std::uint32_t index, std::size_t bytes) {
    if (held_page_ == page && held_unit_ == index && held_.size() == bytes) return held_.data();
    held_page_ = static_cast<std::size_t>(-1);
    held_.resize(bytes);
    complaint.clear();
    auto const size = static_cast<tmsize_t>(bytes);
    tmsize_t const got = pages_[page].tiled ? TIFFReadEncodedTile(tiff_, index, held_.data(), size)
                                            : TIFFReadEncodedStrip(tiff_, index, held_.data(), size);
    if (got < size)
        fail(text("damaged: ", pages_[page].tiled ? "tile " : "strip ", static_cast<std::int64_t>(index), " of page ",
                  static_cast<std::int64_t>(page), " cannot be decoded", complaint.empty() ? "" : ": ", complaint));
    held_page_ = page;
    held_unit_ = index;
    return held_.data();
}

void TiffFile::copy_row(Page const& page, std::byte const* row, std::uint32_t first, std::uint32_t count,
                        std::uint16_t sample, std::byte* to) const {
    std::size_t const per_pixel = page.planar == PLANARCONFIG_SEPARATE ? 1 : page.samples;
    std::size_t const element = size_of(type_);
    if (page.bits == 8 * element) {
        std::byte const* from = row + (first * per_pixel + sample) * element;
        if (per_pixel == 1) {
            std::memcpy(to, from, count * element);
            return;
        }
        for (std::uint32_t i = 0; i < count; ++i)
            std::memcpy(to + i * element, from + i * per_pixel * element, element);
        return;
    }
    for (std::uint32_t i = 0; i < count; ++i) {
        std::size_t bit = ((first + i) * per_pixel + sample) * page.bits;
        std::uint32_t value = 0;
        if (page.bits == 24) { // libtiff has put its bytes into the order of this machine
            std::byte const* const p = row + bit / 8;
            value = std::to_integer<std::uint32_t>(p[0]) | std::to_integer<std::uint32_t>(p[1]) << 8 |
                    std::to_integer<std::uint32_t>(p[2]) << 16;
        } else {
            for (int left = page.bits; left > 0; --left, ++bit)
                value = value << 1 | (std::to_integer<std::uint32_t>(row[bit / 8]) >> (7 - bit % 8) & 1u);
        }
        if (element == 1) {
            to[i] = static_cast<std::byte>(value);
        } else if (element == 2) {
            auto const narrow = static_cast<std::uint16_t>(value);
            std::memcpy(to + i * 2, &narrow, 2);
        } else {
            std::memcpy(to + i * 4, &value, 4);
        }
    }
}

void TiffFile::read(std::int64_t volume, Box const& box, std::byte* to) {
    std::size_t const element = size_of(type_);
    Index3 const size = box.dims();
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z) {
        Plane const plane = planes_[static_cast<std::size_t>(volume * dims_.z + z)];
        go_to(plane.page);
        Page const& page = pages_[plane.page];
        auto const y0 = static_cast<std::uint32_t>(box.lower.y), y1 = static_cast<std::uint32_t>(box.upper.y);
        auto const x0 = static_cast<std::uint32_t>(box.lower.x), x1 = static_cast<std::uint32_t>(box.upper.x);
        std::uint16_t const apart = page.planar == PLANARCONFIG_SEPARATE ? plane.sample : std::uint16_t{0};
        std::uint16_t const within = page.planar == PLANARCONFIG_SEPARATE ? std::uint16_t{0} : plane.sample;
        std::byte* const slice = to + static_cast<std::size_t>((z - box.lower.z) * size.x * size.y) * element;
        auto const place = [&](std::uint32_t x, std::uint32_t y) {
            return slice + (static_cast<std::size_t>(y - y0) * static_cast<std::size_t>(size.x) + (x - x0)) * element;
        };
        if (page.tiled) {
            std::uint32_t width = 0, height = 0;
            TIFFGetField(tiff_, TIFFTAG_TILEWIDTH, &width);
            TIFFGetField(tiff_, TIFFTAG_TILELENGTH, &height);
            auto const bytes = static_cast<std::size_t>(TIFFTileSize64(tiff_));
            auto const row = static_cast<std::size_t>(TIFFTileRowSize64(tiff_));
            if (width == 0 || height == 0 || bytes == 0 || row * height > bytes)
                fail("damaged: its tiles have no size");
            for (std::uint32_t ty = y0 / height * height; ty < y1; ty += height)
                for (std::uint32_t tx = x0 / width * width; tx < x1; tx += width) {
                    std::byte const* const tile = unit(plane.page, TIFFComputeTile(tiff_, tx, ty, 0, apart), bytes);
                    std::uint32_t const from = std::max(tx, x0), until = std::min(tx + width, x1);
                    for (std::uint32_t y = std::max(ty, y0); y < std::min(ty + height, y1); ++y)
                        copy_row(page, tile + (y - ty) * row, from - tx, until - from, within, place(from, y));
                }
            continue;
        }
        std::uint32_t rows = 0;
        TIFFGetFieldDefaulted(tiff_, TIFFTAG_ROWSPERSTRIP, &rows);
        rows = std::min(rows, page.height);
        auto const row = static_cast<std::size_t>(TIFFScanlineSize64(tiff_));
        if (rows == 0 || row == 0) fail("damaged: its strips have no rows");
        for (std::uint32_t sy = y0 / rows * rows; sy < y1; sy += rows) {
            std::uint32_t const here = std::min(rows, page.height - sy);
            std::byte const* const strip =
                unit(plane.page, TIFFComputeStrip(tiff_, sy, apart), row * std::size_t{here});
            for (std::uint32_t y = std::max(sy, y0); y < std::min(sy + rows, y1); ++y)
                copy_row(page, strip + (y - sy) * row, x0, x1 - x0, within, place(x0, y));
        }
    }
}

} // namespace

std::unique_ptr<GridsParser> open(std::string const& path) { return std::make_unique<TiffFile>(path); }

} // namespace vkt::tiff

namespace vkt {
namespace {
TiffFunctions const functions{tiff::writer};
ParserHandler parse(std::string const& path) {
    return answer_about_grids([path] { return tiff::open(path); });
}
} // namespace
} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_tiff;
vkt::ModuleExport const vkt_module_tiff{VKT_VERSION, &vkt::functions, &vkt::parse};
}
