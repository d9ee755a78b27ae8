// Bytes of a file or a pipe, read in order with look-ahead, and anywhere where the file allows it.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt {

/// Sequential bytes with look-ahead; random access where the file allows it. Opened once, never reopened, so FIFOs
/// work.
class ByteSource {
public:
    /// Takes ownership of the descriptor. `name` is used in messages and to find detached data files.
    ByteSource(int descriptor, std::string name);
    /// What other bytes stand for once decoded, in order: `next` gives up to n bytes, 0 at the end. Has no descriptor.
    ByteSource(std::string name, std::function<std::size_t(std::byte* to, std::size_t n)> next);
    ~ByteSource();
    ByteSource(ByteSource const&) = delete;
    ByteSource& operator=(ByteSource const&) = delete;

    std::string const& name() const { return name_; }
    bool seekable() const { return size_ >= 0; }
    std::int64_t size() const { return size_; } ///< -1 when not seekable
    std::int64_t position() const { return position_; }
    int descriptor() const { return descriptor_; }
    /// The end of the bytes is proof that they were decoded without damage, and worth reaching.
    bool decoded() const { return static_cast<bool>(next_); }
    /// A directory has no bytes: reading throws.
    bool directory() const { return directory_; }

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
    /// Threads that may well share a read of so many bytes: 1 of small files, and of what is no file.
    int threads_for(std::size_t n) const;
    /// Bytes already taken from the descriptor but not consumed, for those who go on with the descriptor alone.
    std::vector<std::byte> take_lookahead();

private:
    std::size_t read_some(std::byte* to, std::size_t n);
    std::size_t read_together(std::int64_t position, std::byte* to, std::size_t n, int parts) const;
    std::size_t read_part(std::int64_t position, std::byte* to, std::size_t n) const;

    int descriptor_;
    std::string name_;
    std::int64_t size_ = -1;
    bool directory_ = false;
    std::int64_t position_ = 0;
    int readers_ = 1; ///< threads that share a large read
    std::vector<std::byte> ahead_;
    std::size_t ahead_begin_ = 0;
    std::function<std::size_t(std::byte*, std::size_t)> next_; ///< instead of a descriptor
};

/// A name may mean a part of a file: FILE:/GROUP/DATASET (HDF5), FILE.npz:NAME.
struct FilePart {
    std::string file;
    std::string part; ///< "/GROUP/DATASET" or "NAME"; empty: the file
};
FilePart file_part(std::string const& path);

/// Opens a path, the file of a part of one, a segment of shared memory ("shm:NAME"), or standard input for "-". Throws
/// Error{io}.
std::unique_ptr<ByteSource> open_bytes(std::string const& path);

} // namespace vkt
