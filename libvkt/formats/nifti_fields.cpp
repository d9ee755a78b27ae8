// Volumes as fields of NIfTI headers, and back.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/nifti_fields.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nifti_places.h"
#include "libvkt/formats/nrrd_header.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

namespace vkt {

namespace {

/// Codes of coordinate systems.
constexpr std::int64_t scanner = 1, aligned = 2, last_code = 5;
constexpr std::int64_t space_bits = 7, time_bits = 0x38;

struct TypeCode {
    std::int64_t code;
    DataType type;
};

constexpr TypeCode type_codes[] = {
    {2, DataType::uint8},    {256, DataType::int8},   {512, DataType::uint16},  {4, DataType::int16},
    {768, DataType::uint32}, {8, DataType::int32},    {1280, DataType::uint64}, {1024, DataType::int64},
    {16, DataType::float32}, {64, DataType::float64},
};

/// Several numbers in each voxel: colours (RGB, RGBA) and complex numbers.
struct CompoundType {
    std::int64_t code;
    DataType type;
    std::int64_t count;
};

constexpr CompoundType colours = {128, DataType::uint8, 3}, colours_and_opacity = {2304, DataType::uint8, 4};
constexpr CompoundType compound_types[] = {
    colours, colours_and_opacity, {32, DataType::float32, 2}, {1792, DataType::float64, 2}};

struct ForeignType {
    std::int64_t code;
    char const* what;
};

constexpr ForeignType foreign_types[] = {{1, "single bits"}, {1536, "float128"}, {2048, "complex numbers of float128"}};

/// Intents of volumes that are the components of vectors or of colours, along a fifth axis.
constexpr std::int64_t displacement_intent = 1006, vector_intent = 1007;
constexpr std::int64_t rgb_intent = 2003, rgba_intent = 2004;

/// Attribute: the extents along the fifth axis and those behind it, where channels lie along several.
constexpr char const* channel_dims = "channel_dims";

struct UnitCode {
    std::int64_t code;
    char const* name;
};

constexpr UnitCode unit_codes[] = {{1, "m"},   {2, "mm"},  {3, "um"},   {8, "s"},     {16, "ms"},
                                   {24, "us"}, {32, "Hz"}, {40, "ppm"}, {48, "rad/s"}};

/// What a field holds of a number; 0 of others.
std::int64_t whole(double v, double most) {
    return v >= 0 && v <= most && v == std::floor(v) ? static_cast<std::int64_t>(v) : 0;
}

/// Attributes that are fields of numbers. Codes of coordinate systems are apart, since the geometry decides on them.
struct NumberField {
    char const* name;
    double (*get)(NiftiFields const&);
    void (*set)(NiftiFields&, double);
};

constexpr NumberField number_fields[] = {
    {"cal_min", [](NiftiFields const& f) { return f.cal_min; }, [](NiftiFields& f, double v) { f.cal_min = v; }},
    {"cal_max", [](NiftiFields const& f) { return f.cal_max; }, [](NiftiFields& f, double v) { f.cal_max = v; }},
    {"intent_p1", [](NiftiFields const& f) { return f.intent_p[0]; },
     [](NiftiFields& f, double v) { f.intent_p[0] = v; }},
    {"intent_p2", [](NiftiFields const& f) { return f.intent_p[1]; },
     [](NiftiFields& f, double v) { f.intent_p[1] = v; }},
    {"intent_p3", [](NiftiFields const& f) { return f.intent_p[2]; },
     [](NiftiFields& f, double v) { f.intent_p[2] = v; }},
    {"intent_code", [](NiftiFields const& f) { return static_cast<double>(f.intent_code); },
     [](NiftiFields& f, double v) {
         if (v >= 0 && v <= 32767) f.intent_code = static_cast<std::int64_t>(v);
     }},
    {"slice_code", [](NiftiFields const& f) { return static_cast<double>(f.slice_code); },
     [](NiftiFields& f, double v) { f.slice_code = whole(v, 255); }},
    {"slice_start", [](NiftiFields const& f) { return static_cast<double>(f.slice_start); },
     [](NiftiFields& f, double v) { f.slice_start = whole(v, 32767); }},
    {"slice_end", [](NiftiFields const& f) { return static_cast<double>(f.slice_end); },
     [](NiftiFields& f, double v) { f.slice_end = whole(v, 32767); }},
    {"slice_duration", [](NiftiFields const& f) { return f.slice_duration; },
     [](NiftiFields& f, double v) { f.slice_duration = v; }},
    {"dim_info", [](NiftiFields const& f) { return static_cast<double>(f.dim_info); },
     [](NiftiFields& f, double v) { f.dim_info = whole(v, 255); }},
};

struct WordField {
    char const* name;
    std::string NiftiFields::*field;
};

constexpr WordField word_fields[] = {{"descrip", &NiftiFields::descrip},
                                     {"aux_file", &NiftiFields::aux_file},
                                     {"intent_name", &NiftiFields::intent_name}};

// --- Fields to a volume ---------------------------------------------------------------------------------------------

/// Where an affine map puts voxels; nullopt if it is none that puts them apart.
std::optional<Geometry> sform_geometry(NiftiFields const& f) {
    Geometry g;
    try {
        for (int axis = 0; axis < 3; ++axis) {
            auto const a = static_cast<std::size_t>(axis);
            set_axis(g, axis, {f.srow[a], f.srow[4 + a], f.srow[8 + a]}, "");
        }
        g.origin = {f.srow[3], f.srow[7], f.srow[11]};
        check(g);
    } catch (Error const&) {
        return std::nullopt;
    }
    return g;
}

Vec3 spacing_of(NiftiFields const& f) {
    Vec3 result;
    for (int axis = 0; axis < 3; ++axis) {
        double const s = std::abs(f.pixdim[static_cast<std::size_t>(axis) + 1]);
        result[axis] = s > 0 && std::isfinite(s) ? s : 1;
    }
    return result;
}

/// A unit quaternion of which three components are given, and a third axis that may be reversed.
std::optional<Geometry> qform_geometry(NiftiFields const& f, int version) {
    double b = f.quatern[0], c = f.quatern[1], d = f.quatern[2];
    double const rest = 1 - (b * b + c * c + d * d);
    if (!std::isfinite(rest) || rest < -1e-3) return std::nullopt;
    double a = 0;
    double const rounding = version == 1 ? static_cast<double>(std::numeric_limits<float>::epsilon())
                                         : std::numeric_limits<double>::epsilon();
    if (rest > 3 * rounding) a = std::sqrt(rest);
    double const length = std::sqrt(a * a + b * b + c * c + d * d);
    a /= length, b /= length, c /= length, d /= length;
    double const qfac = f.pixdim[0] < 0 ? -1 : 1;
    Geometry g;
    g.spacing = spacing_of(f);
    g.direction[0] = {1 - 2 * (c * c + d * d), 2 * (b * c + a * d), 2 * (b * d - a * c)};
    g.direction[1] = {2 * (b * c - a * d), 1 - 2 * (b * b + d * d), 2 * (c * d + a * b)};
    g.direction[2] = Vec3{2 * (b * d + a * c), 2 * (c * d - a * b), 1 - 2 * (b * b + c * c)} * qfac;
    for (auto& direction : g.direction) direction = direction + Vec3{}; // no negative zeros
    g.origin = {f.qoffset[0], f.qoffset[1], f.qoffset[2]};
    return g;
}

/// Of files that do not say where they lie.
Geometry base_geometry(Index3 dims, Vec3 spacing) {
    Geometry g;
    g.spacing = spacing;
    g.direction[0] = {-1, 0, 0};
    auto const middle = [&](int axis) { return static_cast<double>(dims[axis] - 1) / 2 * spacing[axis]; };
    g.origin = {middle(0), 0.0 - middle(1), 0.0 - middle(2)};
    return g;
}

/// What qform and sform agree on, but for their rounding.
bool agree(Geometry const& a, Geometry const& b) {
    for (int axis = 0; axis < 3; ++axis) {
        double const s = std::min(a.spacing[axis], b.spacing[axis]);
        if (std::abs(a.spacing[axis] - b.spacing[axis]) > 1e-3 * s) return false;
        if (std::abs(a.origin[axis] - b.origin[axis]) > 1e-2 * s) return false;
        for (int i = 0; i < 3; ++i)
            if (std::abs(a.direction[static_cast<std::size_t>(axis)][i] -
                         b.direction[static_cast<std::size_t>(axis)][i]) > 1e-3)
                return false;
    }
    return true;
}

class Reader {
public:
    Reader(NiftiHeader const& header, bool trust_paths)
        : header_(header), f_(header.fields), trust_paths_(trust_paths) {}
    RawLayout layout() const;

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = "") const {
        throw Error(ErrorKind::data, text("'", header_.name, "': ", what), hint);
    }
    void read_dims(RawLayout& layout) const;
    void read_type(RawLayout& layout) const;
    void read_geometry(RawLayout& layout) const;
    void read_values(Header& volume) const;
    void read_attributes(RawLayout& layout) const;
    void find_voxels(RawLayout& layout) const;
    void use_ours(RawLayout& layout) const;

    NiftiHeader const& header_;
    NiftiFields const& f_;
    bool trust_paths_;
};

void Reader::read_dims(RawLayout& layout) const {
    if (f_.dim[0] < 1 || f_.dim[0] > 7) fail(text("its number of dimensions, ", f_.dim[0], ", is not between 1 and 7"));
    for (std::size_t i = 1; i <= static_cast<std::size_t>(f_.dim[0]); ++i) {
        if (f_.dim[i] < 1 || f_.dim[i] > max_extent)
            fail(text("dim[", static_cast<std::int64_t>(i), "] = ", f_.dim[i], " is not between 1 and 2^40"));
        if (i <= 3)
            layout.header.dims[static_cast<int>(i) - 1] = f_.dim[i];
        else if (__builtin_mul_overflow(layout.volumes, f_.dim[i], &layout.volumes) ||
                 (i > 4 && __builtin_mul_overflow(layout.channels, f_.dim[i], &layout.channels)))
            fail("claims more volumes than any file can have");
    }
}

void Reader::read_type(RawLayout& layout) const {
    for (auto const& entry : type_codes)
        if (entry.code == f_.datatype) {
            layout.header.dtype = entry.type;
            return;
        }
    for (auto const& entry : compound_types)
        if (entry.code == f_.datatype) {
            layout.header.dtype = entry.type;
            layout.components.count = entry.count;
            return;
        }
    for (auto const& entry : foreign_types)
        if (entry.code == f_.datatype)
            fail(text("its voxels are ", entry.what, ", which are not read"), "take a part of them with nibabel");
    fail(text("data type ", f_.datatype, " is none of NIfTI's"));
}

void Reader::read_geometry(RawLayout& layout) const {
    Header& volume = layout.header;
    std::optional<Geometry> const s = f_.sform_code > 0 ? sform_geometry(f_) : std::nullopt;
    std::optional<Geometry> const q = f_.qform_code > 0 ? qform_geometry(f_, header_.version) : std::nullopt;
    if ((f_.sform_code > 0 || f_.qform_code > 0) && !s && !q)
        fail("neither its sform nor its qform is a map to the world");
    volume.geometry = s ? *s : q ? *q : base_geometry(volume.dims, spacing_of(f_));
    volume.attributes["space"] = std::string(nifti_frame);
    volume.attributes["sform_code"] = to_text(s ? f_.sform_code : std::int64_t{0});
    volume.attributes["qform_code"] = to_text(q ? f_.qform_code : std::int64_t{0});
    if (s && q && !agree(*s, *q)) volume.attributes[qform_map] = map_between(*s, *q);
}

void Reader::read_values(Header& volume) const {
    if (f_.scl_slope == 0 || !std::isfinite(f_.scl_slope)) return;                      // says that there is no map
    if (f_.datatype == colours.code || f_.datatype == colours_and_opacity.code) return; // to which none applies
    volume.values = {f_.scl_slope, f_.scl_inter};
    if (!std::isfinite(f_.scl_inter)) fail("scl_inter is not finite");
}

void Reader::read_attributes(RawLayout& layout) const {
    auto& attributes = layout.header.attributes;
    for (auto const& field : number_fields)
        if (double const value = field.get(f_); value != 0 && std::isfinite(value))
            attributes[field.name] = to_text(value);
    for (auto const& field : word_fields)
        if (std::string const value(trimmed(f_.*field.field)); !value.empty()) attributes[field.name] = value;
    auto const unit = [&](std::int64_t bits) -> std::string {
        for (auto const& entry : unit_codes)
            if (entry.code == (f_.xyzt_units & bits)) return text("\"", entry.name, "\"");
        return {};
    };
    if (!header_.comment.empty()) attributes[nifti_comment] = header_.comment;
    if (f_.slice_code != 0 || f_.slice_start != 0 || f_.slice_end != 0 || f_.slice_duration != 0 || f_.dim_info != 0)
        attributes[slice_grid] = grid_text(layout.header.dims, layout.header.geometry);
    // Colours are written as components along an axis, for which there is an intent.
    if (f_.intent_code == 0 && f_.datatype == colours.code) attributes["intent_code"] = to_text(rgb_intent);
    if (f_.intent_code == 0 && f_.datatype == colours_and_opacity.code)
        attributes["intent_code"] = to_text(rgba_intent);
    if (f_.dim[0] > 5 && std::max(f_.dim[6], f_.dim[0] > 6 ? f_.dim[7] : 1) > 1)
        attributes[channel_dims] =
            text(f_.dim[5], " ", f_.dim[6], f_.dim[0] > 6 ? text(" ", f_.dim[7]) : std::string());
    if (std::string const u = unit(space_bits); !u.empty()) attributes["space units"] = text(u, " ", u, " ", u);
    if (f_.intent_code == vector_intent || f_.intent_code == displacement_intent) attributes[sequence_kind] = "vector";
    bool const series = layout.volumes / layout.channels > 1;
    bool const dated = !series && f_.toffset != 0 && std::isfinite(f_.toffset); // the one time that it is of
    if (dated) attributes["sequence position"] = to_text(f_.toffset);
    if (!series && !dated) return;
    if (double const step = f_.pixdim[4]; series && step != 0 && std::isfinite(step) && std::isfinite(f_.toffset))
        layout.sequence = SequenceAxis{f_.toffset, step};
    if (std::string const u = unit(time_bits); !u.empty()) {
        attributes[sequence_units] = u;
        if ((f_.xyzt_units & time_bits) <= 24) attributes[sequence_kind] = "time";
    }
}

/// Of a pair the voxels lie beside the header.
void Reader::find_voxels(RawLayout& layout) const {
    layout.big_endian = header_.big_endian;
    layout.byte_skip = f_.vox_offset;
    if (header_.single) {
        layout.byte_skip -= header_.position;
        return;
    }
    find_image(layout, header_.name, trust_paths_);
}

/// What vkt wrote has all digits, and what NIfTI has no place for. If others have changed the fields since, these
/// count.
void Reader::use_ours(RawLayout& layout) const {
    if (!header_.ours) return;
    Header const& ours = *header_.ours;
    bool unchanged = ours.kind == Kind::structured && ours.dims == layout.header.dims;
    try {
        NiftiFields made = as_stored(nifti_fields(ours, layout.volumes, layout.channels), header_.version);
        made.vox_offset = f_.vox_offset;
        unchanged = unchanged && made == f_;
    } catch (Error const&) {
        unchanged = false;
    }
    if (!unchanged) {
        for (auto const& [key, value] : ours.attributes)
            if (!key.starts_with("space") && !key.starts_with("sequence")) layout.header.attributes.emplace(key, value);
        layout.header.units = ours.units;
        layout.header.history = ours.history;
        layout.header.error = VolumeError::lost("another program changed the header");
        return;
    }
    layout.header = ours;
    layout.header.dry_run = layout.header.timing = false;
    layout.sequence.reset();
    if (layout.volumes / layout.channels < 2) return;
    if (auto const step = number_of(ours, "sequence step"))
        layout.sequence = SequenceAxis{number_of(ours, "sequence position").value_or(0), *step};
}

RawLayout Reader::layout() const {
    RawLayout layout;
    layout.not_read = header_.not_read;
    read_dims(layout);
    read_type(layout);
    read_geometry(layout);
    read_values(layout.header);
    read_attributes(layout);
    find_voxels(layout);
    use_ours(layout);
    layout.header = in_utf8(std::move(layout.header));
    return layout;
}

// --- A volume to fields ---------------------------------------------------------------------------------------------

std::optional<std::int64_t> code_of(Header const& header, std::string const& attribute) {
    auto const code = number_of(header, attribute);
    if (!code || *code != std::floor(*code) || *code < 0 || *code > static_cast<double>(last_code)) return std::nullopt;
    return static_cast<std::int64_t>(*code);
}

std::array<double, 3> quaternion(Geometry const& g) {
    auto const& d = g.direction;
    double const hand = dot(d[0], cross(d[1], d[2])) < 0 ? -1 : 1;
    auto const r = [&](int row, std::size_t column) { return d[column][row] * (column == 2 ? hand : 1); };
    // Of the four squares the largest has the most digits.
    std::array<double, 4> const squares{1 + r(0, 0) + r(1, 1) + r(2, 2), 1 + r(0, 0) - r(1, 1) - r(2, 2),
                                        1 - r(0, 0) + r(1, 1) - r(2, 2), 1 - r(0, 0) - r(1, 1) + r(2, 2)};
    auto const largest = std::max_element(squares.begin(), squares.end()) - squares.begin();
    double const twice = std::sqrt(squares[static_cast<std::size_t>(largest)]), over = 0.5 / twice;
    double const ab = r(2, 1) - r(1, 2), ac = r(0, 2) - r(2, 0), ad = r(1, 0) - r(0, 1);
    double const bc = r(0, 1) + r(1, 0), bd = r(0, 2) + r(2, 0), cd = r(1, 2) + r(2, 1);
    double a = 0;
    std::array<double, 3> q{};
    switch (largest) {
    case 0:
        a = twice / 2, q = {ab * over, ac * over, ad * over};
        break;
    case 1:
        a = ab * over, q = {twice / 2, bc * over, bd * over};
        break;
    case 2:
        a = ac * over, q = {bc * over, twice / 2, cd * over};
        break;
    default:
        a = ad * over, q = {bd * over, cd * over, twice / 2};
    }
    for (double& x : q) x = (a < 0 ? -x : x) + 0.0; // the first component, which is not stored, is not negative
    return q;
}

/// `other`: where the qform has the lattice, if that is elsewhere.
void put_codes(NiftiFields& f, Header const& header, Geometry const& g, std::optional<Geometry> const& other) {
    auto const s = code_of(header, "sform_code"), q = code_of(header, "qform_code");
    std::int64_t const usual = is_anatomical(frame_of(header)) ? scanner : aligned;
    f.sform_code = s.value_or(q.value_or(0) > 0 ? 0 : usual);
    f.qform_code = q.value_or(s ? 0 : usual);
    // Without a code the place must be the one that readers assume.
    if (f.sform_code == 0 && f.qform_code == 0 && !same_geometry(g, base_geometry(header.dims, g.spacing)))
        f.sform_code = f.qform_code = usual;
    if (f.qform_code == 0 || other || is_orthonormal(g)) return;
    if (f.sform_code == 0) f.sform_code = f.qform_code;
    f.qform_code = 0; // a quaternion has no shear
}

std::int64_t unit_code(Header const& header, std::string const& attribute, std::int64_t bits) {
    auto const found = header.attributes.find(attribute);
    auto const entries = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (!entries || entries->empty()) return 0;
    for (auto const& unit : unit_codes)
        if ((unit.code & bits) != 0 && std::all_of(entries->begin(), entries->end(), [&](auto const& entry) {
                return entry == text("\"", unit.name, "\"");
            }))
            return unit.code;
    return 0;
}

/// Where the axes of the world have units that differ, or that NIfTI does not know, everything in millimetres.
Header in_one_unit(Header header) {
    constexpr std::pair<std::string_view, double> millimetres[] = {
        {"\"m\"", 1000}, {"\"cm\"", 10}, {"\"mm\"", 1}, {"\"um\"", 1e-3}, {"\"nm\"", 1e-6}};
    auto const found = header.attributes.find("space units");
    auto const entries = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (!entries || entries->size() != 3 || unit_code(header, "space units", space_bits) != 0) return header;
    Vec3 factor;
    for (int axis = 0; axis < 3; ++axis) {
        auto const known = std::find_if(std::begin(millimetres), std::end(millimetres), [&](auto const& unit) {
            return unit.first == (*entries)[static_cast<std::size_t>(axis)];
        });
        if (known == std::end(millimetres)) return header;
        factor[axis] = known->second;
    }
    Geometry& g = header.geometry;
    auto const scaled = [&](Vec3 v) { return Vec3{v.x * factor.x, v.y * factor.y, v.z * factor.z}; };
    for (int axis = 0; axis < 3; ++axis)
        set_axis(g, axis, scaled(g.direction[static_cast<std::size_t>(axis)] * g.spacing[axis]), "the spacing");
    g.origin = scaled(g.origin);
    found->second = "\"mm\" \"mm\" \"mm\"";
    header.attributes.erase(qform_map); // between worlds of another unit
    return header;
}

void put_place(NiftiFields& f, Header const& header) {
    Geometry const g = geometry_in(nifti_frame, header);
    for (int axis = 0; axis < 3; ++axis) {
        auto const a = static_cast<std::size_t>(axis);
        for (int row = 0; row < 3; ++row)
            f.srow[static_cast<std::size_t>(row) * 4 + a] = g.direction[a][row] * g.spacing[axis];
        f.srow[a * 4 + 3] = g.origin[axis];
    }
    std::optional<Geometry> other = qform_of(header, g);
    // Alone, the qform is the place itself.
    if (code_of(header, "sform_code").value_or(0) == 0 || code_of(header, "qform_code").value_or(0) == 0) other.reset();
    put_codes(f, header, g, other);
    Geometry const& q = other ? *other : g;
    for (int axis = 0; axis < 3; ++axis) {
        auto const a = static_cast<std::size_t>(axis);
        f.qoffset[a] = q.origin[axis];
        f.pixdim[a + 1] = q.spacing[axis];
    }
    bool const left_handed = dot(q.direction[0], cross(q.direction[1], q.direction[2])) < 0;
    f.pixdim[0] = left_handed ? -1 : 1;
    if (is_orthonormal(q)) f.quatern = quaternion(q);
}

/// Several axes of channels, if they are as many.
void put_channel_dims(NiftiFields& f, Header const& header, std::int64_t channels) {
    auto const found = header.attributes.find(channel_dims);
    if (found == header.attributes.end()) return;
    std::vector<std::int64_t> extents;
    for (std::string const& word : words_of(found->second)) extents.push_back(integer_in(word).value_or(0));
    if (extents.size() < 2 || extents.size() > 3) return;
    std::int64_t product = 1;
    for (std::int64_t const n : extents)
        if (n < 1 || __builtin_mul_overflow(product, n, &product)) return;
    if (product != channels) return;
    f.dim[0] = 4 + std::ssize(extents);
    std::copy(extents.begin(), extents.end(), f.dim.begin() + 5);
}

/// Takes what lies beside a header of this name, if anything does; of NAME.hdr what should.
bool look_for_image(RawLayout& layout, std::string const& header_name, bool trust_paths) {
    std::string base =
        lower_case(header_name).ends_with(".gz") ? header_name.substr(0, header_name.size() - 3) : header_name;
    bool const named = lower_case(base).ends_with(".hdr"), capitals = base.ends_with(".HDR");
    if (named) base.resize(base.size() - 4);
    base.erase(0, base.rfind('/') + 1); // npos + 1 is 0
    std::string const usual = beside(header_name, base + (capitals ? ".IMG" : ".img"), trust_paths);
    std::error_code error;
    bool const there = std::filesystem::exists(usual, error);
    if (named || there) layout.files = {usual};
    if (there) return true;
    for (char const* const end : {".img", ".img.gz", ".IMG.gz", ".IMG.GZ"}) {
        std::string const other = beside(header_name, base + end, trust_paths);
        if (!std::filesystem::exists(other, error)) continue;
        if (lower_case(end).ends_with(".gz")) layout.encoding = Encoding::deflate;
        layout.files = {other};
        return true;
    }
    return false;
}

} // namespace

void find_image(RawLayout& layout, std::string const& header_name, bool trust_paths) {
    std::string const real = where_linked(header_name);
    if (!real.empty() && look_for_image(layout, real, trust_paths)) return;
    layout.files.clear();
    if (look_for_image(layout, header_name, trust_paths) || !layout.files.empty()) return; // who opens it will say
    throw Error(ErrorKind::data,
                text("'", header_name, "': the header of a pair, whose voxels are in a file NAME.img beside NAME.hdr"),
                "read the pair by that name");
}

RawLayout nifti_layout(NiftiHeader const& header, bool trust_paths) { return Reader(header, trust_paths).layout(); }

NiftiFields nifti_fields(Header const& volume, std::int64_t volumes, std::int64_t channels) {
    Header const header = in_one_unit(volume);
    NiftiFields f;
    double const intent = number_of(header, "intent_code").value_or(0);
    // Vectors whose components nobody numbers.
    if (channels == 1 && !number_of(header, "sequence step") &&
        (intent == vector_intent || intent == displacement_intent))
        channels = volumes;
    std::int64_t const times = volumes / channels;
    bool const series = times > 1;
    f.dim = {channels > 1 ? 5 : series ? 4 : 3, header.dims.x, header.dims.y, header.dims.z, times, channels, 1, 1};
    for (auto const& entry : type_codes)
        if (entry.type == header.dtype) f.datatype = entry.code;
    f.bitpix = static_cast<std::int64_t>(8 * size_of(header.dtype));
    if (channels > 1) put_channel_dims(f, header, channels);
    put_place(f, header);
    f.pixdim[4] = f.pixdim[5] = f.pixdim[6] = f.pixdim[7] = 1;
    if (series) {
        double const step = number_of(header, "sequence step").value_or(0);
        f.pixdim[4] = std::isfinite(step) ? std::abs(step) : 0; // 0: nobody said it
    }
    auto const position = number_of(header, "sequence position");
    if (position && std::isfinite(*position)) f.toffset = *position;
    f.scl_slope = header.values.slope;
    f.scl_inter = header.values.intercept;
    if (static_cast<float>(f.scl_slope) == 0)
        throw Error(ErrorKind::usage, text("NIfTI cannot hold the slope ", f.scl_slope),
                    "store physical values: vkt convert --dtype float32");
    f.xyzt_units = unit_code(header, "space units", space_bits);
    if (series || position) f.xyzt_units |= unit_code(header, sequence_units, time_bits);
    for (auto const& field : number_fields)
        if (auto const value = number_of(header, field.name); value && std::isfinite(*value)) field.set(f, *value);
    for (auto const& field : word_fields)
        if (auto const found = header.attributes.find(field.name); found != header.attributes.end())
            f.*field.field = found->second;
    // Of one colour alone it is none.
    if ((f.intent_code == rgb_intent && channels != 3) || (f.intent_code == rgba_intent && channels != 4))
        f.intent_code = 0;
    return f;
}

std::string nifti_type_name(DataType type) {
    bool const known = std::any_of(std::begin(type_codes), std::end(type_codes),
                                   [&](auto const& entry) { return entry.type == type; });
    return known ? std::string(name_of(type)) : std::string();
}

} // namespace vkt
