// Shared memory: mappings, and the named segments of this user below /dev/shm, which outlive their writers.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Memory behind a descriptor, mapped for as long as this exists; the descriptor may be closed meanwhile.
class SharedMapping {
public:
    enum class Rights : std::uint8_t {
        read,
        write,
        copy_on_write, ///< what is changed here is seen by nobody else
    };
    /// Maps the first `bytes`, of which there must be that many. Throws Error{resources}.
    SharedMapping(int descriptor, std::size_t bytes, Rights rights);
    ~SharedMapping();
    SharedMapping(SharedMapping const&) = delete;
    SharedMapping& operator=(SharedMapping const&) = delete;

    std::byte* data() const;
    std::size_t bytes() const;

private:
    struct Region;
    std::unique_ptr<Region> region_;
};

/// Gives a file in memory its size and all of its pages, so that there is an error here and never a fault later. `name`
/// is for messages. Throws Error{resources}.
void allocate_segment(int descriptor, std::size_t bytes, std::string const& name);

/// Whether a name that stands where a file's may stand is that of a segment: "shm:NAME".
bool is_segment(std::string_view path);
/// Where the segment lies, /dev/shm/vkt.UID.NAME; any other path is left as it is. Throws Error{usage} for a NAME that
/// is not 1 to 200 letters, digits, '.', '_' and '-'.
std::string segment_file(std::string const& path);
/// Opens a segment of this user to read. Throws Error{usage} and Error{io}.
int open_segment(std::string const& path);
/// The segments of this user, "shm:NAME", in alphabetical order. What killed writers left is removed on the way.
std::vector<std::string> segments();
/// Frees the name; those who have mapped the segment keep it. Throws Error{usage} and Error{io}.
void remove_segment(std::string const& path);

} // namespace vkt
