// Requests.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/request.h"

#include "libvkt/core/error.h"
#include "libvkt/formats/region_source.h"
#include "libvkt/formats/stack.h"

#include <cmath>
#include <utility>

namespace vkt {
namespace {

/// Whole numbers of voxels, of which a chunk has less than 2 GiB.
Index3 voxels_of(Vec3 const& extents, char const* option) {
    Index3 result;
    for (int a = 0; a < 3; ++a) {
        if (!(extents[a] >= 1 && extents[a] <= 4096) || extents[a] != std::floor(extents[a]))
            throw Error(ErrorKind::usage, text(option, " ", extents, " is not 1 to 4096 voxels along each axis"));
        result[a] = static_cast<std::int64_t>(extents[a]);
    }
    return result;
}

} // namespace

void ReadRequest::declare(Parameters& p) {
    p.option("dims", options_.dims, "X Y Z", "raw: voxels along each axis");
    p.option("dtype", options_.dtype, "T", "raw: type of a voxel");
    p.option("skip", options_.skip, "N", "raw: bytes before the first voxel");
    p.option("endian", endian_, "E", "raw: byte order");
    p.option("spacing", options_.spacing, "S", "raw and PNG: distance of voxels, one number or X,Y,Z");
    p.option("format", options_.format, "F", "input format, if content and name do not tell it");
    p.option("variable", options_.variable, "NAME", "the variable or grid of a file that holds several");
    p.flag("force-uniform", options_.force_uniform, "DICOM: slices with gaps or on a slant all the same");
    p.flag("personal", options_.personal, "DICOM: keep who was examined, when and where, as attributes");
    p.option("roi", roi_, "R", "read only this region, X0:X1,Y0:Y1,Z0:Z1 in voxels; X0:X1:S is every S-th");
    p.option("roi-world", world_roi_, "R", "read only this region, in world units");
    p.option("index", index_, "N|A:B:S", "read only this volume of several, counted from 0, or every S-th from A to B");
}

void ReadRequest::declare_trust(Parameters& p, bool& trust_paths) {
    p.flag("trust-paths", trust_paths, "follow the names in detached headers to other directories, pipes and devices")
        .not_in_history(); // trust is the reader's, not the volume's
}

void ReadRequest::check() const {
    if (!roi_.empty() && !world_roi_.empty()) throw Error(ErrorKind::usage, "--roi and --roi-world exclude each other");
    if (options_.skip < 0) throw Error(ErrorKind::usage, text("--skip ", options_.skip, " is negative"));
    if (endian_ && !options_.format.empty() && options_.format != "raw")
        throw Error(ErrorKind::usage, text("--endian describes raw files, not ", options_.format));
}

ReadOptions ReadRequest::options() const {
    ReadOptions options = options_;
    if (!endian_) return options;
    options.big_endian = endian_ == Endian::big;
    return options;
}

std::unique_ptr<Source> ReadRequest::open(std::string const& path) const {
    return open_path(
        path, [options = options()](std::string const& one) { return open_volume(open_bytes(one), options); },
        options_.notice);
}

std::unique_ptr<Source> ReadRequest::region_of(std::unique_ptr<Source> source,
                                               std::function<void(SteppedBox const&)> on_region) const {
    if (index_) source = selected(std::move(source), *index_);
    return vkt::region_of(std::move(source), roi_, world_roi_, std::move(on_region));
}

void WriteRequest::declare(Parameters& p) {
    p.option("format", options_.format, "F", "output format, if the file name does not tell it");
    p.flag("compress", options_.compress, "compress, where the format can");
    p.option("background", background_, "VALUE",
             "OpenVDB: voxels of this stored value are left out (default: the volume's own background, or 0)");
    p.option("prune", options_.prune, "TOLERANCE",
             "OpenVDB: so are those this near to it; nodes that vary by no more become tiles");
    p.flag("pyramid", options_.pyramid, "Zarr: an OME-Zarr image, with coarser levels besides");
    p.option("zarr-version", options_.zarr.version, "N", "version of Zarr: 2 or 3 (OME-Zarr 0.4 or 0.5)");
    p.option("chunk", chunk_, "N", "Zarr: voxels of a chunk, one number or X,Y,Z (default 64)");
    p.option("shard", shard_, "N", "Zarr 3: voxels of a file of several chunks, one number or X,Y,Z");
    p.option("codec", options_.zarr.codec, "C", "Zarr: what compresses; --compress is blosc, or the best there is");
    p.option("at", options_.at, "X Y Z",
             "HDF5, Zarr: into the dataset that is there, beginning at this voxel; all else stays");
    p.option("index", index_, "N", "with --at: which of several volumes is written to, counted from 0");
    p.flag("force", options_.force, "overwrite an existing output file");
}

void WriteRequest::check(std::string const& path) const {
    std::string const format = options_.format.empty() ? format_of_name(path) : options_.format;
    bool const sparse = format == "vdb";
    if (options_.pyramid && format != "zarr")
        throw Error(ErrorKind::usage, "--pyramid is for Zarr", "e.g. vkt write out.zarr --pyramid");
    ZarrLayout const& zarr = options_.zarr;
    for (auto const& [given, name] : {std::pair{zarr.version != 2, "--zarr-version"},
                                      {chunk_.has_value(), "--chunk"},
                                      {shard_.has_value(), "--shard"},
                                      {zarr.codec.has_value(), "--codec"}})
        if (given && format != "zarr")
            throw Error(ErrorKind::usage, text(name, " is for Zarr"), text("e.g. vkt write out.zarr ", name));
    if (zarr.version != 2 && zarr.version != 3)
        throw Error(ErrorKind::usage, text("--zarr-version ", zarr.version, " is not 2 or 3"));
    if (shard_ && zarr.version != 3)
        throw Error(ErrorKind::usage, "--shard: version 2 of Zarr has no shards", "add --zarr-version 3");
    for (auto const& [extents, name] : {std::pair{chunk_, "--chunk"}, {shard_, "--shard"}})
        if (extents) voxels_of(*extents, name);
    if (shard_ && chunk_)
        for (int a = 0; a < 3; ++a)
            if ((*shard_)[a] < (*chunk_)[a])
                throw Error(ErrorKind::usage, text("--shard ", *shard_, " is smaller than --chunk ", *chunk_));
    if (index_ && !options_.at) throw Error(ErrorKind::usage, "--index goes with --at");
    if (index_ && *index_ < 0) throw Error(ErrorKind::usage, text("--index ", *index_, " is negative"));
    if (options_.at) check_region(path, format);
    if (!sparse && (background_ || options_.prune))
        throw Error(ErrorKind::usage, text(background_ ? "--background" : "--prune", " is for OpenVDB files"),
                    "e.g. vkt write out.vdb --prune 0.01");
    if (options_.prune && !(*options_.prune >= 0))
        throw Error(ErrorKind::usage, text("--prune ", *options_.prune, " is negative"));
}

/// A region is written into a dataset that is there, in its way of being stored.
void WriteRequest::check_region(std::string const& path, std::string const& format) const {
    if (format != "hdf5" && format != "zarr")
        throw Error(ErrorKind::usage, "--at is for HDF5 datasets and Zarr arrays",
                    text("write all of it again: vkt copy PART ", shell_quoted(path), " --at ... -o ",
                         shell_quoted(path), " --force"));
    if (format == "hdf5" && file_part(path).part.empty())
        throw Error(ErrorKind::usage, text("--at: '", path, "' names no dataset"),
                    text("e.g. vkt write part.nrrd ", shell_quoted(path + ":/data"), " --at 0,0,0 --force"));
    for (auto const& [given, name] : {std::pair{options_.compress, "--compress"},
                                      {options_.pyramid, "--pyramid"},
                                      {chunk_.has_value(), "--chunk"},
                                      {shard_.has_value(), "--shard"},
                                      {options_.zarr.codec.has_value(), "--codec"},
                                      {options_.zarr.version != 2, "--zarr-version"}})
        if (given)
            throw Error(ErrorKind::usage, text("--at: the dataset stays stored as it was, and compressed as it was"),
                        text("leave out ", name));
    if (!options_.force)
        throw Error(ErrorKind::io, text("'", path, "' is changed only with --force"),
                    "all of it but these voxels stays");
}

WriteOptions WriteRequest::options() const {
    WriteOptions options = options_;
    options.at_volume = index_;
    options.background = background_;
    if (chunk_) options.zarr.chunk = voxels_of(*chunk_, "--chunk");
    if (shard_) options.zarr.shard = voxels_of(*shard_, "--shard");
    return options;
}

} // namespace vkt
