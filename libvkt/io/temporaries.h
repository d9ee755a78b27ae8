// Temporary files that must not outlive the process: their names, and what to do about those of processes that died.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt {

/// "." for a name without a slash.
std::string directory_of(std::string const& path);

/// A hidden name beside `path` that no other process and no other call uses.
std::string temporary_name(std::string const& path);

/// What a path in a temporary directory will be called when that has its name; any other path is as it is.
std::string lasting_name(std::string const& path);

/// Remembers a temporary file until it is forgotten. Beyond 64 at a time it is not remembered, and only removed by its
/// owner. Returns the slot.
int remember_temporary(std::string const& path);
void forget_temporary(int slot);

/// Removes every remembered file, and directory with its files. Async-signal-safe: a program calls it from its handler
/// of fatal signals.
void remove_temporaries() noexcept;

/// Removes a directory and all below it, to a depth that no store of ours has. Symbolic links are not followed.
void remove_directory(std::string const& path) noexcept;

/// Marks an open temporary file or directory as belonging to a living process; the kernel takes the mark away when that
/// dies.
void mark_alive(int descriptor);

/// A process that removes a file, or a directory and what is in it, when this one dies, however it dies. It holds no
/// descriptor of ours, so that no reader of a pipe waits for it, and leads a session of its own, so that signals to our
/// group pass it by.
class Guard {
public:
    /// Returns when the guard stands. Without one, where no process can be had, work goes on.
    explicit Guard(std::string const& path);
    /// Dismisses it: the file is nobody's concern any more.
    ~Guard();
    Guard(Guard const&) = delete;
    Guard& operator=(Guard const&) = delete;

private:
    int socket_ = -1;
    int process_ = -1;
};

/// Removes what processes that were killed together with their guards left beside `path`: files and directories of this
/// user whose name temporary_name() made, of this or another path, as the check in it proves, and that no living
/// process has marked.
void remove_leftovers(std::string const& path);

} // namespace vkt
