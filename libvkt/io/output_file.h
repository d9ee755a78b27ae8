// Files that appear under their final name only when they are whole.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace vkt {

/// Throws what OutputFile would for this name, Error{usage} or Error{io}; creates and opens nothing.
void check_output(std::string const& path, bool force);

class Guard;

/// What an output may be: a file, which may have a name from the beginning, for libraries that open it by that; or
/// "shm:NAME", a segment of shared memory, which holds volumes and nothing else.
enum class OutputKind : std::uint8_t { file, named_file, segment };

/// A file that appears under its final name only when committed: written as ".NAME.vkt-PID-NONCE", O_EXCL | O_NOFOLLOW,
/// removed on destruction or death by signal, renamed on commit. Where the file system allows it the temporary has no
/// name at all (O_TMPFILE) until then; while it has one, another process stands by to remove it, so that kill -9 leaves
/// nothing either. What it replaces hands on its mode, and its owner and group where this process may give files away.
/// A symbolic link stays, and what it leads to is replaced; not one that somebody else made where all may write.
/// Segments are files in memory that are their owner's alone.
class OutputFile {
public:
    OutputFile(std::string const& path, bool force, OutputKind kind = OutputKind::file);
    ~OutputFile();
    OutputFile(OutputFile const&) = delete;
    OutputFile& operator=(OutputFile const&) = delete;

    int descriptor() const { return descriptor_; }
    /// What messages call it.
    std::string const& path() const { return path_; }
    /// Its name until it is committed; empty if it has none.
    std::string const& temporary() const { return temporary_; }
    /// Where it will lie: the path, or what it leads to if it is a symbolic link.
    std::string const& target() const { return target_; }
    /// Pipes, devices and standard output are written as they are: there is nothing to replace and nothing to seek in.
    bool in_place() const { return in_place_; }
    void write(void const* data, std::size_t n); ///< all of it, or Error{io} with the reason (disk full, …)
    void write_at(std::int64_t position, void const* data, std::size_t n); ///< not if in_place()
    /// Throws Error{io} if the file system has no room for so many bytes more.
    void expect(std::size_t bytes) const;
    void commit();

private:
    void open_temporary();
    void keep_existing(std::string const& from, bool unnamed);
    void replace(std::string const& from, bool unnamed);
    void keep_mode();

    std::string path_, target_;
    std::string temporary_; ///< empty for an unnamed file
    bool force_ = false;
    bool segment_ = false, named_ = false;
    bool in_place_ = false;
    int descriptor_ = -1;
    int slot_ = -1; ///< where a temporary name is remembered for signal handlers
    std::unique_ptr<Guard> guard_;
};

} // namespace vkt
