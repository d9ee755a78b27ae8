// Editing a volume's header, and declaring an empty volume from nothing but a header.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/tree.h"
#include "libvkt/engine/operation.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/volkit_header.h"

#include <cmath>
#include <cstring>

namespace vkt {

namespace {

std::array<Vec3, 3> parse_direction(std::string const& text_) {
    std::vector<std::string> const parts = split(text_, ',');
    if (parts.size() != 9)
        throw Error(ErrorKind::usage, text("--direction: '", text_, "' is not nine numbers"),
                    "for example 1,0,0,0,1,0,0,0,1");
    std::array<Vec3, 3> columns;
    for (std::size_t i = 0; i < 9; ++i) columns[i / 3][static_cast<int>(i % 3)] = parse_double(parts[i]);
    for (Vec3& column : columns) {
        double const length = std::sqrt(column.x * column.x + column.y * column.y + column.z * column.z);
        if (!std::isfinite(length) || !(length > 0))
            throw Error(ErrorKind::usage, "--direction: a vector has no length");
        column = column * (1 / length);
    }
    return columns;
}

/// Changes what the header says; voxels stay as they are, and cost nothing unless dims change. New dims reinterpret the
/// same sequence of voxels and must have as many.
class SetHeader : public Operation {
public:
    std::optional<Index3> dims;
    std::optional<Vec3> spacing, dist, origin;
    std::string direction; ///< nine numbers: world directions of x, y, z
    std::optional<std::string> units;
    std::optional<double> slope, intercept;
    std::optional<VoxelMapping> voxel_mapping;
    std::vector<std::string> attributes; ///< KEY=VALUE; KEY= removes

    std::string_view name() const override { return "set"; }
    Texts texts() const override {
        return {"Change what the header says about a volume.",
                "Voxels stay as they are."
                "\n\n"
                "Accuracy: Exact: voxels stay as they are; the header's numbers are kept in double precision.",
                {{"Voxel size and unit",
                  "vkt make ramp --dims 8 8 8 | vkt set --spacing 0.5,0.5,2 --units HU | vkt info"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    bool runs_on_gpu() const override { return true; }
    void parameters(Parameters& p) override {
        p.option("spacing", spacing, "S|SX,SY,SZ", "size of a voxel in world units");
        p.option("dist", dist, "X Y Z", "the same in volkit's spelling").values(3, 3);
        p.option("origin", origin, "X,Y,Z", "world position of the centre of the first voxel");
        p.option("direction", direction, "XX,XY,XZ,YX,…,ZZ", "world directions of the x, y and z axis, nine numbers");
        p.option("units", units, "UNIT", "unit of the physical values, for example HU");
        p.option("slope", slope, "A", "physical value = A * stored value + B");
        p.option("intercept", intercept, "B", "see --slope");
        p.option("voxel-mapping", voxel_mapping, "LO HI",
                 "values that the range of the stored integers stands for (volkit)")
            .alias("vm");
        p.option("attribute", attributes, "KEY=VALUE", "free attributes; KEY= removes one");
        p.option("dims", dims, "X Y Z", "read the same sequence of voxels with other extents");
    }

    void check() const override {
        if (spacing && dist) throw Error(ErrorKind::usage, "--spacing and --dist say the same: give one of them");
        if (spacing) check_spacing(*spacing, "spacing");
        if (dist) check_spacing(*dist, "dist");
        if (dims) check_dims(*dims, DataType::uint8, "dims");
        if (!direction.empty()) parse_direction(direction);
        if (voxel_mapping && (slope || intercept))
            throw Error(ErrorKind::usage, "--voxel-mapping sets slope and intercept: give one or the other");
        if (slope && (!std::isfinite(*slope) || *slope == 0))
            throw Error(ErrorKind::usage, text("--slope: ", *slope, " is not a finite number other than 0"));
        if (intercept && !std::isfinite(*intercept))
            throw Error(ErrorKind::usage, text("--intercept: ", *intercept, " is not finite"));
        for (auto const& attribute : attributes)
            if (std::size_t const equals = attribute.find('='); equals == std::string::npos || equals == 0)
                throw Error(ErrorKind::usage, text("--attribute: '", attribute, "' is not KEY=VALUE"));
    }

    Plan plan(std::span<Header const> inputs) const override {
        Header const& input = inputs.front();
        Plan plan;
        Header& h = plan.output = input;
        Index3 const to = dims.value_or(input.dims);
        if (!(to == input.dims)) {
            if (input.kind != Kind::structured)
                throw Error(ErrorKind::usage, "--dims does not apply to a hierarchical volume");
            if (box_of(to).voxels() != input.voxels())
                throw Error(
                    ErrorKind::usage,
                    text("--dims ", to, ": ", box_of(to).voxels(), " voxels, but the volume has ", input.voxels()),
                    "to change the number of voxels use vkt resample or vkt crop");
            h.dims = to;
            h.part.reset();
        } else {
            plan.shift = Index3{};
        }
        if (spacing) h.geometry.spacing = *spacing;
        if (dist) h.geometry.spacing = *dist;
        if (origin) h.geometry.origin = *origin;
        if (!direction.empty()) h.geometry.direction = parse_direction(direction);
        if (units) h.units = *units;
        if (slope) h.values.slope = *slope;
        if (intercept) h.values.intercept = *intercept;
        if (voxel_mapping) h.values = value_map_of(*voxel_mapping, h.dtype);
        // The stored value of holes is not touched, so it stands for another physical one.
        if (auto const stored = input.kind == Kind::hierarchical ? stored_background(input) : std::nullopt)
            h.attributes["background"] = to_text(h.values.physical(*stored));
        for (auto const& attribute : attributes) {
            std::size_t const equals = attribute.find('=');
            std::string const key = attribute.substr(0, equals), value = attribute.substr(equals + 1);
            if (value.empty())
                h.attributes.erase(key);
            else
                h.attributes[key] = value;
        }
        try {
            vkt::check(h);
        } catch (Error const& e) {
            throw Error(ErrorKind::usage, e.what());
        }
        plan.method = "header only";
        // The voxels mean other values, and so do the exact ones.
        auto values = values_of(input);
        if (values) {
            double const first = h.values.physical(input.values.stored(values->low)),
                         last = h.values.physical(input.values.stored(values->high));
            values = ValueInterval{std::min(first, last), std::max(first, last)};
        }
        if (h.values == input.values) values = input.error.values;
        plan.passing = ErrorPassing::moved(values);
        plan.passing.gain = {h.values == input.values ? 1 : std::abs(h.values.slope / input.values.slope)};
        plan.cost = 0;
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const& plan) override {
        from_ = inputs.front().dims;
        to_ = plan.output.dims;
    }

    Box footprint(Box const& output, int) const override {
        if (to_ == from_) return output;
        std::int64_t const slice = from_.x * from_.y;
        std::int64_t const first = position(output.lower), last = position(output.upper - Index3{1, 1, 1});
        return {{0, 0, first / slice}, {from_.x, from_.y, last / slice + 1}};
    }

    /// The cells stay as they are.
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        ConstView const in = inputs.front();
        Box const box = out.box;
        Index3 const n = box.dims();
        bool const in_sequence = n.x == to_.x && (n.y == to_.y || n.z == 1);
        if (in_sequence && in.contiguous() && out.contiguous()) {
            std::int64_t const skipped = position(box.lower) - in.box.lower.z * from_.x * from_.y;
            std::byte const* const first = in.data + skipped * static_cast<std::int64_t>(size_of(out.type));
            return copy_region(dense_view(first, out.type, box, in.space), out, execution);
        }
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                std::int64_t x = box.lower.x;
                while (x < box.upper.x) { // pieces of the row that lie in one row of the input
                    std::int64_t const at = position({x, y, z});
                    Index3 const from{at % from_.x, at / from_.x % from_.y, at / from_.x / from_.y};
                    std::int64_t const end = std::min(box.upper.x, x + from_.x - from.x);
                    copy_region(in.part({from, from + Index3{end - x, 1, 1}}),
                                out.part({{x, y, z}, {end, y + 1, z + 1}}), execution);
                    x = end;
                }
            }
    }

private:
    /// Of a voxel of the result in the sequence of all of them.
    std::int64_t position(Index3 p) const { return (p.z * to_.y + p.y) * to_.x + p.x; }

    Index3 from_, to_;
};

/// volkit's declare-sv: a volume of zeros. The range of an integer type means [0, 1] unless a mapping says otherwise.
class DeclareStructured : public Operation {
public:
    std::optional<Index3> dims;
    std::optional<DataType> dtype;
    std::optional<int> bytes_per_voxel;
    std::optional<Vec3> dist;
    std::optional<VoxelMapping> voxel_mapping;

    std::string_view name() const override { return "declare-sv"; }
    Texts texts() const override {
        return {"Make a structured volume of zeros.",
                "The range of an integer type stands for 0 to 1 unless --voxel-mapping says otherwise, so that filling "
                "with 1 stores the largest integer."
                "\n\n"
                "Accuracy: Exact.",
                {{"A byte volume to fill", "vkt declare-sv --dims 32 32 32 --data-format uint8 | vkt info"}}};
    }

    Shape shape() const override { return Shape::source; }
    void parameters(Parameters& p) override {
        p.option("dims", dims, "X Y Z", "numbers of voxels").needed();
        p.option("data-format", dtype, "TYPE", "data type (uint8)").alias("dtype");
        p.option("bytes-per-voxel", bytes_per_voxel, "N", "unsigned integers of this many bytes").alias("bpv");
        p.option("dist", dist, "X Y Z", "size of a voxel in world units (1 1 1)").values(3, 3).alias("spacing");
        p.option("voxel-mapping", voxel_mapping, "LO HI", "values that the range of an integer type stands for (0 1)")
            .alias("vm");
    }

    void check() const override {
        if (!dims) throw Error(ErrorKind::usage, "--dims is missing", "say for example --dims 32 32 32");
        check_dims(*dims, type(), "dims");
        if (dist) check_spacing(*dist, "dist");
        if (voxel_mapping) value_map_of(*voxel_mapping, type());
        if (bytes_per_voxel && dtype && size_of(*dtype) != size_of(type_of_bytes(*bytes_per_voxel)))
            throw Error(ErrorKind::usage,
                        text("--bytes-per-voxel ", *bytes_per_voxel, " contradicts --data-format ", *dtype));
    }

    Plan plan(std::span<Header const>) const override {
        Plan plan;
        plan.output.dims = dims.value_or(Index3{1, 1, 1});
        plan.output.dtype = type();
        if (dist) plan.output.geometry.spacing = *dist;
        if (is_integer(type())) plan.output.values = value_map_of(voxel_mapping.value_or(VoxelMapping{}), type());
        plan.method = "zeros";
        plan.passing = ErrorPassing::moved({}); // given
        plan.cost = 0;
        return plan;
    }

    void run(std::span<ConstView const>, AnyView out, Execution const&) override {
        Box const box = out.box;
        std::size_t const row = static_cast<std::size_t>(box.dims().x) * size_of(out.type);
        if (out.contiguous()) {
            std::memset(out.data, 0, out.bytes());
            return;
        }
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) std::memset(out.at(box.lower.x, y, z), 0, row);
    }

private:
    DataType type() const {
        if (dtype) return *dtype;
        return bytes_per_voxel ? type_of_bytes(*bytes_per_voxel) : DataType::uint8;
    }
};

} // namespace

VKT_OPERATION(SetHeader, "set")
VKT_OPERATION(DeclareStructured, "declare-sv")

} // namespace vkt
