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
#include "libvkt/formats/region_write.h"

#include <hdf5.h>

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
    void plan(Header const& header) override {
        refuse_bricks(header, "HDF5 datasets");
        if (volumes_ == 0) open(existing(file_));
        check(header);
    }
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

private:
    [[noreturn]] void refuse(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::usage, text("'", file_.path(), ":", dataset_, "' ", what), hint);
    }
    void open(std::optional<Handle> file);
    void check(Header const& header);
    void check_storage() const;
    RegionTarget target() const { return {text(file_.path(), ":", dataset_), grids_.header, grids_.volumes}; }
    void tell_past();

    WriteOptions options_;
    std::string dataset_;
    OutputFile file_;
    std::optional<Datasets> all_;
    std::optional<ChosenDataset> chosen_;
    ParsedGrids grids_;
    Header part_;                           ///< of the volumes that come
    std::int64_t volumes_ = 0, number_ = 0; ///< number_: of the dataset's volume that is written to
    RegionLayers layers_;
};

void RegionWriter::begin(Header const& header) {
    refuse_bricks(header, "HDF5 datasets");
    if (volumes_ == 0) {
        open(copy_of_existing(file_, header.bytes()));
        part_ = header;
    }
    check(header);
    // Chunks are opened once where the budget has room for a layer of them.
    layers_.begin(header, *options_.at, chosen_->chunk().z, options_.memory.value_or(default_memory()) / 8);
}

void RegionWriter::check(Header const& header) {
    number_ = checked_volume(target(), header, options_, volumes_);
    ++volumes_;
}

/// `file`: to be changed, or only looked at.
void RegionWriter::open(std::optional<Handle> file) {
    bool const taken = file && is_taken(*file, dataset_, file_);
    if (!taken)
        refuse("is not there, and a region is written into what is",
               text("make it first: vkt make constant --dims X Y Z -o ",
                    shell_quoted(text(file_.path(), ":", dataset_)), " --force"));
    register_filters();
    all_.emplace(file_.path(), std::move(*file));
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

void RegionWriter::write(std::byte const* voxels, std::size_t n) {
    keep_quiet();
    layers_.add(voxels, n, [&](Box const& box, std::byte const* from) {
        if (!chosen_->write(number_, box, from))
            throw Error(ErrorKind::io,
                        text("cannot write '", file_.path(), "': HDF5 cannot store voxels: is the disk full?"));
    });
}

/// Of a dataset that vkt wrote: how it came about now, and how exact it is.
void RegionWriter::tell_past() {
    hid_t const data = chosen_->data();
    if (words(data, header_attribute).empty()) return;
    RegionTarget there = target();
    there.whole.attributes.erase("variable"); // as it is called in this file
    mark_as_given(there.whole);
    Header const whole = with_part(there, part_, *options_.at);
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
