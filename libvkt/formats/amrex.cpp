// The AMReX plotfile reader.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/amrex.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/amrex_header.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

namespace vkt {

namespace {

/// Where the cells of a brick come from.
struct Piece {
    std::size_t level, box;
    Box cells; ///< in the level's own cells
};

/// What is left of a box when another is taken away: at most six boxes.
void subtract(Box const& whole, Box const& hole, std::vector<Box>& rest) {
    Box const cut = intersect(whole, hole);
    if (cut.empty()) {
        rest.push_back(whole);
        return;
    }
    Box left = whole;
    for (int a = 2; a >= 0; --a) { // slabs along z first: long rows stay whole
        Box low = left, high = left;
        low.upper[a] = cut.lower[a];
        high.lower[a] = cut.upper[a];
        if (!low.empty()) rest.push_back(low);
        if (!high.empty()) rest.push_back(high);
        left.lower[a] = cut.lower[a];
        left.upper[a] = cut.upper[a];
    }
}

std::int64_t floor_divide(std::int64_t a, std::int64_t b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

/// The record of a box that was read last: the pieces of a box follow one another.
struct Record {
    amrex::BoxData const* box = nullptr;
    amrex::FabHeader fab;
    std::vector<std::byte> bytes; ///< of one variable
};

class Plotfile : public AmrFile, public std::enable_shared_from_this<Plotfile> {
public:
    explicit Plotfile(std::string const& path) : path_(path), header_(amrex::read_headers(path)) {
        if (header_.coordinate_system != 0)
            throw Error(ErrorKind::data,
                        text(path_, ": has ", header_.coordinate_system == 1 ? "cylindrical" : "spherical",
                             " coordinates, and only Cartesian ones can be read"),
                        "cells would be drawn in the wrong place and weighted by the wrong volume");
        order_records();
        find_pieces();
        describe();
    }

    AmrListing const& listing() const override { return listing_; }
    BrickSequence read(AmrReadOptions const& options, Execution const& execution) override;

private:
    [[noreturn]] void refuse(std::string const& why) const { throw Error(ErrorKind::data, text(path_, ": ", why)); }

    void find_pieces();
    void describe();
    int bytes_of_number() const;
    void order_records();
    std::vector<Box> coarsened(std::size_t level) const;
    void read_record(Piece const& piece, std::size_t component, Record& record) const;
    void check_next(std::ifstream& file, std::string const& where, std::int64_t next) const;
    void check_range(Piece const& piece, std::size_t component, std::byte const* cells, DataType dtype) const;

    std::string path_;
    amrex::PlotHeader header_;
    std::map<std::string, std::set<std::int64_t>> offsets_; ///< where the records of each file begin
    std::vector<Piece> pieces_;
    AmrListing listing_;
};

/// The boxes of a level in cells of the next coarser one.
std::vector<Box> Plotfile::coarsened(std::size_t level) const {
    std::vector<Box> boxes;
    std::int64_t const ratio = header_.ratios[level - 1];
    for (auto const& data : header_.levels[level].boxes) {
        Box box = data.box;
        for (int a = 0; a < header_.dimensions; ++a) {
            if (floor_divide(box.lower[a], ratio) * ratio != box.lower[a] ||
                floor_divide(box.upper[a], ratio) * ratio != box.upper[a])
                refuse(text("box ", box, " of level ", static_cast<std::int64_t>(level), " cuts coarse cells"));
            box.lower[a] = floor_divide(box.lower[a], ratio);
            box.upper[a] = floor_divide(box.upper[a], ratio);
        }
        boxes.push_back(box);
    }
    return boxes;
}

void Plotfile::find_pieces() {
    for (std::size_t l = 0; l < header_.ratios.size(); ++l)
        if (header_.ratios[l] < 2 || !std::has_single_bit(static_cast<unsigned>(header_.ratios[l])))
            refuse(text("refinement ratio ", header_.ratios[l], " is not a power of two"));
    for (std::size_t l = header_.levels.size(); l-- > 0;) {
        auto const& boxes = header_.levels[l].boxes;
        std::vector<Box> covers;
        BrickIndex index;
        Box const domain = header_.levels[l].domain;
        if (l + 1 < header_.levels.size()) {
            covers = coarsened(l + 1);
            index = BrickIndex(domain.dims(), collect(covers, [&](Box const& cover) {
                                   return Brick{cover.lower - domain.lower, cover.dims(), 0};
                               }));
        }
        std::vector<std::int32_t> near;
        for (std::size_t b = 0; b < boxes.size(); ++b) {
            if (!domain.contains(boxes[b].box))
                refuse(text("box ", boxes[b].box, " leaves the domain of level ", static_cast<std::int64_t>(l)));
            std::vector<Box> left{boxes[b].box}, next;
            Vec3 lower, upper;
            for (int a = 0; a < 3; ++a) {
                lower[a] = static_cast<double>(boxes[b].box.lower[a] - domain.lower[a]);
                upper[a] = static_cast<double>(boxes[b].box.upper[a] - domain.lower[a]);
            }
            index.query(lower, upper, near);
            for (std::int32_t const id : near) {
                next.clear();
                for (Box const& part : left) subtract(part, covers[static_cast<std::size_t>(id)], next);
                left.swap(next);
            }
            for (Box const& part : left) pieces_.push_back({l, b, part});
        }
    }
}

/// Of the first record, which stands for all.
int Plotfile::bytes_of_number() const {
    if (header_.levels[0].numbers) return header_.levels[0].numbers->bytes;
    auto const& first = header_.levels[0].boxes[0];
    std::ifstream file = amrex::open_part(path_ + "/" + first.file);
    std::string line;
    file.seekg(first.offset);
    if (!file || !std::getline(file, line)) refuse(text("cannot read ", first.file));
    return amrex::parse_fab(line, first.file, header_.dimensions).bytes;
}

void Plotfile::describe() {
    std::size_t const finest = header_.levels.size() - 1;
    Header& header = listing_.header;
    mark_as_given(header);
    listing_.format = "AMReX plotfile";
    listing_.dimensions = header_.dimensions;
    header.kind = Kind::hierarchical;
    header.attributes["time"] = to_text(header_.time);
    std::vector<int> shift(finest + 1, 0); // level of the tree: doublings between a level and the finest
    for (std::size_t l = finest; l-- > 0;)
        shift[l] = shift[l + 1] + std::countr_zero(static_cast<unsigned>(header_.ratios[l]));
    if (shift[0] > max_level) refuse("has more refinement than can be handled");
    Box const domain = header_.levels[0].domain;
    for (int a = 0; a < header_.dimensions; ++a) {
        if (domain.dims()[a] > max_extent >> shift[0]) refuse("the logical grid is absurdly large");
        header.dims[a] = domain.dims()[a] << shift[0];
        double const width = header_.upper[a] - header_.lower[a];
        header.geometry.spacing[a] = width / static_cast<double>(header.dims[a]);
        header.geometry.origin[a] = header_.lower[a] + 0.5 * header.geometry.spacing[a];
    }
    for (Piece const& piece : pieces_) {
        Brick brick{{0, 0, 0}, piece.cells.dims(), shift[piece.level]};
        for (int a = 0; a < header_.dimensions; ++a) {
            // Levels count cells from the same corner; the coarsest domain says where it is.
            std::int64_t const corner = domain.lower[a] << (shift[0] - shift[piece.level]);
            brick.lower[a] = (piece.cells.lower[a] - corner) << brick.level;
        }
        listing_.bricks.push_back(brick);
        header.cell_count += brick.cells();
        header.level_count = std::max(header.level_count, brick.level + 1);
    }
    header.brick_count = static_cast<std::int64_t>(listing_.bricks.size());
    for (auto const& level : header_.levels) listing_.blocks_in_file += static_cast<std::int64_t>(level.boxes.size());
    try {
        validate_tree(header.dims, listing_.bricks, Coverage::complete);
    } catch (Error const& error) {
        refuse(error.what());
    }
    DataType const dtype = bytes_of_number() == 4 ? DataType::float32 : DataType::float64;
    for (std::size_t c = 0; c < header_.names.size(); ++c) {
        AmrVariable variable{header_.names[c], dtype, {}, {}};
        for (auto const& level : header_.levels)
            for (std::size_t at = c; at < level.maxima.size(); at += header_.names.size()) {
                variable.minimum = std::min(variable.minimum.value_or(level.minima[at]), level.minima[at]);
                variable.maximum = std::max(variable.maximum.value_or(level.maxima[at]), level.maxima[at]);
            }
        listing_.variables.push_back(variable);
    }
    header.dtype = dtype;
}

template <class T, class Stored> std::byte* copy_cells(Record const& record, Box const& cells, std::byte* to) {
    using Word = std::conditional_t<sizeof(Stored) == 8, std::uint64_t, std::uint32_t>;
    amrex::FabHeader const& fab = record.fab;
    Index3 const n = fab.box.dims();
    bool const swap = fab.big_endian != (std::endian::native == std::endian::big);
    for (std::int64_t z = cells.lower.z; z < cells.upper.z; ++z)
        for (std::int64_t y = cells.lower.y; y < cells.upper.y; ++y) {
            std::int64_t const row =
                ((z - fab.box.lower.z) * n.y + y - fab.box.lower.y) * n.x + cells.lower.x - fab.box.lower.x;
            std::byte const* from = record.bytes.data() + static_cast<std::size_t>(row) * sizeof(Word);
            for (std::int64_t x = cells.lower.x; x < cells.upper.x; ++x, from += sizeof(Word), to += sizeof(T)) {
                Word word;
                std::memcpy(&word, from, sizeof word);
                if (swap)
                    word = sizeof(Word) == 8 ? static_cast<Word>(__builtin_bswap64(word))
                                             : static_cast<Word>(__builtin_bswap32(static_cast<std::uint32_t>(word)));
                T const value = static_cast<T>(std::bit_cast<Stored>(word));
                std::memcpy(to, &value, sizeof value);
            }
        }
    return to;
}

/// Writes the cells of a record as `dtype` and returns where the next ones go.
std::byte* copy_cells(Record const& record, DataType dtype, Box const& cells, std::byte* to) {
    bool const single = record.fab.bytes == 4;
    if (dtype == DataType::float32)
        return single ? copy_cells<float, float>(record, cells, to) : copy_cells<float, double>(record, cells, to);
    return single ? copy_cells<double, float>(record, cells, to) : copy_cells<double, double>(record, cells, to);
}

/// Every box has a record of its own.
void Plotfile::order_records() {
    for (auto const& level : header_.levels)
        for (auto const& box : level.boxes)
            if (!offsets_[box.file].insert(box.offset).second)
                refuse(text(box.file, ": two boxes are said to lie at byte ", box.offset));
}

/// Where the next record should begin one does: what a file has lost in the middle would pass for cells otherwise.
void Plotfile::check_next(std::ifstream& file, std::string const& where, std::int64_t next) const {
    char begin[4] = {};
    file.seekg(next);
    if (!file.read(begin, sizeof begin) || std::memcmp(begin, "FAB ", sizeof begin) != 0)
        refuse(text(where, " is damaged: no record follows it at byte ", next));
}

void Plotfile::read_record(Piece const& piece, std::size_t component, Record& record) const {
    amrex::Level const& level = header_.levels[piece.level];
    amrex::BoxData const& box = level.boxes[piece.box];
    std::string const where = text(box.file, ": the record at byte ", box.offset, " of box ", box.box);
    std::ifstream file = amrex::open_part(path_ + "/" + box.file);
    record.box = nullptr;
    Box const expected = grow(box.box, level.ghosts);
    file.seekg(box.offset);
    if (level.numbers) {
        record.fab = *level.numbers;
        record.fab.box = expected;
    } else {
        std::string line;
        if (!std::getline(file, line) || line.size() > 4096) refuse(text(where, " ended early"));
        record.fab = amrex::parse_fab(line, text(path_, ": ", where), header_.dimensions);
    }
    amrex::FabHeader const& fab = record.fab;
    if (!(fab.box == expected)) refuse(text(where, " says that it holds box ", fab.box, ", not ", expected));
    if (fab.components != level.components)
        refuse(text(where, " says that it holds ", fab.components, " components, not ", level.components));
    auto const begin = static_cast<std::int64_t>(file.tellg());
    // Before memory is taken the file must be long enough to fill it.
    double const size = volume_of(fab.box.dims()) * fab.bytes;
    double const end = static_cast<double>(begin) + size * static_cast<double>(fab.components);
    std::error_code error;
    auto const length = static_cast<double>(std::filesystem::file_size(path_ + "/" + box.file, error));
    if (error || end > length) refuse(text(where, " ended early"));
    auto const& offsets = offsets_.at(box.file);
    if (auto const next = offsets.upper_bound(box.offset); next != offsets.end()) {
        if (end > static_cast<double>(*next)) refuse(text(where, " reaches into the one at byte ", *next));
        if (!level.numbers) check_next(file, where, *next);
    }
    record.bytes.resize(static_cast<std::size_t>(fab.box.voxels()) * static_cast<std::size_t>(fab.bytes));
    file.seekg(begin + static_cast<std::int64_t>(record.bytes.size()) * static_cast<std::int64_t>(component));
    if (!file.read(reinterpret_cast<char*>(record.bytes.data()), static_cast<std::streamsize>(record.bytes.size())))
        refuse(text(where, " ended early"));
    record.box = &box;
}

/// Cells lie in the range that the level's table states for their box, if it states one. NaN is nobody's extreme.
void Plotfile::check_range(Piece const& piece, std::size_t component, std::byte const* cells, DataType dtype) const {
    amrex::Level const& level = header_.levels[piece.level];
    std::size_t const at = piece.box * header_.names.size() + component;
    if (at >= level.minima.size() || at >= level.maxima.size()) return;
    double const low = level.minima[at], high = level.maxima[at];
    if (!std::isfinite(low) || !std::isfinite(high)) return;
    // Tables are made before numbers become float32, which holds less.
    double const rounding = 1e-6 * std::max(std::abs(low), std::abs(high)) + (dtype == DataType::float32 ? 2e-45 : 0);
    auto const check = [&]<class T>(T const* value) {
        T const least = static_cast<T>(low - rounding), most = static_cast<T>(high + rounding);
        for (std::int64_t i = 0; i < piece.cells.voxels(); ++i) {
            if (!(value[i] < least || value[i] > most)) continue;
            amrex::BoxData const& box = level.boxes[piece.box];
            refuse(text(box.file, ": the record at byte ", box.offset, " of box ", box.box, " is damaged: it holds ",
                        value[i], ", and ", header_.names[component], " is stated to lie in ", low, " to ", high));
        }
    };
    if (dtype == DataType::float32)
        check(reinterpret_cast<float const*>(cells));
    else
        check(reinterpret_cast<double const*>(cells));
}

BrickSequence Plotfile::read(AmrReadOptions const& options, Execution const&) {
    std::size_t const v = choose_variable(listing_.variables, options.variable, path_);
    Header header = listing_.header;
    header.dtype = options.dtype.value_or(listing_.variables[v].dtype);
    if (header.dtype != DataType::float32 && header.dtype != DataType::float64)
        throw Error(ErrorKind::usage,
                    text(path_, ": plotfile variables are read as float32 or float64, not ", header.dtype),
                    "convert afterwards: vkt convert");
    header.attributes["variable"] = listing_.variables[v].name;
    std::optional<Box> const region = wanted_box(options, header);
    if (region) header.attributes["roi"] = to_text(*region);
    std::vector<std::size_t> kept = bricks_within(region, listing_.bricks, header.dims);
    std::vector<Brick> bricks = collect(kept, [&](std::size_t k) { return listing_.bricks[k]; });
    DataType const dtype = header.dtype;
    return {std::move(header), std::move(bricks),
            [file = shared_from_this(), kept = std::move(kept), v, dtype,
             record = Record{}](std::size_t first, std::size_t count, std::byte* to) mutable {
                for (std::size_t i = first; i < first + count; ++i) {
                    Piece const& piece = file->pieces_[kept[i]];
                    amrex::BoxData const& box = file->header_.levels[piece.level].boxes[piece.box];
                    if (record.box != &box) file->read_record(piece, v, record);
                    std::byte const* const cells = to;
                    to = copy_cells(record, dtype, piece.cells, to);
                    file->check_range(piece, v, cells, dtype);
                }
            }};
}

} // namespace

bool is_amrex(std::string const& path) {
    std::error_code error;
    return std::filesystem::is_directory(path, error) && std::filesystem::is_regular_file(path + "/Header", error);
}

std::shared_ptr<AmrFile> open_amrex(std::string const& path) { return std::make_shared<Plotfile>(path); }

AmrListing list_amrex(std::string const& path) { return open_amrex(path)->listing(); }

Volume read_amrex(std::string const& path, AmrReadOptions const& options, Execution const& execution) {
    return open_amrex(path)->read(options, execution).whole();
}

} // namespace vkt
