// The AMReX plotfile reader.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/amrex.h"

#include "libvkt/amr/amrex_header.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

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

class Plotfile {
public:
    explicit Plotfile(std::string const& path) : path_(path), header_(amrex::read_headers(path)) {
        find_pieces();
        describe();
    }

    AmrListing take_listing() { return std::move(listing_); }
    Volume read(AmrReadOptions const& options, Execution const& execution);

private:
    [[noreturn]] void refuse(std::string const& why) const { throw Error(ErrorKind::data, text(path_, ": ", why)); }

    void find_pieces();
    void describe();
    std::vector<Box> coarsened(std::size_t level) const;
    Volume read_pieces(Header const& header, std::vector<std::size_t> const& kept, std::size_t component);
    template <class T, class Stored>
    void copy_piece(std::vector<std::byte> const& bytes, amrex::FabHeader const& fab, Box const& cells, T* to) const;

    std::string path_;
    amrex::PlotHeader header_;
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

void Plotfile::describe() {
    std::size_t const finest = header_.levels.size() - 1;
    Header& header = listing_.header;
    listing_.format = "AMReX plotfile";
    listing_.dimensions = header_.dimensions;
    header.kind = Kind::hierarchical;
    header.attributes["time"] = to_text(header_.time);
    if (header_.coordinate_system != 0)
        header.attributes["coordinates"] = header_.coordinate_system == 1 ? "cylindrical" : "spherical";
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
    auto const& first = header_.levels[0].boxes[0];
    std::ifstream file(path_ + "/" + first.file, std::ios::binary);
    std::string line;
    file.seekg(first.offset);
    if (!file || !std::getline(file, line)) refuse(text("cannot read ", first.file));
    DataType const dtype =
        amrex::parse_fab(line, first.file, header_.dimensions).bytes == 4 ? DataType::float32 : DataType::float64;
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

template <class T, class Stored>
void Plotfile::copy_piece(std::vector<std::byte> const& bytes, amrex::FabHeader const& fab, Box const& cells,
                          T* to) const {
    using Word = std::conditional_t<sizeof(Stored) == 8, std::uint64_t, std::uint32_t>;
    Index3 const n = fab.box.dims();
    bool const swap = fab.big_endian != (std::endian::native == std::endian::big);
    for (std::int64_t z = cells.lower.z; z < cells.upper.z; ++z)
        for (std::int64_t y = cells.lower.y; y < cells.upper.y; ++y) {
            std::int64_t const row =
                ((z - fab.box.lower.z) * n.y + y - fab.box.lower.y) * n.x + cells.lower.x - fab.box.lower.x;
            std::byte const* from = bytes.data() + static_cast<std::size_t>(row) * sizeof(Word);
            for (std::int64_t x = cells.lower.x; x < cells.upper.x; ++x, from += sizeof(Word)) {
                Word word;
                std::memcpy(&word, from, sizeof word);
                if (swap)
                    word = sizeof(Word) == 8 ? static_cast<Word>(__builtin_bswap64(word))
                                             : static_cast<Word>(__builtin_bswap32(static_cast<std::uint32_t>(word)));
                *to++ = static_cast<T>(std::bit_cast<Stored>(word));
            }
        }
}

Volume Plotfile::read_pieces(Header const& header, std::vector<std::size_t> const& kept, std::size_t component) {
    Volume volume(header, collect(kept, [&](std::size_t k) { return listing_.bricks[k]; }));
    std::byte* const to = volume.buffer().write(Space::host);
    std::ifstream file;
    std::string open_name;
    std::vector<std::byte> bytes;
    amrex::FabHeader fab;
    amrex::BoxData const* held = nullptr;
    for (std::size_t i = 0; i < kept.size(); ++i) {
        Piece const& piece = pieces_[kept[i]];
        amrex::BoxData const& data = header_.levels[piece.level].boxes[piece.box];
        if (held != &data) {
            if (open_name != data.file) {
                file.close();
                file.clear();
                file.open(path_ + "/" + data.file, std::ios::binary);
                if (!file) throw Error(ErrorKind::io, text("cannot read ", path_, "/", data.file));
                open_name = data.file;
            }
            std::string line;
            file.clear();
            file.seekg(data.offset);
            if (!std::getline(file, line) || line.size() > 4096) refuse(text(data.file, " ended early"));
            fab = amrex::parse_fab(line, data.file, header_.dimensions);
            if (!fab.box.contains(data.box) || fab.components < static_cast<int>(header_.names.size()))
                refuse(text("a record of ", data.file, " holds another box than the header says"));
            auto const begin = static_cast<std::int64_t>(file.tellg());
            // Before memory is taken the file must be long enough to fill it.
            double const size = volume_of(fab.box.dims()) * fab.bytes;
            std::error_code error;
            auto const length = static_cast<double>(std::filesystem::file_size(path_ + "/" + data.file, error));
            if (error || static_cast<double>(begin) + size * static_cast<double>(component + 1) > length)
                refuse(text(data.file, " ended early"));
            bytes.resize(static_cast<std::size_t>(fab.box.voxels()) * static_cast<std::size_t>(fab.bytes));
            file.seekg(begin + static_cast<std::int64_t>(bytes.size()) * static_cast<std::int64_t>(component));
            if (!file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size())))
                refuse(text(data.file, " ended early"));
            held = &data;
        }
        std::byte* const at = to + static_cast<std::size_t>(volume.brick_offset(i)) * size_of(header.dtype);
        if (header.dtype == DataType::float32) {
            if (fab.bytes == 4)
                copy_piece<float, float>(bytes, fab, piece.cells, reinterpret_cast<float*>(at));
            else
                copy_piece<float, double>(bytes, fab, piece.cells, reinterpret_cast<float*>(at));
        } else {
            if (fab.bytes == 4)
                copy_piece<double, float>(bytes, fab, piece.cells, reinterpret_cast<double*>(at));
            else
                copy_piece<double, double>(bytes, fab, piece.cells, reinterpret_cast<double*>(at));
        }
    }
    return volume;
}

Volume Plotfile::read(AmrReadOptions const& options, Execution const&) {
    std::size_t const v = choose_variable(listing_.variables, options.variable, path_);
    Header header = listing_.header;
    header.dtype = options.dtype.value_or(listing_.variables[v].dtype);
    if (header.dtype != DataType::float32 && header.dtype != DataType::float64)
        throw Error(ErrorKind::usage,
                    text(path_, ": plotfile variables are read as float32 or float64, not ", header.dtype),
                    "convert afterwards: vkt convert");
    header.attributes["variable"] = listing_.variables[v].name;
    std::optional<Box> const region = wanted_box(options, header);
    std::vector<std::size_t> kept;
    auto const point = [](Index3 p) {
        return Vec3{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
    };
    for (std::size_t i = 0; i < listing_.bricks.size(); ++i)
        if (!region || domain_meets(listing_.bricks[i], header.dims, point(region->lower), point(region->upper)))
            kept.push_back(i);
    if (region) header.attributes["roi"] = to_text(*region);
    return read_pieces(header, kept, v);
}

} // namespace

bool is_amrex(std::string const& path) {
    std::error_code error;
    return std::filesystem::is_directory(path, error) && std::filesystem::is_regular_file(path + "/Header", error);
}

AmrListing list_amrex(std::string const& path) { return Plotfile(path).take_listing(); }

Volume read_amrex(std::string const& path, AmrReadOptions const& options, Execution const& execution) {
    return Plotfile(path).read(options, execution);
}

} // namespace vkt
