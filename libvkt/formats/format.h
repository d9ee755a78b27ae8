// File formats: recognised by content first and by name second, opened as sources, created as sinks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Sequential bytes with look-ahead; random access where the file allows it. Opened once, never reopened, so FIFOs
/// work.
class ByteSource {
public:
    /// Takes ownership of the descriptor. `name` is used in messages and to find detached data files.
    ByteSource(int descriptor, std::string name);
    ~ByteSource();
    ByteSource(ByteSource const&) = delete;
    ByteSource& operator=(ByteSource const&) = delete;

    std::string const& name() const { return name_; }
    bool seekable() const { return size_ >= 0; }
    std::int64_t size() const { return size_; } ///< -1 when not seekable
    std::int64_t position() const { return position_; }
    int descriptor() const { return descriptor_; }

    /// Up to n bytes ahead without consuming them; fewer at the end of the file.
    std::span<std::byte const> peek(std::size_t n);
    /// Reads up to n bytes; 0 at the end. Retries EINTR and short reads.
    std::size_t read(void* to, std::size_t n);
    /// Reads exactly n bytes or throws Error{data} "ended early: … of …".
    void read_exactly(void* to, std::size_t n);
    /// One line without its end ("\n" or "\r\n"); nullopt at the end of the file. Lines over 1 MiB throw Error{data}.
    std::optional<std::string> read_line();
    /// Skips forward n bytes.
    void skip(std::int64_t n);
    /// Moves to an absolute position of a seekable file.
    void seek(std::int64_t position);
    /// Reads at an absolute position of a seekable file without moving; throws Error{data} if the file is too short.
    /// Threads share large reads of large files.
    void read_at(std::int64_t position, void* to, std::size_t n) const;
    /// Bytes already taken from the descriptor but not consumed, for those who go on with the descriptor alone.
    std::vector<std::byte> take_lookahead();

private:
    std::size_t read_together(std::int64_t position, std::byte* to, std::size_t n, int parts) const;
    std::size_t read_part(std::int64_t position, std::byte* to, std::size_t n) const;

    int descriptor_;
    std::string name_;
    std::int64_t size_ = -1;
    std::int64_t position_ = 0;
    int readers_ = 1; ///< threads that share a large read
    std::vector<std::byte> ahead_;
    std::size_t ahead_begin_ = 0;
};

/// Opens a path, or standard input for "-". Throws Error{io}.
std::unique_ptr<ByteSource> open_bytes(std::string const& path);

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
    bool trust_paths = false; ///< follow headers out of their directory, and to pipes and devices

    /// True if anything is said about what the file holds.
    bool describes() const;
};

struct WriteOptions {
    std::string format; ///< forces a format by name; empty: by the file's extension
    bool force = false; ///< overwrite an existing file
    bool compress = false;
    /// Sparse formats: voxels of this stored value are not kept; by default what the volume names as its background, or
    /// 0.
    std::optional<double> background{};
    /// Budget of formats that hold a volume until it is written; none: default_memory().
    std::optional<std::size_t> memory{};
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
};

std::vector<Format> const& formats();

/// Content first, name second. Throws Error{data} for unknown content with a hint what to say.
std::unique_ptr<Source> open_volume(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// The files that hold the voxels of a detached header, as far as it can be read: none for other files.
std::vector<std::string> detached_files(std::string const& path);
/// Name of the format that a file name promises by its extension; empty if it promises none.
std::string format_of_name(std::string const& name);
/// Name of the format that open_volume chooses. Throws the same.
std::string format_name(ByteSource& bytes, ReadOptions const& options);
/// A sink for a path ("-" is standard output), by forced format or extension. Refuses existing files without force.
std::unique_ptr<Sink> create_volume(std::string const& path, WriteOptions const& options);

/// Throws what OutputFile would for this name, Error{usage} or Error{io}; creates and opens nothing.
void check_output(std::string const& path, bool force);

class Guard;

/// A file that appears under its final name only when committed: written as ".NAME.vkt-PID-NONCE", O_EXCL | O_NOFOLLOW,
/// removed on destruction or death by signal, renamed on commit. Where the file system allows it the temporary has no
/// name at all (O_TMPFILE) until then; while it has one, another process stands by to remove it, so that kill -9 leaves
/// nothing either. What it replaces hands on its mode, and its owner and group where this process may give files away.
/// A symbolic link stays, and what it leads to is replaced; not one that somebody else made where all may write.
class OutputFile {
public:
    OutputFile(std::string path, bool force);
    ~OutputFile();
    OutputFile(OutputFile const&) = delete;
    OutputFile& operator=(OutputFile const&) = delete;

    int descriptor() const { return descriptor_; }
    std::string const& path() const { return path_; }
    /// Where it will lie: the path, or what it leads to if it is a symbolic link.
    std::string const& target() const { return target_; }
    /// Pipes, devices and standard output are written as they are: there is nothing to replace and nothing to seek in.
    bool in_place() const { return in_place_; }
    void write(void const* data, std::size_t n); ///< all of it, or Error{io} with the reason (disk full, …)
    void write_at(std::int64_t position, void const* data, std::size_t n); ///< not if in_place()
    void commit();

private:
    void open_temporary();
    void keep_existing(std::string const& from, bool unnamed);
    void replace(std::string const& from, bool unnamed);
    void keep_mode();

    std::string path_, target_;
    std::string temporary_; ///< empty for an unnamed file
    bool force_ = false;
    bool in_place_ = false;
    int descriptor_ = -1;
    int slot_ = -1; ///< where a temporary name is remembered for signal handlers
    std::unique_ptr<Guard> guard_;
};

} // namespace vkt
