// TIFF: the pages of a file, and of others that its description names, and which of them are read.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/tiff/description.h"

#include <tiffio.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt::tiff {

/// What its directory says of a page.
struct Page {
    std::size_t file = 0; ///< 0: the one that was opened, others are those of its description
    std::uint64_t offset = 0;
    std::uint32_t width = 0, height = 0;
    std::uint16_t bits = 1, format = SAMPLEFORMAT_UINT, samples = 1, planar = PLANARCONFIG_CONTIG, photometric = 0,
                  compression = COMPRESSION_NONE, orientation = ORIENTATION_TOPLEFT;
    std::uint16_t predictor = PREDICTOR_NONE; ///< stated, and not undone by libtiff
    bool tiled = false;
    /// Where its voxels begin and end in the file, if they lie there as they are wanted and in one piece; else 0.
    std::uint64_t begin = 0, end = 0;
    bool reduced = false;    ///< of another page, or a mask
    std::int64_t levels = 0; ///< sub-images, smaller ones of the same

    bool alike(Page const& o) const {
        return reduced == o.reduced && width == o.width && height == o.height && bits == o.bits && format == o.format &&
               samples == o.samples;
    }
};

/// What the first page says of itself.
struct Words {
    std::string description;
    double resolution_x = 0, resolution_y = 0;
    std::uint16_t resolution_unit = RESUNIT_INCH;
};

/// All pages, and those of them that are taken, of which libtiff has one open. Functions throw Error{data} for what
/// cannot be read.
class Pages {
public:
    explicit Pages(std::string const& path);
    ~Pages();
    Pages(Pages const&) = delete;
    Pages& operator=(Pages const&) = delete;

    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const;
    /// Notes every page of the file that is open.
    void read_pages();
    /// Takes the pages that are like this one, from it on.
    void take_like(std::size_t first);
    /// Notes what the first of those that are taken says.
    void read_words();
    /// Takes the pages that are asked for by "page 3" or "level 1", the names that say_not_read() gives. False for
    /// other words. Throws Error{usage} if there is no such page or level.
    bool asked_by_number(std::string const& variable);
    /// Reads planes of other files too, which lie beside this one.
    void take_files(TiffDescription& about, bool trust_paths);
    /// Adds the pages and levels that are there besides.
    void say_not_read(std::vector<std::string>& not_read);
    /// Lets libtiff read that one of taken().
    void go_to(std::size_t page);

    std::string const& path() const { return path_; }
    std::string const& home() const { return home_; } ///< where it lies
    bool several_files() const { return !files_.empty(); }
    double bytes() const { return bytes_; }                              ///< of all files
    TIFF* handle() const { return tiff_; }                               ///< at the page of the last go_to()
    std::vector<Page> const& every() const { return every_; }            ///< in the order of the file
    std::vector<Page> const& taken() const { return pages_; }            ///< those that are read, of one size
    std::vector<std::size_t> const& numbers() const { return numbers_; } ///< of those among all, ascending
    std::optional<Page> const& full() const { return full_; }            ///< of which those are reduced ones
    Words const& words() const { return words_; }

private:
    Page page_here();
    bool next_page(std::int64_t number);
    void take_level(std::int64_t level);
    void open_file(std::size_t number);

    std::string path_, home_;                                  ///< home_: where it lies
    TIFF *tiff_ = nullptr, *own_ = nullptr, *other_ = nullptr; ///< tiff_: that which is open of the other two
    std::size_t file_ = 0;                                     ///< its number
    std::vector<std::string> files_;                           ///< others, from number 1 on
    double bytes_ = 0;                                         ///< of all of them
    bool laser_microscope_ = false;                            ///< it is of Zeiss's
    std::vector<Page> every_;                                  ///< in the order of the file
    std::vector<std::size_t> numbers_;                         ///< of pages_ among them
    std::vector<Page> pages_;                                  ///< those that are read, of one size
    std::optional<Page> full_;                                 ///< of which the pages are reduced ones
    Words words_;
    std::size_t here_ = static_cast<std::size_t>(-1); ///< page of libtiff
};

} // namespace vkt::tiff
