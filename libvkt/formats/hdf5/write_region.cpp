// Writing a region of a dataset that is there: a copy of the file is changed, and takes its name when it is whole.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/hdf5/attributes.h"
#include "libvkt/formats/hdf5/chosen.h"
#include "libvkt/formats/hdf5/existing.h"
#include "libvkt/formats/hdf5/filters.h"
#include "libvkt/formats/hdf5/kept_header.h"
#include "libvkt/formats/hdf5/types.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/refusals.h"

#include <hdf5.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

namespace vkt::hdf5 {
namespace {

class RegionWriter : public VolumeWriter {
public:
    RegionWriter(std::string const& path, WriteOptions const& options)
        : options_(options), dataset_(part_to_write(path, "dataset", "/group/volume")),
          file_(file_part(path).file, options.force, OutputKind::named_file) {
        std::error_code failed;
        if (!std::filesystem::is_regular_file(file_.target(), failed))
            throw Error(ErrorKind::io, text("cannot open '", file_.path(), "': there is no such file to write into"),
                        "without --at it is made");
    }

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

private:
    [[noreturn]] void refuse(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::usage, text("'", file_.path(), ":", dataset_, "' ", what), hint);
    }
    void open(Header const& header);
    void check_storage() const;
    void check_volume(Header const& header) const;
    void flush();
    void tell_past();

    WriteOptions options_;
    std::string dataset_;
    OutputFile file_;
    std::optional<Datasets> all_;
    std::optional<ChosenDataset> chosen_;
    ParsedGrids grids_;
    Header part_; ///< of the volumes that come
    std::int64_t volumes_ = 0;
    std::size_t row_ = 0;
    std::int64_t depth_ = 1; ///< slices of a layer of chunks that are held at a time; none: some rows
    std::size_t most_ = 0;   ///< bytes that are held
    std::int64_t rows_ = 0;  ///< of this volume that were written
    std::vector<std::byte> held_;
};

void RegionWriter::begin(Header const& header) {
    refuse_bricks(header, "HDF5 datasets");
    if (volumes_ == 0) {
        open(header);
        part_ = header;
    }
    check_volume(header);
    ++volumes_;
    rows_ = 0;
    row_ = static_cast<std::size_t>(header.dims.x) * size_of(header.dtype);
    // Chunks are opened once where the budget has room for a layer of them.
    most_ = std::max(options_.memory.value_or(default_memory()) / 8, row_);
    std::size_t const slice = row_ * static_cast<std::size_t>(header.dims.y);
    depth_ = std::min(chosen_->chunk().z, static_cast<std::int64_t>(most_ / slice));
}

void RegionWriter::open(Header const& header) {
    std::optional<Handle> copy = copy_of_existing(file_, header.bytes());
    bool const taken = copy && is_taken(*copy, dataset_, file_);
    if (!taken)
        refuse("is not there, and a region is written into what is",
               text("make it first: vkt make constant --dims X Y Z -o ",
                    shell_quoted(text(file_.path(), ":", dataset_)), " --force"));
    register_filters();
    all_.emplace(file_.path(), std::move(*copy));
    all_->find_linked(dataset_); // refuses what is no dataset of numbers, and links to other files
    Dataset const& one = all_->all().front();
    grids_.header.dtype = one.type;
    grids_.header.attributes["variable"] = one.path;
    chosen_.emplace(*all_, one);
    check_storage();
    chosen_->find_axes(grids_);
    chosen_->read_about(grids_);
}

void RegionWriter::check_storage() const {
    hid_t const data = chosen_->data();
    Handle const creation(H5Dget_create_plist(data), H5Pclose), type(H5Dget_type(data), H5Tclose);
    if (H5Pget_external_count(creation) > 0 || H5Pget_layout(creation) == H5D_VIRTUAL)
        refuse("has its voxels in other files, in which nothing is changed");
    if (std::string const filter = absent_encoder(creation); !filter.empty())
        refuse(text("is compressed by ", filter, ", which is read and not written"),
               "with what is written: h5repack -f SHUF -f GZIP=4 in.h5 out.h5");
    bool const complex = complex_part(type).has_value();
    if (H5Tget_class(type) == H5T_ENUM || (!complex && !plain(type)))
        refuse("holds numbers of which not all bits count, or that have names", "write it as another dataset");
}

void RegionWriter::check_volume(Header const& header) const {
    Header const& whole = grids_.header;
    std::int64_t const volume = options_.at_volume + volumes_;
    if (volume >= grids_.volumes)
        refuse(
            text("has ", grids_.volumes, grids_.volumes == 1 ? " volume" : " volumes", ", and none of number ", volume),
            "they are counted from 0");
    Index3 const lower = *options_.at;
    if (Box const box{lower, lower + header.dims}; !box_of(whole.dims).contains(box))
        refuse(text("has ", whole.dims, " voxels, in which the part of ", header.dims, " at ", lower, " does not lie"),
               "cut it with 'vkt crop'");
    if (header.dtype != whole.dtype)
        refuse(text("is ", whole.dtype, ", and the part ", header.dtype), text("vkt convert --dtype ", whole.dtype));
    if (!(header.values == whole.values))
        refuse(text("holds values as ", whole.values.slope, " * stored + ", whole.values.intercept,
                    ", and the part as ", header.values.slope, " * stored + ", header.values.intercept),
               text("let 'vkt copy' convert them: vkt copy PART ", shell_quoted(text(file_.path(), ":", dataset_)),
                    " --at ... -o OUT"));
}

void RegionWriter::write(std::byte const* voxels, std::size_t n) {
    std::int64_t const height = part_.dims.y;
    while (n > 0) {
        // Up to where the next layer of chunks begins; of large slices some rows, which do not go on in the next slice.
        std::int64_t const slice = rows_ / height, done = rows_ % height;
        std::int64_t wanted = std::min(height - done, static_cast<std::int64_t>(most_ / row_));
        if (depth_ > 0) {
            std::int64_t const z = options_.at->z + slice, layer = depth_ - z % depth_;
            wanted = height * std::min(layer, part_.dims.z - slice);
        }
        std::size_t const full = static_cast<std::size_t>(wanted) * row_, count = std::min(n, full - held_.size());
        held_.insert(held_.end(), voxels, voxels + count);
        voxels += count;
        n -= count;
        if (held_.size() == full) flush();
    }
}

void RegionWriter::flush() {
    std::int64_t const height = part_.dims.y, rows = static_cast<std::int64_t>(held_.size() / row_);
    Index3 const lower = *options_.at + Index3{0, rows_ % height, rows_ / height};
    bool const slices = rows % height == 0;
    Box const box{lower, lower + Index3{part_.dims.x, slices ? height : rows, slices ? rows / height : 1}};
    if (!chosen_->write(options_.at_volume + volumes_ - 1, box, held_.data()))
        throw Error(ErrorKind::io,
                    text("cannot write '", file_.path(), "': HDF5 cannot store voxels: is the disk full?"));
    rows_ += rows;
    held_.clear();
}

/// Of a dataset that vkt wrote: how it came about now, and how exact it is.
void RegionWriter::tell_past() {
    Header whole = grids_.header;
    hid_t const data = chosen_->data();
    if (words(data, header_attribute).empty()) return;
    whole.attributes.erase("variable"); // as it is called in this file
    mark_as_given(whole);
    VolumeError error = whole.error.kind < part_.error.kind ? part_.error : whole.error;
    error.at_most = std::max(whole.error.at_most, part_.error.at_most);
    error.values.reset();
    if (whole.error.values && part_.error.values)
        error.values = whole.error.values->with(part_.error.values->low).with(part_.error.values->high);
    whole.error = error;
    // As that of the command that makes the same of two volumes; of one volume among several there is none.
    if (part_.history && whole.history && grids_.volumes == 1)
        whole.history = History{
            {"copy", "-", "<(…)", "--at", to_text(options_.at->x), to_text(options_.at->y), to_text(options_.at->z)},
            {*part_.history, *whole.history}};
    else
        whole.history.reset();
    if (H5Adelete(data, header_attribute) < 0 || !put_header(data, whole))
        throw Error(ErrorKind::io, text("cannot write '", file_.path(), "': HDF5 cannot store the header"));
}

void RegionWriter::close() {
    if (volumes_ == 0) throw Error(ErrorKind::data, "there is no volume to write");
    tell_past();
    bool const flushed = H5Fflush(all_->file(), H5F_SCOPE_GLOBAL) >= 0;
    chosen_.reset();
    all_.reset();
    if (!flushed)
        throw Error(ErrorKind::io,
                    text("cannot write '", file_.path(), "': HDF5 cannot store the rest: is the disk full?"));
    file_.commit();
}

} // namespace

std::unique_ptr<VolumeWriter> region_writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<RegionWriter>(path, options);
}

} // namespace vkt::hdf5
