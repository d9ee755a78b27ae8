// File formats: recognised by content first and by name second, opened as sources, created as sinks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"
#include "libvkt/io/byte_source.h"
#include "libvkt/io/output_file.h"

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Takes a message of one line.
using Notice = std::function<void(std::string const&)>;

/// What the user says about a file that does not say it itself, and the part wanted.
struct ReadOptions {
    std::optional<Index3> dims;
    std::optional<DataType> dtype;
    std::int64_t skip = 0; ///< bytes before the first voxel
    std::optional<bool> big_endian;
    std::optional<Vec3> spacing;
    std::string format;   ///< forces a format by name; empty: detect
    std::string variable; ///< dataset or grid by name, for files that hold several
    /// Budget of foreign libraries that hold a file's tables or grids (libvkt/io/parser.h); none: default_memory().
    std::optional<std::size_t> memory;
    bool force_uniform = false; ///< DICOM: slices with gaps or on a slant as if they lay at equal distances
    /// DICOM: files whose images are read together, as if they were those of a folder; the first of them is opened.
    std::vector<std::string> together{};
    bool personal = false;    ///< DICOM: who was examined, when and where, too
    bool trust_paths = false; ///< follow headers out of their directory, and to pipes and devices
    std::string asked_by{};   ///< for hints: the command that reads, "vkt info", if it takes none of the above
    /// Told what is odd about a file and no error, in one line.
    Notice notice{};

    /// True if anything is said about what the file holds.
    bool describes() const;
};

enum class ChunkCodec : std::uint8_t { blosc, zstd, gzip };

/// How Zarr arrays are laid out.
struct ZarrLayout {
    int version = 2;             ///< 2 or 3
    std::optional<Index3> chunk; ///< voxels along each axis; none: 64
    std::optional<Index3> shard; ///< version 3: several chunks in a file, of about so many voxels along each axis
    std::optional<ChunkCodec> codec;
};

using HeldFiles = std::vector<std::unique_ptr<OutputFile>>;

struct WriteOptions {
    std::string format;    ///< forces a format by name; empty: by the file's extension
    bool force = false;    ///< overwrite an existing file
    bool one_file = false; ///< DICOM: a file whatever it is called, as the temporary one of NAME.dcm.gz is
    bool compress = false;
    std::int64_t files = 1; ///< slices in files of their own: this one and those to come
    /// Where a slice's file, once it is whole, waits for the others of its volume; whoever gave this commits them.
    std::shared_ptr<HeldFiles> held{};
    /// Sparse formats: voxels of this stored value are not kept; by default what the volume names as its background, or
    /// 0.
    std::optional<double> background{};
    /// Budget of formats that hold a volume until it is written, and of compression; none: default_memory().
    std::optional<std::size_t> memory{};
    std::optional<int> threads{}; ///< that compress; none: default_threads()
    bool pyramid = false;         ///< Zarr: coarser levels besides
    ZarrLayout zarr{};
    /// HDF5 and Zarr: into the dataset that is there, from this voxel on; the rest of it stays, and how it is stored.
    std::optional<Index3> at{};
    std::optional<std::int64_t> at_volume{}; ///< of several volumes of that dataset the one with which this begins
    /// Told once a file what of a volume its format does not hold, in one line.
    Notice notice{};
    /// The same of pictures, which are for the eye: no loss that anybody would refuse.
    Notice remark{};
    std::optional<double> prune{}; ///< sparse formats: nor are those this near it; nearly constant nodes become tiles
};

/// A reader and a writer behind a name. Either may be missing.
struct Format {
    std::string name; ///< "nrrd"
    std::string description;
    std::vector<std::string> extensions; ///< lower case with dot: ".nrrd", ".nhdr"
    /// True if the first bytes (up to 4 KiB) are this format's.
    bool (*recognise)(std::span<std::byte const> head) = nullptr;
    std::unique_ptr<Source> (*open)(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) = nullptr;
    std::unique_ptr<Sink> (*create)(std::string const& path, WriteOptions const& options) = nullptr;
    bool in_gzip = false; ///< files may be compressed as a whole: NAME.gz
    bool slices = false;  ///< a file holds a slice; several, NAME%04d or a folder, a volume
    bool planes = false;  ///< of such a file: it may hold several, which have names
};

std::vector<Format> const& formats();

/// Content first, name second. Throws Error{data} for unknown content with a hint what to say.
std::unique_ptr<Source> open_volume(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// The files that hold the voxels of a detached header, as far as it can be read: none for other files.
std::vector<std::string> detached_files(std::string const& path);
/// Name of the format that a file name promises by its extension; empty if it promises none.
std::string format_of_name(std::string const& name);
/// Whether files of this name, or of this format if one is named, hold a slice and no more.
bool holds_slices(std::string const& name, std::string const& format = {});
/// Name of the format that open_volume chooses. Throws the same.
std::string format_name(ByteSource& bytes, ReadOptions const& options);
/// A sink for a path ("-" is standard output), by forced format or extension. Refuses existing files without force.
std::unique_ptr<Sink> create_volume(std::string const& path, WriteOptions const& options);

} // namespace vkt
