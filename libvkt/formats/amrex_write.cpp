// Writing AMReX plotfiles: the leaves as they come, then what they cover, level by level.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/amrex.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/io/output_directory.h"
#include "libvkt/io/output_file.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <tuple>

#include <sys/stat.h>

namespace vkt {
namespace {

namespace fs = std::filesystem;

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// A plotfile's folder, and nothing else in it.
bool only_plotfile(std::string const& folder) {
    std::error_code error;
    for (auto const& entry : fs::directory_iterator(folder, error)) {
        std::string const name = entry.path().filename();
        if (name != "Header" && !(entry.is_directory(error) && name.starts_with("Level_"))) return false;
    }
    return !error && is_amrex(folder);
}

/// Cells of a level that finer ones cover.
struct Covered {
    Box box;               ///< in the level's own cells
    std::size_t first = 0; ///< of its cells among those of the level
};

/// One level of the tree.
struct LevelOut {
    std::vector<Box> boxes;           ///< leaves in the order of the bricks, then those that are covered
    std::size_t leaves = 0;           ///< how many of them are leaves
    std::vector<std::size_t> coarser; ///< for each box: which covered one of the next coarser level holds it
    std::vector<Covered> covered;
    std::vector<std::byte> cells; ///< of the covered boxes: means
    std::unique_ptr<OutputFile> file;
    std::int64_t position = 0;
    struct Record {
        Box box;
        std::int64_t position;
        double low, high;
    };
    std::vector<Record> records;
};

class PlotfileSink : public Sink {
public:
    PlotfileSink(std::string const& path, WriteOptions const& options)
        : options_(options), folder_(path, options.force, only_plotfile, "plotfile") {
        if (options.compress) throw Error(ErrorKind::usage, "plotfiles are not compressed", "leave out --compress");
    }

    void begin(Header const& header) override {
        if (header.kind != Kind::hierarchical)
            throw Error(ErrorKind::usage, "plotfiles hold trees, and this volume is one grid",
                        "make a tree first: vkt refine");
        refuse_series(begun_, "a plotfile", "");
    }
    AnyView acquire(Box const&) override { throw Error(ErrorKind::failure, "a plotfile takes no slabs"); }
    void commit() override {}
    void put_bricks(BrickSequence bricks) override;
    void end() override {}
    void close() override;

private:
    void take_tree(std::vector<Brick> const& bricks);
    void list_boxes();
    void cover(std::size_t level);
    template <class T> void write_bricks(BrickSequence& bricks);
    template <class T> void take(std::size_t level, std::size_t box, T const* cells);
    std::string corners(Box const& box) const;
    std::string axes(Vec3 v) const;
    std::string record_line(Box const& box) const;
    void write_text(std::string const& name, std::string const& words) const;
    std::string header_text() const;
    std::string level_text(LevelOut const& level) const;

    WriteOptions options_;
    OutputDirectory folder_;
    bool begun_ = false;
    Header header_;
    int dimensions_ = 3;
    std::vector<Brick> bricks_;
    std::vector<LevelOut> levels_; ///< the finest first, as in the tree
};

/// Levels above the finest brick are none: the finest cells are its own then.
void PlotfileSink::take_tree(std::vector<Brick> const& bricks) {
    auto const refuse = [](std::string const& why) {
        throw Error(ErrorKind::usage, text("plotfiles cannot hold this tree: ", why),
                    "as one grid: vkt resample -o NAME.nrrd");
    };
    if (bricks.empty()) refuse("it has no bricks");
    try {
        validate_tree(header_.dims, bricks, Coverage::complete);
    } catch (Error const& error) {
        refuse(error.what());
    }
    auto const [least, most] = std::minmax_element(bricks.begin(), bricks.end(),
                                                   [](Brick const& a, Brick const& b) { return a.level < b.level; });
    int const finest = least->level, coarsest = most->level - finest;
    Index3 const w = cell_width(header_.dims, finest);
    Geometry& g = header_.geometry;
    for (int a = 0; a < 3; ++a) {
        if (header_.dims[a] == 1 && a < dimensions_ && most->level > 0)
            refuse("all axes are refined in them, and one of its has a single cell");
        if (header_.dims[a] % (w[a] << (a < dimensions_ ? coarsest : 0)) != 0)
            refuse("its coarsest cells do not fill the domain");
        header_.dims[a] /= w[a];
        g.origin[a] += 0.5 * g.spacing[a] * static_cast<double>(w[a] - 1);
        g.spacing[a] *= static_cast<double>(w[a]);
    }
    bricks_ = bricks;
    for (Brick& brick : bricks_) {
        brick.level -= finest;
        for (int a = 0; a < 3; ++a) brick.lower[a] /= w[a];
    }
    levels_.resize(static_cast<std::size_t>(coarsest) + 1);
}

/// Own cells of every brick, and what finer boxes cover, which plotfiles hold too.
void PlotfileSink::list_boxes() {
    for (Brick const& brick : bricks_) {
        Index3 const w = cell_width(header_.dims, brick.level);
        Index3 const lower{brick.lower.x / w.x, brick.lower.y / w.y, brick.lower.z / w.z};
        levels_[static_cast<std::size_t>(brick.level)].boxes.push_back({lower, lower + brick.dims});
    }
    for (LevelOut& level : levels_) level.leaves = level.boxes.size();
    for (std::size_t k = 0; k + 1 < levels_.size(); ++k) cover(k);
}

/// The boxes of a level in cells of the next coarser one; those that are eight of a kind side by side are one box.
void PlotfileSink::cover(std::size_t level) {
    LevelOut &fine = levels_[level], &coarse = levels_[level + 1];
    std::vector<Box> parts;
    for (Box const& box : fine.boxes) {
        Box part = box;
        for (int a = 0; a < dimensions_; ++a) {
            if (box.lower[a] % 2 != 0 || box.upper[a] % 2 != 0)
                throw Error(ErrorKind::usage,
                            text("plotfiles cannot hold this tree: brick ", box, " of level ",
                                 static_cast<std::int64_t>(level), " cuts cells of the next coarser one"),
                            "as one grid: vkt resample -o NAME.nrrd");
            part.lower[a] = box.lower[a] / 2;
            part.upper[a] = box.upper[a] / 2;
        }
        parts.push_back(part);
    }
    using Key = std::tuple<std::int64_t, std::int64_t, std::int64_t, std::int64_t, std::int64_t, std::int64_t>;
    std::map<Key, std::vector<std::size_t>> families;
    auto const parent = [&](Box const& part) {
        Index3 const n = part.dims();
        Box whole = part;
        for (int a = 0; a < dimensions_; ++a) {
            whole.lower[a] = part.lower[a] / (2 * n[a]) * (2 * n[a]);
            whole.upper[a] = whole.lower[a] + 2 * n[a];
        }
        return whole;
    };
    for (std::size_t i = 0; i < parts.size(); ++i) {
        Box const whole = parent(parts[i]);
        Index3 const n = whole.dims();
        if (!whole.contains(parts[i])) continue; // on a lattice of its own
        families[{whole.lower.x, whole.lower.y, whole.lower.z, n.x, n.y, n.z}].push_back(i);
    }
    fine.coarser.assign(parts.size(), 0);
    std::vector<bool> done(parts.size(), false);
    std::size_t cells = 0;
    auto const add = [&](Box const& box) {
        coarse.covered.push_back({box, cells});
        coarse.boxes.push_back(box);
        cells += static_cast<std::size_t>(box.voxels());
        return coarse.covered.size() - 1;
    };
    for (std::size_t i = 0; i < parts.size(); ++i) {
        if (done[i]) continue;
        Box const whole = parent(parts[i]);
        Index3 const n = whole.dims();
        auto const family = families.find({whole.lower.x, whole.lower.y, whole.lower.z, n.x, n.y, n.z});
        std::size_t const complete = std::size_t{1} << dimensions_;
        if (family == families.end() || family->second.size() != complete) {
            fine.coarser[i] = add(parts[i]);
            continue;
        }
        std::size_t const to = add(whole);
        for (std::size_t const k : family->second) fine.coarser[k] = to, done[k] = true;
    }
    std::size_t const bytes = cells * size_of(header_.dtype);
    if (bytes > options_.memory.value_or(default_memory()) / 2)
        throw Error(ErrorKind::resources, text("the coarser levels of a plotfile take ",
                                               bytes_text(static_cast<double>(bytes)), ", more than half of --memory"));
    coarse.cells.resize(bytes);
}

void PlotfileSink::put_bricks(BrickSequence bricks) {
    header_ = in_utf8(bricks.header());
    if (header_.dtype != DataType::float32 && header_.dtype != DataType::float64)
        throw Error(ErrorKind::usage, text("plotfiles hold float32 and float64, not ", header_.dtype),
                    "convert first: vkt convert --dtype float32");
    dimensions_ = header_.dims.z > 1 ? 3 : header_.dims.y > 1 ? 2 : 1;
    take_tree(bricks.bricks().list());
    Header lost = header_;
    std::erase_if(lost.attributes, [](auto const& entry) {
        // What is said of any plotfile that is read.
        return entry.first == "variables" || entry.first == "holes" || entry.first == "format" ||
               entry.first.starts_with("level ") || entry.first.starts_with("variable ");
    });
    Kept kept = nothing_kept;
    kept.spacing = true;
    kept.named = {"variable"};
    if (auto const time = header_.attributes.find("time"); time != header_.attributes.end() && number_in(time->second))
        kept.named.emplace_back("time");
    tell_losses(options_, lost, "plotfiles", kept);
    list_boxes();
    for (std::size_t k = 0; k < levels_.size(); ++k) {
        std::string const name = folder_.file(text("Level_", static_cast<std::int64_t>(levels_.size() - 1 - k)));
        if (::mkdir(name.c_str(), 0777) != 0) throw system_error(text("cannot write '", folder_.path(), "'"));
        levels_[k].file = std::make_unique<OutputFile>(name + "/Cell_D_00000", false);
    }
    levels_[0].file->expect(header_.bytes());
    if (header_.dtype == DataType::float32)
        write_bricks<float>(bricks);
    else
        write_bricks<double>(bricks);
}

template <class T> void PlotfileSink::write_bricks(BrickSequence& bricks) {
    std::vector<std::size_t> next(levels_.size(), 0);
    std::size_t const count = bricks_.size();
    for (std::size_t first = 0, n = 0; first < count; first += n) {
        n = bricks.group(first, bricks.group_bytes());
        std::byte const* cells = bricks.cells(first, n);
        for (std::size_t i = first; i < first + n; ++i) {
            Brick const& brick = bricks_[i];
            auto const level = static_cast<std::size_t>(brick.level);
            take(level, next[level]++, reinterpret_cast<T const*>(cells));
            cells += static_cast<std::size_t>(brick.cells()) * sizeof(T);
        }
    }
    for (std::size_t k = 1; k < levels_.size(); ++k)
        for (std::size_t i = 0; i < levels_[k].covered.size(); ++i)
            take(k, levels_[k].leaves + i,
                 reinterpret_cast<T const*>(levels_[k].cells.data()) + levels_[k].covered[i].first);
}

/// Writes the cells of a box, and their means to the box that it lies in a level further up.
template <class T> void PlotfileSink::take(std::size_t level, std::size_t box, T const* cells) {
    LevelOut& own = levels_[level];
    Box const b = own.boxes[box];
    double low = none, high = none;
    for (std::int64_t i = 0; i < b.voxels(); ++i) {
        auto const value = static_cast<double>(cells[i]);
        if (!(low <= value)) low = std::isnan(value) ? low : value;
        if (!(high >= value)) high = std::isnan(value) ? high : value;
    }
    own.records.push_back({b, own.position, low, high});
    std::string const line = record_line(b);
    std::size_t const bytes = static_cast<std::size_t>(b.voxels()) * sizeof(T);
    own.file->write(line.data(), line.size());
    own.file->write(cells, bytes);
    own.position += static_cast<std::int64_t>(line.size() + bytes);
    if (level + 1 == levels_.size()) return;
    LevelOut& coarse = levels_[level + 1];
    Covered const& to = coarse.covered[own.coarser[box]];
    T* const means = reinterpret_cast<T*>(coarse.cells.data()) + to.first;
    Index3 const n = b.dims(), m = to.box.dims(), one{1, dimensions_ > 1 ? 2 : 1, dimensions_ > 2 ? 2 : 1};
    for (std::int64_t z = 0; z < n.z; z += one.z)
        for (std::int64_t y = 0; y < n.y; y += one.y)
            for (std::int64_t x = 0; x < n.x; x += 2) {
                double sum = 0;
                for (std::int64_t k = 0; k < one.z; ++k)
                    for (std::int64_t j = 0; j < one.y; ++j)
                        for (std::int64_t i = 0; i < 2; ++i)
                            sum += static_cast<double>(cells[((z + k) * n.y + y + j) * n.x + x + i]);
                Index3 const at{(b.lower.x + x) / 2 - to.box.lower.x,
                                (dimensions_ > 1 ? (b.lower.y + y) / 2 : 0) - to.box.lower.y,
                                (dimensions_ > 2 ? (b.lower.z + z) / 2 : 0) - to.box.lower.z};
                means[(at.z * m.y + at.y) * m.x + at.x] = static_cast<T>(sum / static_cast<double>(2 * one.y * one.z));
            }
}

/// "((0,0,0) (7,7,7) (0,0,0))".
std::string PlotfileSink::corners(Box const& box) const {
    auto const corner = [&](Index3 v) {
        std::string words = text("(", v.x);
        for (int a = 1; a < dimensions_; ++a) words += text(",", v[a]);
        return words + ")";
    };
    return text("(", corner(box.lower), " ", corner(box.upper - Index3{1, 1, 1}), " ", corner({0, 0, 0}), ")");
}

std::string PlotfileSink::axes(Vec3 v) const {
    std::string words = to_text(v.x);
    for (int a = 1; a < dimensions_; ++a) words += text(" ", v[a]);
    return words;
}

std::string PlotfileSink::record_line(Box const& box) const {
    bool const wide = header_.dtype == DataType::float64;
    std::string order = wide ? "8 7 6 5 4 3 2 1" : "4 3 2 1";
    if (std::endian::native == std::endian::big) std::reverse(order.begin(), order.end());
    return text("FAB ((8, ", wide ? "(64 11 52 0 1 12 0 1023)" : "(32 8 23 0 1 9 0 127)", "),(", wide ? 8 : 4, ", (",
                order, ")))", corners(box), " 1\n");
}

void PlotfileSink::write_text(std::string const& name, std::string const& words) const {
    OutputFile file(folder_.file(name), false);
    file.write(words.data(), words.size());
    file.commit();
}

std::string PlotfileSink::header_text() const {
    auto const attribute = [&](char const* name, char const* otherwise) {
        auto const found = header_.attributes.find(name);
        return found == header_.attributes.end() || found->second.empty() ? otherwise : one_line(found->second);
    };
    auto const time = number_in(attribute("time", "0")).value_or(0);
    std::size_t const coarsest = levels_.size() - 1;
    Geometry const& g = header_.geometry;
    Vec3 const low = g.origin - g.spacing * 0.5;
    Vec3 high = low;
    for (int a = 0; a < 3; ++a) high[a] += g.spacing[a] * static_cast<double>(header_.dims[a]);
    std::string words = text("HyperCLaw-V1.1\n1\n", attribute("variable", "value"), "\n", dimensions_, "\n", time, "\n",
                             static_cast<std::int64_t>(coarsest), "\n", axes(low), "\n", axes(high), "\n");
    std::string ratios, domains, steps, sizes, grids;
    for (std::size_t l = 0; l <= coarsest; ++l) { // the coarsest first
        std::size_t const k = coarsest - l;
        Index3 const w = cell_width(header_.dims, static_cast<int>(k));
        char const* const gap = l > 0 ? " " : "";
        if (l < coarsest) ratios += text(gap, 2);
        domains += text(gap, corners(box_of({header_.dims.x / w.x, header_.dims.y / w.y, header_.dims.z / w.z})));
        steps += text(gap, 0);
        Vec3 cell = g.spacing;
        for (int a = 0; a < 3; ++a) cell[a] *= static_cast<double>(w[a]);
        sizes += axes(cell) + "\n";
        auto const number = static_cast<std::int64_t>(l);
        grids += text(number, " ", std::ssize(levels_[k].records), " ", time, "\n0\n");
        for (LevelOut::Record const& record : levels_[k].records)
            for (int a = 0; a < dimensions_; ++a)
                grids += text(low[a] + cell[a] * static_cast<double>(record.box.lower[a]), " ",
                              low[a] + cell[a] * static_cast<double>(record.box.upper[a]), "\n");
        grids += text("Level_", number, "/Cell\n");
    }
    return words + ratios + "\n" + domains + "\n" + steps + "\n" + sizes + "0\n0\n" + grids;
}

std::string PlotfileSink::level_text(LevelOut const& level) const {
    std::int64_t const n = std::ssize(level.records);
    std::string words = text("1\n1\n1\n0\n(", n, " 0\n"), files, least = text("\n", n, ",1\n"), most = least;
    for (LevelOut::Record const& record : level.records) {
        words += corners(record.box) + "\n";
        files += text("FabOnDisk: Cell_D_00000 ", record.position, "\n");
        least += to_text(record.low) + ",\n";
        most += to_text(record.high) + ",\n";
    }
    return text(words, ")\n", n, "\n", files, least, most, "\n");
}

void PlotfileSink::close() {
    if (levels_.empty()) throw Error(ErrorKind::data, "there is no volume to write");
    for (std::size_t k = 0; k < levels_.size(); ++k) {
        levels_[k].file->commit();
        write_text(text("Level_", static_cast<std::int64_t>(levels_.size() - 1 - k), "/Cell_H"),
                   level_text(levels_[k]));
    }
    write_text("Header", header_text());
    folder_.commit();
}

} // namespace

std::unique_ptr<Sink> create_amrex(std::string const& path, WriteOptions const& options) {
    if (path == "-") throw Error(ErrorKind::usage, "a plotfile is a directory", "name it: -o plt00000");
    return std::make_unique<PlotfileSink>(path, options);
}

bool is_plotfile_name(std::string const& name) {
    std::string base = name;
    while (!base.empty() && base.back() == '/') base.pop_back();
    base.erase(0, base.rfind('/') + 1);
    return base.size() > 3 && base.starts_with("plt") && base.find_first_not_of("0123456789", 3) == std::string::npos;
}

} // namespace vkt
