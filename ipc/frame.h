// The frames of a volume stream, byte by byte as man/vkt-stream.5 describes them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt::ipc {

/// Every volume in a stream begins with these 8 bytes. The letters say what it is, the number is the version, and the
/// line ends reveal transfers that rewrite text.
inline constexpr std::array<char, 8> magic{'V', 'K', 'T', '1', '\r', '\n', '\x1a', '\n'};

enum class FrameType : std::uint32_t {
    header = 0x44414548, ///< "HEAD"
    slab = 0x42414c53,   ///< "SLAB"
    tree = 0x45455254,   ///< "TREE"
    packed = 0x4b434150, ///< "PACK"
    bricks = 0x4b495242, ///< "BRIK"
    end = 0x20444e45,    ///< "END "
    error = 0x20525245,  ///< "ERR "
};

inline constexpr std::uint32_t flag_required = 1; ///< a reader that does not know the type must refuse the stream
inline constexpr std::uint32_t flag_checksum = 2; ///< `checksum` holds the XXH3-64 of the payload
inline constexpr std::uint32_t flag_shared = 4;   ///< of BRIK: the cells lie in a slot of the ring of shared memory

inline constexpr std::uint32_t flag_rows = 8; ///< of SLAB: SlabRows follow its head, and only those are there

/// 32 bytes, little endian, before every payload.
struct FrameHeader {
    FrameType type = FrameType::end;
    std::uint32_t flags = 0;
    std::uint64_t length = 0;   ///< bytes of payload that follow
    std::uint64_t checksum = 0; ///< of the payload, if flagged; otherwise 0
    std::uint64_t self = 0;     ///< XXH3-64 of the 24 bytes before it
};
static_assert(sizeof(FrameHeader) == 32);

/// Where a slab's voxels are.
enum class Residence : std::uint32_t {
    here = 0,    ///< they follow in the pipe
    shared = 1,  ///< in a slot of the ring of shared memory that the side channel handed over
    segment = 2, ///< at their own place in a piece of shared memory that holds the whole volume
};

/// First 32 bytes of a SLAB payload; the voxels follow if their place is here.
struct SlabHeader {
    std::int64_t z_begin = 0, z_end = 0; ///< slices, half-open
    Residence place = Residence::here;
    std::uint32_t slot = 0;
    std::uint64_t bytes = 0; ///< of voxels
};
static_assert(sizeof(SlabHeader) == 32);

/// Of a slice too large to be sent at once, the rows that a slab has.
struct SlabRows {
    std::int64_t y_begin = 0, y_end = 0; ///< half-open
};
static_assert(sizeof(SlabRows) == 16);

/// The head of a SLAB payload as it lies before the voxels: 32 bytes, 48 with rows.
struct SlabHead {
    SlabHeader slab;
    SlabRows rows;
    std::span<std::byte const> bytes(bool with_rows) const {
        return std::as_bytes(std::span(this, 1)).first(with_rows ? sizeof(SlabHead) : sizeof(SlabHeader));
    }
};
static_assert(sizeof(SlabHead) == 48);

/// First 16 bytes of TREE, PACK and BRIK payloads. In TREE `count` BrickRecords follow, in PACK a PackingRecord and the
/// words of so many bricks, in BRIK their cells or the SharedCells that say where they lie.
struct BricksHeader {
    std::uint64_t first = 0; ///< index of the first brick in the volume
    std::uint64_t count = 0;
};
static_assert(sizeof(BricksHeader) == 16);

struct BrickRecord {
    std::int64_t lower[3] = {};
    std::int32_t dims[3] = {};
    std::int32_t level = 0;
};
static_assert(sizeof(BrickRecord) == 40);

struct SharedCells {
    std::uint32_t slot = 0, reserved = 0;
};
static_assert(sizeof(SharedCells) == 8);

/// A stage's row in the timing table that END carries.
struct StageReport {
    std::string stage;
    double wall = 0, cpu = 0, wait_in = 0, wait_out = 0; ///< seconds
    std::uint64_t bytes_in = 0, bytes_out = 0;
};

/// Payload of END, as JSON.
struct EndReport {
    std::uint64_t frames = 0;   ///< SLAB, TREE, PACK or BRIK frames of this volume
    std::uint64_t bytes = 0;    ///< of their voxels
    std::uint64_t checksum = 0; ///< XXH3-64 over the concatenated payload checksums; 0 if checksums are off
    std::vector<StageReport> stages;
};

/// Payload of ERR, as JSON.
struct ErrorReport {
    std::string stage, message;
    int code = 1;
};

std::uint64_t hash(std::span<std::byte const> data, std::uint64_t seed = 0);

/// The same hash of data that arrives in pieces.
class StreamHash {
public:
    explicit StreamHash(std::uint64_t seed);
    ~StreamHash();
    StreamHash(StreamHash const&) = delete;
    StreamHash& operator=(StreamHash const&) = delete;
    void add(std::span<std::byte const> data);
    std::uint64_t value() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Fills in `self`.
FrameHeader sealed(FrameHeader header);
/// True if the header's own checksum holds.
bool intact(FrameHeader const& header);

std::string to_json(EndReport const& report);
std::string to_json(ErrorReport const& report);
EndReport end_from_json(std::string_view json);     ///< throws Error{data}
ErrorReport error_from_json(std::string_view json); ///< throws Error{data}

} // namespace vkt::ipc
