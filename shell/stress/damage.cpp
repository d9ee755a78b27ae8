// Damage: of bytes, of the order of frames, and of what the header says.
// SPDX-License-Identifier: MIT
#include "shell/stress/damage.h"

#include "ipc/frame.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <sys/mman.h>
#include <unistd.h>

namespace vkt::shell {
namespace {

struct Frame {
    ipc::FrameHeader header;
    std::string payload;
};

std::span<std::byte const> bytes_in(std::string const& text) {
    return std::as_bytes(std::span(text.data(), text.size()));
}

std::vector<Frame> frames_of(std::string const& stream) {
    std::vector<Frame> frames;
    for (std::size_t at = ipc::magic.size(); at + sizeof(ipc::FrameHeader) <= stream.size();) {
        Frame& frame = frames.emplace_back();
        std::memcpy(&frame.header, stream.data() + at, sizeof frame.header);
        at += sizeof frame.header;
        frame.payload = stream.substr(at, frame.header.length);
        at += frame.header.length;
    }
    return frames;
}

std::string joined(std::vector<Frame> const& frames) {
    std::string stream(ipc::magic.data(), ipc::magic.size());
    for (auto const& frame : frames) {
        stream.append(reinterpret_cast<char const*>(&frame.header), sizeof frame.header);
        stream += frame.payload;
    }
    return stream;
}

/// Index of the frame that is a slab, counted from the first one; none if there are not so many.
std::optional<std::size_t> slab(std::vector<Frame> const& frames, std::size_t wanted) {
    for (std::size_t i = 0; i < frames.size(); ++i)
        if (frames[i].header.type == ipc::FrameType::slab && wanted-- == 0) return i;
    return std::nullopt;
}

std::optional<std::string> cut(std::string const& stream, double share) {
    return stream.substr(0, static_cast<std::size_t>(share * static_cast<double>(stream.size())));
}

std::string flipped(std::string stream, std::size_t at) {
    stream[at] = static_cast<char>(stream[at] ^ 16);
    return stream;
}

std::optional<std::string>
with_slabs(std::string const& stream,
           std::function<void(std::vector<Frame>&, std::size_t, std::size_t)> const& change) {
    auto frames = frames_of(stream);
    auto const first = slab(frames, 1), second = slab(frames, 2);
    if (!first || !second) return std::nullopt;
    change(frames, *first, *second);
    return joined(frames);
}

/// The header's line with this key says something else, under checksums that fit.
std::optional<std::string> with_header(std::string const& stream, std::string const& key, std::string const& value) {
    auto frames = frames_of(stream);
    Frame& head = frames.front();
    std::size_t const line = head.payload.find(text("\"", key, "\": ")), end = head.payload.find('\n', line);
    bool const comma = head.payload[end - 1] == ',';
    head.payload.replace(line, end - line, text("\"", key, "\": ", value, comma ? "," : ""));
    head.header.length = head.payload.size();
    head.header.checksum = ipc::hash(bytes_in(head.payload));
    head.header = ipc::sealed(head.header);
    return joined(frames);
}

/// What the header says after a key.
std::string said(std::string const& stream, std::string const& key) {
    std::string const head = frames_of(stream).front().payload;
    std::size_t const at = head.find(text("\"", key, "\": ")) + key.size() + 4, end = head.find('\n', at);
    return head.substr(at, end - at - (head[end - 1] == ',' ? 1 : 0));
}

/// As many slices more, or fewer.
std::optional<std::string> with_slices(std::string const& stream, std::int64_t more) {
    std::string const dims = said(stream, "dims");
    std::size_t const last = dims.rfind(',') + 1, end = dims.rfind(']');
    std::int64_t const slices = parse_integer(dims.substr(last, end - last)) + more;
    if (slices < 1) return std::nullopt;
    return with_header(stream, "dims", text(dims.substr(0, last), slices, "]"));
}

struct Damage {
    char const* name;
    std::function<std::optional<std::string>(std::string const&)> make;
};

std::vector<Damage> const& damages() {
    using Text = std::string;
    static std::vector<Damage> const list{
        {"cut-0%", [](Text const& s) { return cut(s, 0); }},
        {"cut-10%", [](Text const& s) { return cut(s, 0.1); }},
        {"cut-50%", [](Text const& s) { return cut(s, 0.5); }},
        {"cut-90%", [](Text const& s) { return cut(s, 0.9); }},
        {"cut-99.9%", [](Text const& s) { return cut(s, 0.999); }},
        {"bit-in-header", [](Text const& s) { return flipped(s, 80); }},
        {"bit-in-voxels",
         [](Text const& s) {
             auto frames = frames_of(s);
             auto const place = slab(frames, 1) ? slab(frames, 1) : slab(frames, 0);
             Frame& frame = frames[*place];
             frame.payload = flipped(frame.payload, sizeof(ipc::SlabHeader));
             return joined(frames);
         }},
        {"bit-in-end", [](Text const& s) { return flipped(s, s.size() - 10); }},
        {"slab-missing",
         [](Text const& s) {
             return with_slabs(s, [](auto& frames, std::size_t first, std::size_t) {
                 frames.erase(frames.begin() + static_cast<std::ptrdiff_t>(first));
             });
         }},
        {"slab-twice",
         [](Text const& s) {
             return with_slabs(s, [](auto& frames, std::size_t first, std::size_t) {
                 Frame const again = frames[first];
                 frames.insert(frames.begin() + static_cast<std::ptrdiff_t>(first), again);
             });
         }},
        {"slabs-swapped",
         [](Text const& s) {
             return with_slabs(s, [](auto& frames, std::size_t first, std::size_t second) {
                 std::swap(frames[first], frames[second]);
             });
         }},
        {"slab-of-another",
         [](Text const& s) {
             // A slab whose own checksums fit, with other voxels than those that the end counted.
             return with_slabs(s, [](auto& frames, std::size_t first, std::size_t) {
                 Frame& frame = frames[first];
                 frame.payload.back() = static_cast<char>(frame.payload.back() ^ 1);
                 std::string const head = frame.payload.substr(0, sizeof(ipc::SlabHeader));
                 std::string const voxels = frame.payload.substr(head.size());
                 frame.header.checksum = ipc::hash(bytes_in(voxels), ipc::hash(bytes_in(head)));
                 frame.header = ipc::sealed(frame.header);
             });
         }},
        {"more-slices", [](Text const& s) { return with_slices(s, 1); }},
        {"fewer-slices", [](Text const& s) { return with_slices(s, -1); }},
        {"dims-0", [](Text const& s) { return with_header(s, "dims", "[0,1,1]"); }},
        {"dims-huge",
         [](Text const& s) { return with_header(s, "dims", "[1000000000000,1000000000000,1000000000000]"); }},
        {"type-unknown", [](Text const& s) { return with_header(s, "dtype", "\"int128\""); }},
        {"type-wider",
         [](Text const& s) {
             return with_header(s, "dtype", said(s, "dtype").find("64") == Text::npos ? "\"float64\"" : "\"uint8\"");
         }},
        {"spacing-0", [](Text const& s) { return with_header(s, "spacing", "[1.0,0.0,1.0]"); }},
        {"spacing-negative", [](Text const& s) { return with_header(s, "spacing", "[1.0,-1.0,1.0]"); }},
        {"frame-flat",
         [](Text const& s) { return with_header(s, "direction", "[[1.0,0.0,0.0],[1.0,0.0,0.0],[0.0,0.0,1.0]]"); }},
        {"slope-0", [](Text const& s) { return with_header(s, "slope", "0.0"); }}};
    return list;
}

} // namespace

std::string stream_of(Volume const& volume) {
    int const memory = ::memfd_create("stream", MFD_CLOEXEC);
    if (memory < 0) throw Error(ErrorKind::resources, "no memory for a stream");
    struct Closed {
        int descriptor;
        ~Closed() { ::close(descriptor); }
    } const closed{memory};
    Execution execution;
    execution.slab = 1;
    {
        ipc::StreamSink sink(memory, {});
        auto const source = volume_source({volume});
        drain(*source, sink, execution);
    }
    std::string bytes(static_cast<std::size_t>(::lseek(memory, 0, SEEK_END)), '\0');
    if (::pread(memory, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
        throw Error(ErrorKind::io, "a stream in memory cannot be read");
    return bytes;
}

std::vector<std::string> damage_names() {
    std::vector<std::string> names;
    for (auto const& damage : damages()) names.emplace_back(damage.name);
    return names;
}

bool only_voxels(std::string const& name) { return name == "bit-in-voxels" || name == "slab-of-another"; }

std::optional<std::string> damaged(std::string const& stream, std::string const& name) {
    for (auto const& damage : damages())
        if (name == damage.name) return damage.make(stream);
    std::string const near = nearest_name(name, damage_names());
    throw Error(ErrorKind::usage, text("--damage: there is no '", name, "'"),
                near.empty() ? "vkt stress --list names them" : text("did you mean '", near, "'?"));
}

} // namespace vkt::shell
