// Directories of files that appear under their final name only when all of their files are whole.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

namespace vkt {

class Guard;

/// A directory that appears under its final name only when committed: its files are written to ".NAME.vkt-PID-NONCE"
/// beside it, which goes with its files on destruction, death by signal and, by another process, kill -9. Commit
/// renames it in one step; a directory that it replaces, with force, is removed afterwards. It takes the place of an
/// empty directory without force.
class OutputDirectory {
public:
    /// `replaceable` says of a directory that is not empty whether it may be replaced with force, because it holds
    /// `what` and nothing else. Throws Error{io}.
    OutputDirectory(std::string path, bool force, std::function<bool(std::string const&)> const& replaceable,
                    std::string const& what = "bricks");
    ~OutputDirectory();
    OutputDirectory(OutputDirectory const&) = delete;
    OutputDirectory& operator=(OutputDirectory const&) = delete;

    std::string const& path() const { return path_; }
    /// Where files of this name are written to until then.
    std::string file(std::string const& name) const;
    /// Throws Error{io} if the file system has no room for so many bytes more.
    void expect(std::size_t bytes, std::string const& hint = {}) const;
    void commit();

private:
    std::string path_, temporary_;
    bool replaces_ = false;
    int descriptor_ = -1;
    int slot_ = -1; ///< where the temporary name is remembered for signal handlers
    std::unique_ptr<Guard> guard_;
};

} // namespace vkt
