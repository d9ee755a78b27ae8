// Writing a volume as an HDF5 dataset [z, y, x], in chunks, a layer of them at a time.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/hdf5/handle.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/layers.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/refusals.h"

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
/// Attributes of the older file format are no larger than 64 KiB.
constexpr std::size_t most_history = std::size_t{24} << 10, most_attribute = std::size_t{60} << 10;
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

class Writer : public VolumeWriter {
public:
    Writer(std::string const& path, WriteOptions const& options)
        : options_(options), file_(file_part(path).file, options.force, OutputKind::named_file),
          dataset_(file_part(path).part) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': HDF5 files cannot be written to a pipe"),
                        "name a file: -o out.h5");
        if (dataset_.empty()) dataset_ = default_dataset;
        if (dataset_.ends_with('/') || dataset_.find("//") != std::string::npos)
            throw Error(ErrorKind::usage, text("'", dataset_, "' names no dataset"), "e.g. -o out.h5:/group/volume");
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
    void put_about() const;
    void flush();

    WriteOptions options_;
    OutputFile file_;
    std::string dataset_;
    Header header_;
    std::optional<Handle> hdf5_, data_, space_, type_;
    std::size_t row_ = 0, layer_ = 0; ///< bytes of a row, and of what is written at a time
    std::int64_t depth_ = 1;          ///< slices of a chunk
    std::int64_t rows_ = 0;           ///< that were written
    std::vector<std::byte> held_;
    bool begun_ = false;
};

void Writer::begin(Header const& header) {
    refuse_bricks_and_series(header, begun_, "HDF5 datasets", "an HDF5 file", ".h5");
    header_ = in_utf8(header);
    Index3 const n = header_.dims;
    file_.expect(options_.compress ? least_deflated(header_.bytes()) : header_.bytes());
    row_ = static_cast<std::size_t>(n.x) * size_of(header_.dtype);
    // Chunks are as deep as the budget allows a layer of them; slices too large for it are written row by row.
    std::size_t const slice = row_ * static_cast<std::size_t>(n.y);
    std::size_t const budget = options_.memory.value_or(default_memory()) / 8;
    depth_ = std::clamp<std::int64_t>(static_cast<std::int64_t>(budget / slice), 1, std::min(chunk_depth, n.z));
    bool const by_rows = slice > budget;
    std::array<hsize_t, 3> const shape{static_cast<hsize_t>(n.z), static_cast<hsize_t>(n.y), static_cast<hsize_t>(n.x)};
    std::int64_t const rows =
        std::clamp<std::int64_t>(static_cast<std::int64_t>(budget / row_), 1, std::min(chunk_edge, n.y));
    bool const large = n.x >= large_slice && n.y >= large_slice && size_of(header_.dtype) <= 4;
    std::int64_t const edge = large ? 2 * chunk_edge : chunk_edge;
    std::array<hsize_t, 3> chunk{static_cast<hsize_t>(depth_), static_cast<hsize_t>(std::min(edge, n.y)),
                                 static_cast<hsize_t>(std::min(edge, n.x))};
    if (by_rows) chunk = {1, static_cast<hsize_t>(rows), static_cast<hsize_t>(std::min(4 * chunk_edge, n.x))};
    layer_ = by_rows ? row_ * static_cast<std::size_t>(rows) : slice * static_cast<std::size_t>(depth_);

    H5dont_atexit();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    Handle const access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_file_locking(access, false, true); // it is ours, and marked as such
    hdf5_.emplace(H5Fcreate(file_.temporary().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
    need(static_cast<bool>(*hdf5_), "the file");
    type_.emplace(file_type(header_.dtype));
    space_.emplace(H5Screate_simple(3, shape.data(), nullptr), H5Sclose);
    Handle const creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose), groups(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
    H5Pset_create_intermediate_group(groups, 1);
    H5Pset_chunk(creation, 3, chunk.data());
    H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER);
    H5Pset_obj_track_times(creation, false); // equal volumes give equal files
    if (options_.compress) {
        H5Pset_shuffle(creation);
        H5Pset_deflate(creation, deflate_level);
    }
    Handle const cache(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    H5Pset_chunk_cache(cache, 521, 0, 1); // chunks are written whole, once
    data_.emplace(H5Dcreate2(*hdf5_, dataset_.c_str(), *type_, *space_, groups, creation, cache), H5Dclose);
    need(static_cast<bool>(*data_), "the dataset");
    put_about();
}

void Writer::put_numbers(char const* name, std::vector<double> const& values) const {
    hsize_t const n = values.size();
    Handle const space(n == 1 ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &n, nullptr), H5Sclose);
    Handle const attribute(H5Acreate2(*data_, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    need(attribute && H5Awrite(attribute, H5T_NATIVE_DOUBLE, values.data()) >= 0, name);
}

void Writer::put_words(char const* name, std::string const& value) const {
    Handle const space(H5Screate(H5S_SCALAR), H5Sclose), type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type, H5T_VARIABLE);
    H5Tset_cset(type, H5T_CSET_UTF8);
    char const* const words = value.c_str();
    Handle const attribute(H5Acreate2(*data_, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    need(attribute && H5Awrite(attribute, type, &words) >= 0, name);
}

/// What others look for, and all of the header for vkt. Lists are in the order of the dataset's axes.
void Writer::put_about() const {
    Geometry const& g = header_.geometry;
    put_numbers("spacing", {g.spacing.z, g.spacing.y, g.spacing.x});
    put_numbers("origin", {g.origin.z, g.origin.y, g.origin.x});
    auto const found = header_.attributes.find("space units");
    auto const units = found == header_.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (units && units->size() == 3 && (*units)[0] == (*units)[1] && (*units)[0] == (*units)[2]) {
        std::string const unit = (*units)[0].substr(1, (*units)[0].size() - 2);
        put_words("spacing_units", unit);
        double const um = unit == "um" ? 1 : unit == "mm" ? 1e3 : unit == "nm" ? 1e-3 : unit == "angstrom" ? 1e-4 : 0;
        if (um > 0) put_numbers("element_size_um", {g.spacing.z * um, g.spacing.y * um, g.spacing.x * um});
    }
    if (header_.values != ValueMap{}) {
        put_numbers("scale_factor", {header_.values.slope});
        put_numbers("add_offset", {header_.values.intercept});
    }
    if (!header_.units.empty()) put_words("units", header_.units);
    std::array<char const*, 3> const names{"z", "y", "x"};
    hsize_t const three = 3;
    Handle const space(H5Screate_simple(1, &three, nullptr), H5Sclose), type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type, H5T_VARIABLE);
    Handle const labels(H5Acreate2(*data_, "DIMENSION_LABELS", type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    need(labels && H5Awrite(labels, type, names.data()) >= 0, "the names of the axes");
    Header kept = header_;
    kept.timing = kept.dry_run = false;
    if (kept.history) kept.history = parse_history(history_text(*kept.history, most_history));
    std::string const json = one_line(to_json(kept));
    if (json.size() <= most_attribute) put_words(header_attribute, json);
}

/// Whole slices of a layer of chunks, or some rows of one.
void Writer::flush() {
    auto const rows = static_cast<hsize_t>(held_.size() / row_);
    auto const height = static_cast<hsize_t>(header_.dims.y);
    auto const first = static_cast<hsize_t>(rows_);
    bool const slices = rows % height == 0 && first % height == 0;
    std::array<hsize_t, 3> const start{first / height, slices ? 0 : first % height, 0};
    std::array<hsize_t, 3> const count{slices ? rows / height : 1, slices ? height : rows,
                                       static_cast<hsize_t>(header_.dims.x)};
    Handle const memory(H5Screate_simple(3, count.data(), nullptr), H5Sclose);
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
    if (!begun_) throw Error(ErrorKind::data, "there is no volume to write");
    bool good = data_->reset();
    good = space_->reset() && good;
    good = type_->reset() && good;
    good = H5Fflush(*hdf5_, H5F_SCOPE_LOCAL) >= 0 && hdf5_->reset() && good;
    need(good, "the rest: is the disk full?");
    file_.commit();
}

} // namespace

std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<Writer>(path, options);
}

} // namespace vkt::hdf5
