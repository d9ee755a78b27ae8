// VTK's XML images, read: .vti from one or several pieces, and .pvti, whose pieces are files.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vti.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/tree_file.h"
#include "libvkt/formats/vti_data.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>

namespace vkt {
namespace {

using Extent = std::array<std::int64_t, 6>;

Index3 lower_of(Extent const& e) { return {e[0], e[2], e[4]}; }
/// Points of an extent, or its cells; a direction without extent has one layer of either.
Index3 dims_of(Extent const& e, bool cells) {
    Index3 d{e[1] - e[0] + 1, e[3] - e[2] + 1, e[5] - e[4] + 1};
    for (int a = 0; cells && a < 3; ++a)
        if (d[a] > 1) --d[a];
    return d;
}

/// What VTK notes of points and cells that another piece has, too: no field that anyone looks for.
bool tells_ghosts(VtiArray const& array) { return array.name == "vtkGhostType" || array.name == "vtkGhostLevels"; }

bool contains(Extent const& outer, Extent const& inner) {
    for (std::size_t a = 0; a < 6; a += 2)
        if (inner[a] < outer[a] || inner[a + 1] > outer[a + 1]) return false;
    return true;
}

/// One file with pieces, and the arrays that were asked for of them.
struct OpenFile {
    std::unique_ptr<ByteSource> bytes;
    VtiStructure structure;
};

std::unique_ptr<OpenFile> open_file(std::unique_ptr<ByteSource> bytes) {
    auto result = std::make_unique<OpenFile>();
    result->bytes = seekable_bytes(std::move(bytes));
    if (!result->bytes->seekable()) throw Error(ErrorKind::data, text("'", result->bytes->name(), "' is empty"));
    result->structure = read_vti_structure(*result->bytes);
    return result;
}

class VtiSource : public Source {
public:
    VtiSource(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) : main_(open_file(std::move(bytes))) {
        choose(options);
        for (VtiPiece const& piece : main_->structure.pieces) {
            Part part;
            part.extent = piece.extent;
            part.piece = &piece;
            part.file = main_.get();
            if (main_->structure.parallel) part.path = beside(main_->structure.name, piece.source, options.trust_paths);
            parts_.push_back(std::move(part));
        }
        check_covered();
    }

    bool next_volume() override {
        if (series_) return next_array();
        if (index_ + 1 >= wanted_.components) return false;
        ++index_;
        if (wanted_.components > 1) header_.attributes["channel"] = to_text(index_);
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    std::vector<std::string> not_read() const override { return main_->structure.not_read; }
    void finish() override {}

    void read(AnyView out) override {
        if (out.box.empty()) return;
        if (!box_of(header_.dims).contains(out.box))
            throw Error(ErrorKind::failure, text("region ", out.box, " is outside of '", main_->structure.name, "'"));
        if (!choices_.empty()) choose_variable(choices_, "", main_->structure.name);
        for (Part& part : parts_) {
            Index3 const lower = lower_of(part.extent) - lower_of(main_->structure.whole);
            Box const box{lower, lower + dims_of(part.extent, wanted_.cells)};
            Box const common = intersect(box, out.box);
            if (!common.empty()) read_part(part, out.part(common));
        }
    }

private:
    struct Part {
        Extent extent{};
        VtiPiece const* piece = nullptr;
        OpenFile* file = nullptr;
        std::string path; ///< of a file of its own, opened when it is needed
        std::unique_ptr<OpenFile> own;
        std::unique_ptr<VtiData> data;
    };

    /// Of a series that vkt wrote.
    bool next_array() {
        if (array_ + 1 >= arrays().size()) return false;
        wanted_ = arrays()[++array_];
        index_ = 0;
        for (Part& part : parts_) {
            part.data.reset();
            part.own.reset();
        }
        header_.attributes["channel"] = wanted_.name;
        header_ = in_utf8(std::move(header_));
        return true;
    }

    [[noreturn]] void fail(std::string const& what) const {
        throw Error(ErrorKind::data, text("'", main_->structure.name, "': ", what));
    }

    std::vector<VtiArray> const& arrays() const {
        return main_->structure.parallel ? main_->structure.declared : main_->structure.pieces.front().arrays;
    }

    void choose(ReadOptions const& options) {
        std::vector<AmrVariable> all;
        for (VtiArray const& array : arrays()) {
            AmrVariable v;
            v.name = array.name;
            v.dtype = array.type;
            all.push_back(v);
        }
        VtiStructure const& s = main_->structure;
        std::size_t chosen = 0;
        // Of several, the one that its writer calls the scalars.
        auto const active = [&] {
            for (bool const cells : {false, true})
                for (std::size_t i = 0; i < arrays().size(); ++i)
                    if (arrays()[i].cells == cells && !arrays()[i].name.empty() &&
                        arrays()[i].name == (cells ? s.active_cells : s.active_points))
                        return std::optional(i);
            return std::optional<std::size_t>();
        };
        if (all.empty())
            fail(text("holds no array of numbers",
                      s.not_read.empty() ? "" : text(", but ", s.not_read.front(), ", which is not read")));
        auto const alike = [&](VtiArray const& a) {
            return !a.cells && a.components == 1 && s.ours && a.type == s.ours->dtype;
        };
        series_ = options.variable.empty() && all.size() > 1 && std::all_of(arrays().begin(), arrays().end(), alike);
        if (options.variable.empty() && all.size() > 1 && !series_) {
            auto const no_ghosts = [](VtiArray const& array) { return !tells_ghosts(array); };
            if (auto const found = active())
                chosen = *found;
            else if (std::ranges::count_if(arrays(), no_ghosts) == 1)
                chosen = static_cast<std::size_t>(std::ranges::find_if(arrays(), no_ghosts) - arrays().begin());
            else
                choices_ = all;
        } else {
            chosen = series_ ? 0 : choose_variable(all, options.variable, s.name);
        }
        wanted_ = arrays()[chosen];
        header_.dims = dims_of(s.whole, wanted_.cells);
        header_.dtype = wanted_.type;
        header_.geometry = s.geometry;
        for (int a = 0; a < 3; ++a)
            if (header_.dims[a] < 1 || header_.dims[a] > max_extent) fail("its extent holds no points");
        Index3 const lower = lower_of(s.whole);
        Vec3 first{static_cast<double>(lower.x), static_cast<double>(lower.y), static_cast<double>(lower.z)};
        Index3 const points = dims_of(s.whole, false);
        for (int a = 0; a < 3; ++a)
            if (wanted_.cells && points[a] > 1) first[a] += 0.5;
        header_.geometry.origin = index_to_world(s.geometry, first);
        if (s.ours && s.ours->kind == Kind::structured && s.ours->dims == header_.dims &&
            s.ours->dtype == header_.dtype && same_geometry(s.ours->geometry, header_.geometry)) {
            header_ = *s.ours;
            header_.dry_run = header_.timing = false;
        } else {
            header_.attributes["variable"] = wanted_.name;
        }
        if (all.size() > 1 && !series_) {
            std::vector<std::string> names;
            for (std::size_t i = 0; i < all.size(); ++i) {
                VtiArray const& array = arrays()[i];
                names.push_back(array.name);
                header_.attributes["variable " + array.name] =
                    text(array.type, array.components > 1 ? text(" x ", array.components) : "",
                         array.cells ? ", cells" : ", points");
            }
            header_.attributes["variables"] = join(names, " ");
        }
        header_ = in_utf8(std::move(header_));
        mark_as_given(header_);
        try {
            check(header_);
        } catch (Error const& error) {
            fail(error.what());
        }
    }

    /// Every voxel must be in some piece. Pieces may overlap (ghosts), so that counting is not enough then.
    void check_covered() const {
        Box const whole = box_of(header_.dims);
        std::int64_t sum = 0;
        for (Part const& part : parts_) {
            Index3 const lower = lower_of(part.extent) - lower_of(main_->structure.whole);
            Box const box{lower, lower + dims_of(part.extent, wanted_.cells)};
            if (box.empty()) continue;
            if (!whole.contains(box)) fail("a piece lies outside of the whole extent");
            if (__builtin_add_overflow(sum, box.voxels(), &sum)) fail("its pieces overlap without end");
        }
        if (sum < whole.voxels()) fail("its pieces do not fill the whole extent");
    }

    void open_part(Part& part) {
        if (part.data) return;
        if (!part.path.empty()) {
            // A few files are open at a time.
            if (++opened_ > 8)
                for (Part& other : parts_)
                    if (other.own) {
                        other.data.reset();
                        other.own.reset();
                    }
            part.own = open_file(open_bytes(part.path));
            part.file = part.own.get();
            if (part.own->structure.parallel) fail(text("its piece '", part.path, "' is no file with voxels"));
            part.piece = nullptr;
            for (VtiPiece const& piece : part.own->structure.pieces) // which may have ghosts besides
                if (piece.extent == part.extent || (part.piece == nullptr && contains(piece.extent, part.extent)))
                    part.piece = &piece;
            if (part.piece == nullptr) fail(text("its piece '", part.path, "' has another extent"));
        }
        for (VtiArray const& array : part.piece->arrays)
            if (array.name == wanted_.name && array.cells == wanted_.cells) {
                if (array.type != wanted_.type || array.components != wanted_.components)
                    fail(text("array '", printable(array.name), "' differs in type between pieces"));
                Index3 const dims = dims_of(part.piece->extent, wanted_.cells);
                std::int64_t bytes = wanted_.components * static_cast<std::int64_t>(size_of(wanted_.type));
                for (int a = 0; a < 3; ++a)
                    if (__builtin_mul_overflow(bytes, dims[a], &bytes))
                        fail("claims more bytes than any file can have");
                part.data = std::make_unique<VtiData>(*part.file->bytes, part.file->structure, array, bytes);
                return;
            }
        fail(text("a piece has no array '", printable(wanted_.name), "'"));
    }

    void read_part(Part& part, AnyView const& out) {
        open_part(part);
        auto const element = static_cast<std::int64_t>(size_of(wanted_.type));
        Index3 const lower = lower_of(part.piece->extent) - lower_of(main_->structure.whole);
        Box const box{lower, lower + dims_of(part.piece->extent, wanted_.cells)}; // as it lies in the file
        if (!box.contains(out.box)) fail(text("its piece '", part.path, "' has another extent"));
        Index3 const dims = box.dims(), size = out.dims();
        auto const voxel = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
            return ((z - box.lower.z) * dims.y + (y - box.lower.y)) * dims.x + (x - box.lower.x);
        };
        bool const rows = size.x == dims.x && out.row == size.x, slices = rows && size.y == dims.y;
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z) {
            std::int64_t const together = slices ? size.y : 1;
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; y += together) {
                std::int64_t const n = size.x * together;
                std::byte* const to = out.at(out.box.lower.x, y, z);
                std::int64_t const first = voxel(out.box.lower.x, y, z);
                if (wanted_.components == 1) {
                    part.data->read(first * element, to, n * element);
                    continue;
                }
                // A part of the components of a row at a time.
                std::int64_t const all = wanted_.components * element;
                std::int64_t const portion = std::max<std::int64_t>((std::int64_t{1} << 20) / all, 1);
                for (std::int64_t i = 0; i < n; i += portion) {
                    std::int64_t const count = std::min(portion, n - i);
                    scratch_.resize(static_cast<std::size_t>(count * all));
                    part.data->read((first + i) * all, scratch_.data(), count * all);
                    for (std::int64_t k = 0; k < count; ++k)
                        std::memcpy(to + (i + k) * element, scratch_.data() + k * all + index_ * element,
                                    static_cast<std::size_t>(element));
                }
            }
        }
    }

    std::unique_ptr<OpenFile> main_;
    std::vector<AmrVariable> choices_;
    VtiArray wanted_;
    Header header_;
    std::vector<Part> parts_;
    int opened_ = 0;
    std::int64_t index_ = -1; ///< component
    bool series_ = false;     ///< all arrays are volumes of one series
    std::size_t array_ = static_cast<std::size_t>(-1);
    std::vector<std::byte> scratch_;
};

} // namespace

std::unique_ptr<Source> open_vti(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    return std::make_unique<VtiSource>(std::move(bytes), options);
}

Format vti_format() {
    return {"vti",
            "VTK XML images, whole or in parts",
            {".vti", ".pvti"},
            [](std::span<std::byte const> head) {
                return is_vti(std::string_view(reinterpret_cast<char const*>(head.data()), head.size()));
            },
            open_vti,
            create_vti};
}

} // namespace vkt
