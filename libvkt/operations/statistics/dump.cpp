// The values of a volume as text, in volkit's layout.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/common/row_values.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

namespace {

/// Below this Real holds every whole number, and all digits before the point mean something.
template <class Real>
constexpr Real all_digits_count = static_cast<Real>(std::int64_t{1} << std::numeric_limits<Real>::digits);

/// One decimal, as volkit prints it, where that and nothing less says all; else the shortest text that is read back as
/// the value. Without locale.
template <class Real> void append_value(std::string& to, Real value) {
    if (!std::isfinite(value)) {
        to += std::isnan(value) ? "nan" : value < 0 ? "-inf" : "inf";
        return;
    }
    char digits[400];
    auto end = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, 1).ptr;
    Real shown = 0;
    std::from_chars(digits, end, shown);
    if (shown != value || std::abs(value) > all_digits_count<Real>)
        end = std::to_chars(digits, digits + sizeof digits, value).ptr;
    to.append(digits, end);
}

/// Of integers that doubles may not hold.
template <class Integer> void append_integer(std::string& to, std::byte const* stored) {
    Integer value = 0;
    std::memcpy(&value, stored, sizeof value);
    to += text(value, ".0");
}

std::string fixed(double value) {
    std::string result;
    append_value(result, value);
    return result;
}

std::string head(Header const& h) {
    // The values that the ends of the stored range stand for; a float's own values range over [0, 1] in volkit.
    double const low = is_integer(h.dtype) ? lowest_of(h.dtype) : 0,
                 high = is_integer(h.dtype) ? highest_of(h.dtype) : 1;
    return text("Object: StructuredVolume\n  dims: (", h.dims.x, ",", h.dims.y, ",", h.dims.z,
                ")\n  bytesPerVoxel: ", static_cast<std::int64_t>(size_of(h.dtype)), "\n  dist: (",
                fixed(h.geometry.spacing.x), ",", fixed(h.geometry.spacing.y), ",", fixed(h.geometry.spacing.z),
                ")\n  voxelMapping: (", fixed(h.values.physical(low)), ",", fixed(h.values.physical(high)),
                ")\ndata:\n");
}

/// Prints physical values, slice by slice.
class Dump : public Operation {
public:
    Roi roi;                           ///< part to print; empty: all
    std::optional<Index3> first, last; ///< the same in volkit's spelling

    std::string_view name() const override { return "dump"; }
    Texts texts() const override {
        return {
            "Print the values of a volume as text.",
            "Physical values, slice by slice, in volkit's layout: with one decimal, or more digits where they need "
            "them. For numbers to compute with, write a format such as NRRD instead; for a summary use vkt stats."
            "\n\n"
            "Accuracy: Exact: as many digits as tell a value from its neighbours.",
            {{"A corner of a volume", "vkt make ramp --dims 8 8 8 | vkt dump --roi 0:4,0:2,0:2"},
             {"The same in volkit's spelling", "vkt make ramp --dims 8 8 8 | vkt dump --first 0 0 0 --last 4 2 2"}}};
    }

    Shape shape() const override { return Shape::reduction; }
    std::vector<std::string> input_names() const override {
        return {!file_.empty() ? file_ : !in_.empty() ? in_ : "-"};
    }

    void parameters(Parameters& p) override {
        p.positional("in", in_, "input: a file of any known format, a stream, or '-' (the default)").optional();
        p.option("roi", roi, "X0:X1,Y0:Y1,Z0:Z1",
                 "print only these voxels (half-open), under their numbers in the whole volume; X0:X1:S is every S-th");
        p.option("first", first, "X Y Z", "print from this voxel (volkit)");
        p.option("last", last, "X Y Z", "up to, not including, this voxel (volkit)");
        p.option("input", file_, "FILE", "the volume, in volkit's spelling").short_form('i').not_in_history();
    }

    void check() const override {
        if (!in_.empty() && !file_.empty())
            throw Error(ErrorKind::usage, text("two inputs: '", in_, "' and '", file_, "'"));
        if (first.has_value() != last.has_value()) throw Error(ErrorKind::usage, "--first and --last go together");
        if (first && !roi.empty())
            throw Error(ErrorKind::usage, "--roi and --first/--last say the same: give one of them");
    }

    /// Text is all there is.
    bool prints(ReportForm form) const override { return form == ReportForm::text; }
    Plan plan(std::span<Header const> inputs) const override {
        if (inputs.front().kind != Kind::structured)
            throw Error(ErrorKind::usage, "the volume is hierarchical",
                        "make it a grid first: vkt resample --cells 50M");
        Box const shown = box_of(region(inputs.front().dims).dims());
        Plan plan;
        plan.output = inputs.front();
        plan.method = "text";
        plan.cost = 2500 * static_cast<double>(shown.voxels()) /
                    static_cast<double>(std::max<std::int64_t>(1, inputs.front().voxels()));
        return plan;
    }

    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override {
        Source& source = *to.inputs.front();
        while (source.next_volume()) {
            if (only_planned(*this, to)) continue;
            Header const header = source.header();
            SteppedBox const region = this->region(header.dims);
            Box const box = box_of(region.dims());
            Index3 const step = region.step;
            bool const single =
                header.values == ValueMap{} && (header.dtype == DataType::float32 || header.dtype == DataType::float16);
            to.print(head(header));
            source.expect(region.box);
            // Text takes several times the room of the voxels.
            Index3 const extent = region.box.dims();
            auto const row_bytes = static_cast<std::size_t>(extent.x * step.y) * 8 * size_of(header.dtype);
            auto const rows = static_cast<std::int64_t>(piece_limit(to.execution) / row_bytes);
            bool const as_stored = header.values == ValueMap{};
            Buffer buffer;
            std::vector<double> row(static_cast<std::size_t>(extent.x));
            for_each_piece(box, {1, std::clamp<std::int64_t>(rows, 1, box.dims().y)}, [&](Box const& piece) {
                Box const held = region.source(piece); // whose places in the volume are those that are shown
                std::int64_t const z = held.lower.z;
                buffer.reserve(static_cast<std::size_t>(held.voxels()) * size_of(header.dtype));
                AnyView const view = dense_view(buffer.write(Space::host), header.dtype, held);
                source.read(view);
                std::string lines = piece.lower.y == 0 ? text("[", z, "]\n{\n") : "";
                for (std::int64_t y = held.lower.y; y < held.upper.y; y += step.y) {
                    lines += text("  [", y, "] {");
                    read_row(view, y, z, row.data());
                    for (std::size_t x = 0; x < row.size(); x += static_cast<std::size_t>(step.x)) {
                        if (x > 0) lines += ", ";
                        std::byte const* const stored = view.at(held.lower.x + static_cast<std::int64_t>(x), y, z);
                        if (as_stored && header.dtype == DataType::int64)
                            append_integer<std::int64_t>(lines, stored);
                        else if (as_stored && header.dtype == DataType::uint64)
                            append_integer<std::uint64_t>(lines, stored);
                        else if (single)
                            append_value(lines, static_cast<float>(row[x]));
                        else
                            append_value(lines, header.values.physical(row[x]));
                    }
                    lines += "}\n";
                }
                if (piece.upper.y == box.upper.y) lines += piece.upper.z < box.upper.z ? "}\n\n" : "}\n";
                to.print(lines);
            });
            source.finish();
        }
    }

private:
    SteppedBox region(Index3 dims) const {
        if (!first) return roi.resolve_steps(dims);
        Box const box{*first, *last};
        if (box.empty()) throw Error(ErrorKind::usage, text("the range ", box, " is empty"));
        if (!box_of(dims).contains(box))
            throw Error(ErrorKind::usage, text("the range ", box, " leaves the volume of ", dims, " voxels"));
        return {box};
    }

    std::string in_, file_;
};

/// volkit's name for it, with a range that must be given.
class DumpRange : public Dump {
public:
    std::string_view name() const override { return "dump-range"; }
    Texts texts() const override {
        return {"Print the values of a part of a volume as text.",
                "volkit's name for vkt dump with a range, which must be given."
                "\n\n"
                "Accuracy: Exact: as many digits as tell a value from its neighbours.",
                {{"A corner of a volume", "vkt make ramp --dims 8 8 8 | vkt dump-range --first 0 0 0 --last 4 2 2"}}};
    }

    void check() const override {
        Dump::check();
        if (!first && roi.empty())
            throw Error(ErrorKind::usage, "no range is given", "say for example --first 0 0 0 --last 8 8 8");
    }
};

} // namespace

VKT_OPERATION(Dump, "dump")
VKT_OPERATION(DumpRange, "dump-range")

} // namespace vkt
