// Shared memory. The only place with Boost.Interprocess.
// SPDX-License-Identifier: MIT
#include "libvkt/io/shared_memory.h"

#include "libvkt/core/cgroup.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/system_error.h"
#include "libvkt/io/temporaries.h"

#include <algorithm>
#include <boost/interprocess/mapped_region.hpp>
#include <cerrno>
#include <fstream>
#include <limits>

#include <dirent.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

namespace vkt {
namespace {

constexpr std::string_view scheme = "shm:";
constexpr char const* folder = "/dev/shm/"; // of shm_open(3)
constexpr std::size_t longest_name = 200;

/// What Boost.Interprocess needs to map a descriptor that we already hold.
class Mappable {
public:
    explicit Mappable(int descriptor) : descriptor_(descriptor) {}
    boost::interprocess::mapping_handle_t get_mapping_handle() const { return {descriptor_, false}; }

private:
    int descriptor_;
};

/// What the files of this user's segments begin with; no two users share a name.
std::string user_prefix() { return text("vkt.", static_cast<std::uint64_t>(::geteuid()), "."); }

/// The name that shm_open(3) takes.
std::string posix_name(std::string const& path) {
    constexpr std::string_view allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
    std::string const name = path.substr(scheme.size());
    if (name.empty() || name.size() > longest_name || name.find_first_not_of(allowed) != std::string::npos)
        throw Error(ErrorKind::usage,
                    text("'", path, "': names of segments are 1 to ", static_cast<std::uint64_t>(longest_name),
                         " letters, digits, '.', '_' and '-'"));
    return text("/", user_prefix(), name);
}

/// Bytes that the machine could give without taking them from other processes.
std::size_t memory_left() {
    std::size_t left = cgroup_memory_left();
    std::ifstream file("/proc/meminfo");
    std::string word;
    std::size_t kibibytes = 0;
    while (file >> word)
        if (word == "MemAvailable:" && file >> kibibytes) return std::min(left, kibibytes << 10);
    return left;
}

Error no_room(std::string const& name, std::size_t bytes, std::string const& why) {
    return Error(
        ErrorKind::resources,
        text("cannot have ", bytes_text(static_cast<double>(bytes)), " of shared memory for '", name, "': ", why),
        "'vkt shm list' shows the segments there are, 'vkt shm remove' frees them");
}

} // namespace

struct SharedMapping::Region {
    boost::interprocess::mapped_region region;
};

SharedMapping::SharedMapping(int descriptor, std::size_t bytes, Rights rights) {
    using namespace boost::interprocess;
    auto const mode = rights == Rights::read ? read_only : rights == Rights::write ? read_write : copy_on_write;
    try {
        region_.reset(new Region{mapped_region(Mappable(descriptor), mode, 0, bytes)});
    } catch (interprocess_exception const& e) {
        throw Error(ErrorKind::resources, text("cannot map shared memory: ", e.what()));
    }
}

SharedMapping::~SharedMapping() = default;
std::byte* SharedMapping::data() const { return static_cast<std::byte*>(region_->region.get_address()); }
std::size_t SharedMapping::bytes() const { return region_->region.get_size(); }

void allocate_segment(int descriptor, std::size_t bytes, std::string const& name) {
    struct statvfs room {};
    std::size_t left = memory_left();
    if (::fstatvfs(descriptor, &room) == 0 && room.f_blocks > 0) left = std::min(left, room.f_bavail * room.f_frsize);
    // Asked for more than there is, the kernel kills processes at random.
    if (bytes > left) throw no_room(name, bytes, text(bytes_text(static_cast<double>(left)), " are left"));
    int failure = 0;
    do {
        failure = ::posix_fallocate(descriptor, 0, static_cast<off_t>(bytes));
    } while (failure == EINTR);
    if (failure != 0) throw no_room(name, bytes, std::generic_category().message(failure));
}

bool is_segment(std::string_view path) { return path.starts_with(scheme); }

std::string segment_file(std::string const& path) {
    return is_segment(path) ? folder + posix_name(path).substr(1) : path;
}

int open_segment(std::string const& path) {
    int const descriptor = ::shm_open(posix_name(path).c_str(), O_RDONLY, 0);
    if (descriptor < 0 && errno == ENOENT)
        throw Error(ErrorKind::io, text("cannot open '", path, "': there is no such segment"),
                    "'vkt shm list' shows those there are");
    if (descriptor < 0) throw system_error(text("cannot open '", path, "'"));
    struct stat status {};
    if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == ::geteuid()) return descriptor;
    ::close(descriptor);
    throw Error(ErrorKind::io, text("cannot open '", path, "': it is not a segment of this user"));
}

std::vector<std::string> segments() {
    std::vector<std::string> names;
    std::string const prefix = user_prefix();
    std::unique_ptr<DIR, int (*)(DIR*)> const listing(::opendir(folder), ::closedir);
    while (dirent const* const entry = listing ? ::readdir(listing.get()) : nullptr) {
        std::string const file = entry->d_name;
        if (file.starts_with(prefix)) {
            names.push_back(text(scheme, file.substr(prefix.size())));
        } else if (file.starts_with("." + prefix)) {
            if (auto const end = file.rfind(".vkt-"); end != std::string::npos)
                remove_leftovers(folder + file.substr(1, end - 1));
        }
    }
    std::sort(names.begin(), names.end());
    return names;
}

void remove_segment(std::string const& path) {
    if (::shm_unlink(posix_name(path).c_str()) == 0) return;
    if (errno == ENOENT)
        throw Error(ErrorKind::io, text("there is no segment '", path, "'"), "'vkt shm list' shows those there are");
    throw system_error(text("cannot remove '", path, "'"));
}

} // namespace vkt
