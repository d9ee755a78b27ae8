// Reading TIFF with libtiff: stacks of pages, as their description says, and their voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/tiff/description.h"
#include "libvkt/formats/tiff/layout.h"
#include "libvkt/formats/tiff/pages.h"
#include "libvkt/formats/tiff/voxels.h"
#include "libvkt/formats/tiff_module.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace vkt::tiff {
namespace {

class TiffFile : public GridsParser {
public:
    explicit TiffFile(std::string const& path) : pages_(path) {}

    ParsedGrids open(GridsChoice const& choice) override;
    void read(std::int64_t volume, Box const& box, std::byte* to) override;

private:
    TiffDescription describe(std::string const& image, bool trust_paths);

    Pages pages_;
    std::vector<Plane> planes_; ///< slices of all volumes
    Index3 dims_;
    DataType type_ = DataType::uint8;
    PlaneReader reader_;
};

/// What the description of the pages says. OME's is in one of them for all, and may speak of pages of another size.
TiffDescription TiffFile::describe(std::string const& image, bool trust_paths) {
    TiffDescribed of{pages_.path(),
                     std::ssize(pages_.taken()),
                     std::ssize(pages_.every()),
                     pages_.taken().front().samples,
                     std::filesystem::path(pages_.home()).filename().string(),
                     image};
    TiffDescription about = tiff_description(pages_.words().description, of);
    if (!about.files.empty() && !pages_.full()) {
        pages_.take_files(about, trust_paths);
        return about;
    }
    // Of the pages that were reduced nobody says which are there.
    if (pages_.full() && pages_.every()[pages_.numbers().front()].reduced) {
        about.pages.clear();
        about.slices = about.images = 0;
        about.channels = about.frames = 1;
        about.ours.reset();
    }
    if (about.kind != TiffDescription::Kind::ome || about.pages.empty()) return about;
    auto const first = static_cast<std::size_t>(about.pages.front());
    if (!pages_.every()[first].alike(pages_.taken().front()) && !pages_.full()) {
        std::string const words = pages_.words().description;
        pages_.take_like(first);
        of.samples = pages_.taken().front().samples;
        about = tiff_description(words, of);
    }
    if (pages_.numbers().front() > first) pages_.take_like(first); // planes need not begin on the first page
    for (std::int64_t& page : about.pages) {
        auto const found =
            std::lower_bound(pages_.numbers().begin(), pages_.numbers().end(), static_cast<std::size_t>(page));
        if (found == pages_.numbers().end() || *found != static_cast<std::size_t>(page))
            pages_.fail(text(
                "its OME description places planes of one image on pages of different sizes, such as page ", page));
        page = found - pages_.numbers().begin();
    }
    return about;
}

/// They begin where the first volume lay, and have the unit that it stated.
void use_our_times(std::int64_t frames, ParsedGrids& grids) {
    auto const first = number_of(grids.header, "sequence position"), step = number_of(grids.header, "sequence step");
    std::vector<std::string> uneven;
    if (auto const found = grids.header.attributes.find(uneven_times); found != grids.header.attributes.end()) {
        uneven = words_of(found->second);
        grids.header.attributes.erase(found);
    }
    bool const listed = std::ssize(uneven) == frames;
    if (frames < 2 || (!listed && (!first || !step))) return;
    auto const each = grids.attributes.size() / static_cast<std::size_t>(frames);
    for (std::size_t v = 0; v < grids.attributes.size(); ++v) {
        for (char const* const name : {"sequence step", "sequence units"}) grids.attributes[v].erase(name);
        std::size_t const time = v / each;
        grids.attributes[v]["sequence position"] =
            listed ? uneven[time] : to_text(*first + static_cast<double>(time) * *step);
    }
}

ParsedGrids TiffFile::open(GridsChoice const& choice) {
    std::string const& variable = choice.variable;
    ParsedGrids grids;
    pages_.read_pages();
    std::size_t full = 0; // thumbnails may come first
    while (full < pages_.every().size() && pages_.every()[full].reduced) ++full;
    pages_.take_like(full < pages_.every().size() ? full : 0);
    pages_.read_words();
    bool const by_number = pages_.asked_by_number(variable);
    TiffDescription const about = describe(by_number ? "" : variable, choice.trust_paths);
    Page const& first = pages_.taken().front();
    type_ = type_of(pages_, first);
    pages_.say_not_read(grids.not_read);
    grids.not_read.insert(grids.not_read.end(), about.not_read.begin(), about.not_read.end());
    planes_ = arrange(pages_, about, grids);
    Header& header = grids.header;
    dims_ = header.dims;
    header.dtype = type_;
    read_geometry(pages_, about, header);
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
        use_our_times(about.frames, grids);
    }
    for (auto const& plane : planes_)
        if (plane.page >= pages_.taken().size() && !(about.images > 1 && pages_.taken().size() == 1))
            pages_.fail(text("has no page ", static_cast<std::int64_t>(plane.page)));
    find_places(pages_, planes_, about, grids);
    if (grids.places.empty() && about.images > 1 && pages_.taken().size() == 1)
        pages_.fail(text("its description speaks of ", about.images, " pages, the file holds one"));
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
                        text("'", pages_.path(), "' has no channel '", variable, "'",
                             names.empty() ? "" : text("; it holds ", join(names, ", "))),
                        "what else may be named, vkt info says to be not read");
        }
        planes_ = std::move(planes);
        return chosen;
    }
    return grids;
}

void TiffFile::read(std::int64_t volume, Box const& box, std::byte* to) {
    std::size_t const element = size_of(type_);
    Index3 const size = box.dims();
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z) {
        Plane const plane = planes_[static_cast<std::size_t>(volume * dims_.z + z)];
        std::byte* const slice = to + static_cast<std::size_t>((z - box.lower.z) * size.x * size.y) * element;
        reader_.read(pages_, plane, type_, box, slice);
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
