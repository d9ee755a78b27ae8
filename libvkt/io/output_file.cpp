// Files that appear whole or not at all: unnamed until committed where the file system can, else under a temporary
// name.
// SPDX-License-Identifier: MIT
#include "libvkt/io/output_file.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/free_space.h"
#include "libvkt/io/shared_memory.h"
#include "libvkt/io/system_error.h"
#include "libvkt/io/temporaries.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt {

namespace {

std::string unnamed_link(int descriptor) { return text("/proc/self/fd/", descriptor); }

Error exists_already(std::string const& path) {
    if (is_segment(path))
        return Error(ErrorKind::io, text("cannot write '", path, "': the segment exists"),
                     text("replace it with --force, or free it: vkt shm remove ", path.substr(path.find(':') + 1)));
    return Error(ErrorKind::io, text("cannot write '", path, "': the file exists"), "overwrite it with --force");
}

/// Pipes, terminals and devices have no contents to protect: they are written in place.
bool written_in_place(struct stat const& status, bool force) {
    return S_ISFIFO(status.st_mode) || S_ISCHR(status.st_mode) || S_ISSOCK(status.st_mode) ||
           (S_ISBLK(status.st_mode) && force);
}

/// Gives `from` its final name unless that is taken; false if the file system has no way to link. `shown` is what the
/// user calls it.
bool link_without_overwriting(std::string const& from, std::string const& to, bool unnamed, std::string const& shown) {
    if (::linkat(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), unnamed ? AT_SYMLINK_FOLLOW : 0) == 0) return true;
    if (errno == EEXIST) throw exists_already(shown);
    if (unnamed || (errno != EPERM && errno != EOPNOTSUPP && errno != ENOSYS && errno != EMLINK))
        throw system_error(text("cannot write '", shown, "'"));
    return false;
}

/// What a chain of symbolic links leads to, which need not exist. Links that somebody else put where all may write are
/// refused, as Linux itself refuses to follow them (protected_symlinks).
std::string followed(std::string const& path) {
    std::string name = path;
    for (int links = 0; links < 40; ++links) {
        struct stat link {
        }, folder{};
        if (::lstat(name.c_str(), &link) != 0 || !S_ISLNK(link.st_mode)) {
            struct stat seen {};
            // Names below /proc lead to files that may have lost their own.
            if (links > 0 && ::stat(path.c_str(), &seen) == 0 &&
                (seen.st_dev != link.st_dev || seen.st_ino != link.st_ino))
                throw Error(ErrorKind::io, text("cannot write '", path, "': the file it leads to has no name"));
            return name;
        }
        bool const shared = ::stat(directory_of(name).c_str(), &folder) == 0 && (folder.st_mode & S_ISVTX) != 0 &&
                            (folder.st_mode & S_IWOTH) != 0;
        if (shared && link.st_uid != ::geteuid() && link.st_uid != folder.st_uid)
            throw Error(ErrorKind::io, text("cannot write '", path,
                                            "': it is a link that another user made in a folder "
                                            "where all may write"));
        std::error_code failure;
        std::string const to = std::filesystem::read_symlink(name, failure).string();
        if (failure) throw system_error(text("cannot write '", path, "'"), failure.value());
        name = to.starts_with('/') ? to : text(directory_of(name), "/", to);
    }
    throw system_error(text("cannot write '", path, "'"), ELOOP);
}

/// Whether the name is that of something to be written in place. Throws for names that are no file's or taken.
bool check_name(std::string const& path, bool force) {
    if (path.empty()) throw Error(ErrorKind::usage, "the name of the output file is empty");
    if (is_segment(path))
        throw Error(ErrorKind::usage, text("'", path, "': shared memory holds volumes and nothing else"),
                    text("a file of that name is ./", path));
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) return false;
    if (S_ISDIR(status.st_mode))
        throw Error(ErrorKind::io, text("cannot write '", path, "': it is a directory"), "name a file in it");
    if (written_in_place(status, force)) return true;
    if (!force) throw exists_already(path);
    return false;
}

/// Names below /dev/shm are anybody's: what has ours is replaced only if it is our own file.
void check_segment(std::string const& path, bool force) {
    struct stat status {};
    if (::lstat(segment_file(path).c_str(), &status) != 0) return;
    if (!S_ISREG(status.st_mode) || status.st_uid != ::geteuid())
        throw Error(ErrorKind::io, text("cannot write '", path, "': what has its name is not a segment of this user"));
    if (!force) throw exists_already(path);
}

Error unwritable(std::string const& path, int code) {
    return system_error(text("cannot write '", path, "'"), code,
                        code == ENOENT ? text("make the directory '", directory_of(path), "' first") : "");
}

} // namespace

void check_output(std::string const& path, bool force) {
    if (path == "-" || check_name(path, force)) return;
    if (::faccessat(AT_FDCWD, directory_of(followed(path)).c_str(), W_OK | X_OK, AT_EACCESS) != 0)
        throw unwritable(path, errno);
}

OutputFile::OutputFile(std::string const& path, bool force, OutputKind kind)
    : path_(lasting_name(path)), target_(path), force_(force), segment_(kind == OutputKind::segment),
      named_(kind == OutputKind::named_file) {
    if (segment_) {
        check_segment(path, force_);
        target_ = segment_file(path);
        open_temporary();
        return;
    }
    if (path == "-") {
        in_place_ = true;
        descriptor_ = ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
        if (descriptor_ < 0) throw system_error("cannot write standard output");
        return;
    }
    in_place_ = check_name(path, force_);
    if (!in_place_) {
        target_ = followed(path);
        open_temporary();
        return;
    }
    descriptor_ = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
    if (descriptor_ < 0) throw system_error(text("cannot write '", path_, "'"));
}

void OutputFile::open_temporary() {
    std::string const directory = directory_of(target_);
    // Nobody reads the new voxels who may not read the old ones, not even before the file has its name.
    struct stat old {};
    mode_t const mode = segment_ ? 0600 : ::stat(target_.c_str(), &old) == 0 ? old.st_mode & 0666 : 0666;
    if (!named_ && ::access("/proc/self/fd", X_OK) == 0)
        descriptor_ = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, mode);
    bool const unnamed = descriptor_ >= 0;
    if (segment_ && unnamed) (void)::fchmod(descriptor_, mode); // whatever the umask is
    // Of unnamed files only those that displace another are ever named besides.
    if (force_ || !unnamed) remove_leftovers(target_);
    if (unnamed) return mark_alive(descriptor_);
    // EISDIR and EOPNOTSUPP say that there are no unnamed files; whatever else is wrong will be wrong here as well.
    temporary_ = temporary_name(target_);
    guard_ = std::make_unique<Guard>(temporary_);
    descriptor_ = ::open(temporary_.c_str(), O_CREAT | O_EXCL | O_NOFOLLOW | O_RDWR | O_CLOEXEC, mode);
    if (descriptor_ < 0) throw unwritable(path_, errno);
    mark_alive(descriptor_);
    slot_ = remember_temporary(temporary_);
}

OutputFile::~OutputFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
    forget_temporary(slot_);
}

void OutputFile::write(void const* data, std::size_t n) {
    std::byte const* next = static_cast<std::byte const*>(data);
    while (n > 0) {
        ssize_t const done = ::write(descriptor_, next, std::min(n, std::size_t{1} << 30));
        if (done < 0) {
            if (errno == EINTR) continue;
            throw system_error(path_ == "-" ? "cannot write standard output" : text("cannot write '", path_, "'"));
        }
        next += done;
        n -= static_cast<std::size_t>(done);
    }
}

void OutputFile::write_at(std::int64_t position, void const* data, std::size_t n) {
    std::byte const* next = static_cast<std::byte const*>(data);
    while (n > 0) {
        ssize_t const done = ::pwrite(descriptor_, next, n, position);
        if (done < 0) {
            if (errno == EINTR) continue;
            throw system_error(text("cannot write '", path_, "'"));
        }
        next += done;
        position += done;
        n -= static_cast<std::size_t>(done);
    }
}

void OutputFile::expect(std::size_t bytes) const {
    require_space(descriptor_, bytes,
                  path_ == "-" ? "cannot write standard output" : text("cannot write '", path_, "'"));
}

void OutputFile::commit() {
    if (in_place_) {
        int const descriptor = std::exchange(descriptor_, -1);
        if (::close(descriptor) != 0) throw system_error(text("cannot write '", path_, "'"));
        return;
    }
    bool const unnamed = temporary_.empty();
    if (!unnamed) {
        // Network file systems tell about a full disk only here, so before the name is given away. The copy keeps the
        // mark.
        int const descriptor = std::exchange(descriptor_, ::fcntl(descriptor_, F_DUPFD_CLOEXEC, 3));
        if (::close(descriptor) != 0) throw system_error(text("cannot write '", path_, "'"));
    }
    std::string const from = unnamed ? unnamed_link(descriptor_) : temporary_;
    if (force_)
        replace(from, unnamed);
    else
        keep_existing(from, unnamed);
    if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
    if (!temporary_.empty()) {
        ::unlink(temporary_.c_str());
        temporary_.clear();
    }
}

void OutputFile::keep_existing(std::string const& from, bool unnamed) {
    if (link_without_overwriting(from, target_, unnamed, path_)) return;
    if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, target_.c_str(), RENAME_NOREPLACE) == 0) return;
    if (errno == EEXIST) throw exists_already(path_);
    if (errno != EINVAL && errno != ENOSYS) throw system_error(text("cannot write '", path_, "'"));
    // A file system with neither links nor exclusive renaming: look before renaming is the best there is.
    if (::access(target_.c_str(), F_OK) == 0) throw exists_already(path_);
    if (::rename(from.c_str(), target_.c_str()) != 0) throw system_error(text("cannot write '", path_, "'"));
}

/// Who may read and write the old file may do so with the new one, and nobody else.
void OutputFile::keep_mode() {
    struct stat old {
    }, now{};
    if (segment_ || ::stat(target_.c_str(), &old) != 0 || ::fstat(descriptor_, &now) != 0) return;
    mode_t mode = old.st_mode & 0777;
    bool const other_group = old.st_gid != now.st_gid;
    if ((old.st_uid != now.st_uid || other_group) && ::fchown(descriptor_, old.st_uid, old.st_gid) != 0 &&
        other_group && ::fchown(descriptor_, static_cast<uid_t>(-1), old.st_gid) != 0)
        mode = (mode & 0707) | (mode & mode << 3 & 070); // another group gets no more than everybody
    if ((now.st_mode & 0777) != mode && ::fchmod(descriptor_, mode) != 0 && (now.st_mode & 0777 & ~mode) != 0)
        throw system_error(text("cannot write '", path_, "': it cannot be given the mode of the file it replaces"));
}

/// In one step: an unnamed file takes a free name at once, and is named aside first where it has to displace another.
void OutputFile::replace(std::string const& from, bool unnamed) {
    keep_mode();
    std::string aside = temporary_;
    if (unnamed) {
        if (::linkat(AT_FDCWD, from.c_str(), AT_FDCWD, target_.c_str(), AT_SYMLINK_FOLLOW) == 0) return;
        if (errno != EEXIST) throw system_error(text("cannot write '", path_, "'"));
        aside = temporary_name(target_);
        slot_ = remember_temporary(aside);
        guard_ = std::make_unique<Guard>(aside);
        if (::linkat(AT_FDCWD, from.c_str(), AT_FDCWD, aside.c_str(), AT_SYMLINK_FOLLOW) != 0)
            throw system_error(text("cannot write '", path_, "'"));
    }
    if (::rename(aside.c_str(), target_.c_str()) == 0) return;
    int const reason = errno;
    ::unlink(aside.c_str());
    throw system_error(text("cannot write '", path_, "'"), reason);
}

} // namespace vkt
