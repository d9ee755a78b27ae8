// Writing a volume as an HDF5 dataset [z, y, x], in chunks, a layer of them at a time.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/hdf5/existing.h"
#include "libvkt/formats/hdf5/handle.h"
#include "libvkt/formats/hdf5/kept_header.h"
#include "libvkt/formats/hdf5/remove.h"
#include "libvkt/formats/hdf5/scales.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/layers.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/series_axes.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <optional>

namespace vkt::hdf5 {
namespace {

constexpr char const* default_dataset = "/data";
constexpr std::int64_t chunk_edge = 64, chunk_depth = 16;
/// Slices from here on have chunks of twice the edge, a MiB at most, which others' caches hold: fewer of them are found
/// sooner, and what they waste at the ends of a volume is little.
constexpr std::int64_t large_slice = 512;
constexpr std::int64_t most_places = 3840; ///< in an attribute, of which a text takes 16 bytes
constexpr unsigned deflate_level = 4;

hid_t half_type() {
    hid_t const type = H5Tcopy(H5T_IEEE_F32LE);
    H5Tset_fields(type, 15, 10, 5, 0, 10);
    H5Tset_size(type, 2);
    H5Tset_ebias(type, 15);
    return type;
}

Handle file_type(DataType type) {
    switch (type) {
    case DataType::uint8:
        return {H5Tcopy(H5T_STD_U8LE), H5Tclose};
    case DataType::int8:
        return {H5Tcopy(H5T_STD_I8LE), H5Tclose};
    case DataType::uint16:
        return {H5Tcopy(H5T_STD_U16LE), H5Tclose};
    case DataType::int16:
        return {H5Tcopy(H5T_STD_I16LE), H5Tclose};
    case DataType::uint32:
        return {H5Tcopy(H5T_STD_U32LE), H5Tclose};
    case DataType::int32:
        return {H5Tcopy(H5T_STD_I32LE), H5Tclose};
    case DataType::uint64:
        return {H5Tcopy(H5T_STD_U64LE), H5Tclose};
    case DataType::int64:
        return {H5Tcopy(H5T_STD_I64LE), H5Tclose};
    case DataType::float16:
        return {half_type(), H5Tclose};
    case DataType::float32:
        return {H5Tcopy(H5T_IEEE_F32LE), H5Tclose};
    case DataType::float64:
        break;
    }
    return {H5Tcopy(H5T_IEEE_F64LE), H5Tclose};
}

/// The one unit that an attribute lists for all axes; else empty.
std::string unit_in(Header const& header, char const* attribute) {
    auto const found = header.attributes.find(attribute);
    auto const units = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (!units || units->empty() ||
        std::any_of(units->begin(), units->end(), [&](auto const& u) { return u != (*units)[0]; }))
        return {};
    return (*units)[0].substr(1, (*units)[0].size() - 2);
}

class Writer : public VolumeWriter {
public:
    Writer(std::string const& path, WriteOptions const& options)
        : options_(options), dataset_(part_to_write(path, "dataset", "/group/volume")),
          file_(file_part(path).file, options.force, OutputKind::named_file), named_(!dataset_.empty()) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': HDF5 files cannot be written to a pipe"),
                        "name a file: -o out.h5");
        if (dataset_.empty()) dataset_ = default_dataset;
    }

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

private:
    void need(bool done, char const* what) const {
        if (!done) throw Error(ErrorKind::io, text("cannot write '", file_.path(), "': HDF5 cannot store ", what));
    }
    void put_numbers(char const* name, std::vector<double> const& values) const;
    void put_words(char const* name, std::string const& value) const;
    void put_list(char const* name, std::vector<std::string> const& values) const;
    void put_about();
    void put_places();
    std::vector<Scale> scales() const;
    void open_file();
    bool copy_existing();
    std::vector<hsize_t> leading() const;
    void create(std::vector<hsize_t> const& leading);
    void widen(std::vector<hsize_t> const& leading);
    void copy_chunks(hid_t from, hid_t to) const;
    void flush();

    WriteOptions options_;
    std::string dataset_;
    OutputFile file_;
    bool named_; ///< so that others of the file that is there stay
    SeriesAxes series_{"HDF5 dataset", ".h5"};
    Header header_;
    std::array<hsize_t, 3> shape_{}, chunk_{}; ///< z, y, x
    std::vector<hsize_t> leading_;             ///< extents before these, so far
    std::optional<Handle> hdf5_, data_, space_, type_;
    std::size_t row_ = 0, layer_ = 0; ///< bytes of a row, and of what is written at a time
    std::int64_t depth_ = 1;          ///< slices of a chunk
    std::int64_t rows_ = 0;           ///< of this volume that were written
    std::vector<std::byte> held_;
};

void Writer::begin(Header const& header) {
    refuse_bricks(header, "HDF5 datasets");
    series_.add(header);
    if (series_.volumes() == 1) header_ = series_.header();
    file_.expect(options_.compress ? least_deflated(header_.bytes()) : header_.bytes());
    rows_ = 0;
    std::vector<hsize_t> const wanted = leading();
    if (series_.volumes() == 1) {
        open_file();
        create(wanted);
    } else {
        if (wanted.size() > leading_.size()) widen(wanted);
        std::vector<hsize_t> extents = wanted;
        extents.insert(extents.end(), shape_.begin(), shape_.end());
        need(H5Dset_extent(*data_, extents.data()) >= 0, "another volume");
        space_.emplace(H5Dget_space(*data_), H5Sclose);
    }
    leading_ = wanted;
}

void Writer::open_file() {
    Index3 const n = header_.dims;
    row_ = static_cast<std::size_t>(n.x) * size_of(header_.dtype);
    // Chunks are as deep as the budget allows a layer of them; slices too large for it are written row by row.
    std::size_t const slice = row_ * static_cast<std::size_t>(n.y);
    std::size_t const budget = options_.memory.value_or(default_memory()) / 8;
    depth_ = std::clamp<std::int64_t>(static_cast<std::int64_t>(budget / slice), 1, std::min(chunk_depth, n.z));
    bool const by_rows = slice > budget;
    shape_ = {static_cast<hsize_t>(n.z), static_cast<hsize_t>(n.y), static_cast<hsize_t>(n.x)};
    std::int64_t const rows =
        std::clamp<std::int64_t>(static_cast<std::int64_t>(budget / row_), 1, std::min(chunk_edge, n.y));
    bool const large = n.x >= large_slice && n.y >= large_slice && size_of(header_.dtype) <= 4;
    std::int64_t const edge = large ? 2 * chunk_edge : chunk_edge;
    chunk_ = {static_cast<hsize_t>(depth_), static_cast<hsize_t>(std::min(edge, n.y)),
              static_cast<hsize_t>(std::min(edge, n.x))};
    if (by_rows) chunk_ = {1, static_cast<hsize_t>(rows), static_cast<hsize_t>(std::min(4 * chunk_edge, n.x))};
    layer_ = by_rows ? row_ * static_cast<std::size_t>(rows) : slice * static_cast<std::size_t>(depth_);

    Handle const access = access_to_write();
    if (!named_ || !copy_existing())
        hdf5_.emplace(H5Fcreate(file_.temporary().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
    need(static_cast<bool>(*hdf5_), "the file");
    type_.emplace(file_type(header_.dtype));
}

/// Of a file that is there, all other datasets stay: a copy of it takes its name in the end. False if there is none.
bool Writer::copy_existing() {
    std::optional<Handle> copy = copy_of_existing(file_, header_.bytes() / (options_.compress ? 1032 : 1));
    if (!copy) return false;
    hdf5_.emplace(std::move(*copy));
    if (is_taken(*hdf5_, dataset_, file_) && !give_way(*hdf5_, dataset_)) remove_named(*hdf5_, dataset_, file_.path());
    return true;
}

/// Extents before z of the volumes so far.
std::vector<hsize_t> Writer::leading() const {
    std::vector<hsize_t> result;
    for (std::int64_t const n : series_.extents()) result.push_back(static_cast<hsize_t>(n));
    return result;
}

/// The dataset, without a name yet. Its first dimension grows if it enumerates volumes.
void Writer::create(std::vector<hsize_t> const& leading) {
    std::vector<hsize_t> shape = leading, chunk(leading.size(), 1);
    shape.insert(shape.end(), shape_.begin(), shape_.end());
    chunk.insert(chunk.end(), chunk_.begin(), chunk_.end());
    std::vector<hsize_t> most = shape;
    if (!leading.empty()) most.front() = H5S_UNLIMITED;
    auto const rank = static_cast<int>(shape.size());
    space_.emplace(H5Screate_simple(rank, shape.data(), most.data()), H5Sclose);
    Handle const creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(creation, rank, chunk.data());
    // The time of filling is left alone: H5D_FILL_TIME_NEVER makes HDF5 1.10 lose the only chunk of a dataset in files
    // of its latest layout.
    H5Pset_obj_track_times(creation, false); // equal volumes give equal files
    if (options_.compress) {
        H5Pset_shuffle(creation);
        H5Pset_deflate(creation, deflate_level);
    }
    Handle const cache(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    H5Pset_chunk_cache(cache, 521, 0, 1); // chunks are written whole, once
    data_.emplace(H5Dcreate_anon(*hdf5_, *type_, *space_, creation, cache), H5Dclose);
    need(static_cast<bool>(*data_), "the dataset");
}

/// How many dimensions there are is known when a second volume comes, or a second row of them. What was written moves
/// as it is, and the room that it took is used again.
void Writer::widen(std::vector<hsize_t> const& leading) {
    Handle const before = std::move(*data_);
    create(leading);
    copy_chunks(before, *data_);
}

/// All volumes so far, which are the first entry of the new dimension.
void Writer::copy_chunks(hid_t from, hid_t to) const {
    std::vector<hsize_t> extents = leading_, step(leading_.size(), 1);
    extents.insert(extents.end(), shape_.begin(), shape_.end());
    step.insert(step.end(), chunk_.begin(), chunk_.end());
    std::vector<hsize_t> at(extents.size(), 0);
    std::vector<std::byte> bytes;
    for (bool more = true; more;) {
        hsize_t size = 0;
        std::uint32_t filters = 0;
        need(H5Dget_chunk_storage_size(from, at.data(), &size) >= 0, "chunks of the first volumes");
        bytes.resize(size);
        std::vector<hsize_t> place = at;
        place.insert(place.begin(), 0);
        need(H5Dread_chunk(from, H5P_DEFAULT, at.data(), &filters, bytes.data()) >= 0 &&
                 H5Dwrite_chunk(to, H5P_DEFAULT, filters, place.data(), bytes.size(), bytes.data()) >= 0,
             "chunks of the first volumes: is the disk full?");
        more = false;
        for (std::size_t k = at.size(); k-- > 0 && !more;) {
            at[k] += step[k];
            more = at[k] < extents[k];
            if (!more) at[k] = 0;
        }
    }
}

void Writer::put_numbers(char const* name, std::vector<double> const& values) const {
    hsize_t const n = values.size();
    Handle const space(n == 1 ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &n, nullptr), H5Sclose);
    Handle const attribute(H5Acreate2(*data_, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    need(attribute && H5Awrite(attribute, H5T_NATIVE_DOUBLE, values.data()) >= 0, name);
}

void Writer::put_words(char const* name, std::string const& value) const {
    need(hdf5::put_words(*data_, name, value), name);
}

void Writer::put_list(char const* name, std::vector<std::string> const& values) const {
    hsize_t const n = values.size();
    Handle const space(H5Screate_simple(1, &n, nullptr), H5Sclose), type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type, H5T_VARIABLE);
    H5Tset_cset(type, H5T_CSET_UTF8);
    std::vector<char const*> words;
    words.reserve(values.size());
    for (std::string const& value : values) words.push_back(value.c_str());
    Handle const attribute(H5Acreate2(*data_, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    need(attribute && H5Awrite(attribute, type, words.data()) >= 0, name);
}

/// Where volumes lie along the dimensions that enumerate them. Times that are too many for an attribute are counted in
/// steps from the first, which the header has.
void Writer::put_places() {
    std::vector<std::string> lost = series_.differing();
    for (SeriesAxis const& axis : series_.axes()) {
        bool const fits = axis.size() <= most_places;
        if (!axis.time) {
            if (fits)
                put_list(channel_attribute, channels_of(axis));
            else
                lost.emplace_back("channel");
            continue;
        }
        if (std::find(axis.places.begin(), axis.places.end(), "") != axis.places.end()) continue; // nothing is said
        if (auto const steps = steps_of(axis, header_); !fits && steps) {
            header_.attributes["sequence position"] = axis.places.front();
            header_.attributes["sequence step"] = to_text(steps->step);
        } else if (!fits) {
            lost.emplace_back("sequence position");
        } else {
            put_numbers(position_attribute, times_of(axis));
        }
        if (std::string const unit = unit_in(header_, "sequence units"); !unit.empty())
            put_words(units_attribute, unit);
    }
    if (!lost.empty() && options_.notice)
        options_.notice(text("one HDF5 dataset does not hold attributes that differ between its volumes (",
                             join(lost, ", "), "): not kept"));
}

/// For NetCDF and xarray, which know dimensions by these alone. Axes that are turned have no coordinates of their own.
std::vector<Scale> Writer::scales() const {
    std::vector<Scale> result;
    for (SeriesAxis const& axis : series_.axes()) {
        Scale scale{axis.name(), static_cast<hsize_t>(axis.size()), result.empty(), {}, {}, {}};
        bool const stated = std::find(axis.places.begin(), axis.places.end(), "") == axis.places.end();
        if (axis.time && stated) {
            scale.places = times_of(axis);
            scale.units = unit_in(header_, "sequence units");
        } else if (!axis.time) {
            scale.names = channels_of(axis);
        }
        result.push_back(std::move(scale));
    }
    Geometry const& g = header_.geometry;
    constexpr char const* names[] = {"x", "y", "z"};
    for (int a = 2; a >= 0; --a) {
        Scale scale{names[a], static_cast<hsize_t>(header_.dims[a]), false, {}, {}, {}};
        if (g.direction == Geometry{}.direction) {
            for (std::int64_t i = 0; i < header_.dims[a]; ++i)
                scale.places.push_back(g.origin[a] + static_cast<double>(i) * g.spacing[a]);
            scale.units = unit_in(header_, "space units");
        }
        result.push_back(std::move(scale));
    }
    return result;
}

/// What others look for, and all of the header for vkt. Lists are in the order of the dataset's axes.
void Writer::put_about() {
    Geometry const& g = header_.geometry;
    put_numbers("spacing", {g.spacing.z, g.spacing.y, g.spacing.x});
    put_numbers("origin", {g.origin.z, g.origin.y, g.origin.x});
    if (std::string const unit = unit_in(header_, "space units"); !unit.empty()) {
        put_words("spacing_units", unit);
        double const um = unit == "um" ? 1 : unit == "mm" ? 1e3 : unit == "nm" ? 1e-3 : unit == "angstrom" ? 1e-4 : 0;
        if (um > 0) put_numbers("element_size_um", {g.spacing.z * um, g.spacing.y * um, g.spacing.x * um});
    }
    if (header_.values != ValueMap{}) {
        put_numbers("scale_factor", {header_.values.slope});
        put_numbers("add_offset", {header_.values.intercept});
    }
    if (!header_.units.empty()) put_words("units", header_.units);
    std::vector<std::string> names;
    for (SeriesAxis const& axis : series_.axes()) names.push_back(axis.name());
    names.insert(names.end(), {"z", "y", "x"});
    put_list("DIMENSION_LABELS", names);
    put_places();
    need(put_header(*data_, header_), "the header");
}

/// Whole slices of a layer of chunks, or some rows of one.
void Writer::flush() {
    keep_quiet();
    auto const rows = static_cast<hsize_t>(held_.size() / row_);
    auto const height = static_cast<hsize_t>(header_.dims.y);
    auto const first = static_cast<hsize_t>(rows_);
    bool const slices = rows % height == 0 && first % height == 0;
    std::vector<hsize_t> start, count(leading_.size(), 1);
    auto volume = static_cast<hsize_t>(series_.volumes() - 1);
    for (std::size_t k = leading_.size(); k-- > 0;) {
        start.insert(start.begin(), volume % leading_[k]);
        volume /= leading_[k];
    }
    start.insert(start.end(), {first / height, slices ? 0 : first % height, 0});
    count.insert(count.end(),
                 {slices ? rows / height : 1, slices ? height : rows, static_cast<hsize_t>(header_.dims.x)});
    Handle const memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose);
    H5Sselect_hyperslab(*space_, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    need(H5Dwrite(*data_, *type_, memory, *space_, H5P_DEFAULT, held_.data()) >= 0, "voxels: is the disk full?");
    rows_ += static_cast<std::int64_t>(rows);
    held_.clear();
}

void Writer::write(std::byte const* voxels, std::size_t n) {
    std::size_t const slice = row_ * static_cast<std::size_t>(header_.dims.y);
    hold_layers(
        held_, {layer_, slice, header_.bytes()}, voxels, n, [&] { return static_cast<std::size_t>(rows_) * row_; },
        [&] { flush(); });
}

void Writer::close() {
    if (series_.volumes() == 0) throw Error(ErrorKind::data, "there is no volume to write");
    series_.finish();
    header_ = series_.header();
    put_about();
    Handle const groups(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
    H5Pset_create_intermediate_group(groups, 1);
    need(H5Olink(*data_, *hdf5_, dataset_.c_str(), groups, H5P_DEFAULT) >= 0, "the dataset");
    need(attach_scales(*hdf5_, dataset_, scales()), "scales of the dimensions");
    bool good = data_->reset();
    good = space_->reset() && good;
    good = type_->reset() && good;
    good = H5Fflush(*hdf5_, H5F_SCOPE_LOCAL) >= 0 && hdf5_->reset() && good;
    need(good, "the rest: is the disk full?");
    file_.commit();
}

} // namespace

std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options) {
    if (options.at) return region_writer(path, options);
    return std::make_unique<Writer>(path, options);
}

} // namespace vkt::hdf5
