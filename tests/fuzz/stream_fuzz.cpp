// Fuzzes the volume stream: raw bytes, or frames made from the input whose checksums hold, so that what is behind the
// checksums is reached too.
// SPDX-License-Identifier: MIT
#include "ipc/frame.h"
#include "ipc/stream.h"
#include "libvkt/engine/pipeline.h"
#include "tests/fuzz/volume_input.h"

#include <cstring>

namespace {

using vkt::ipc::FrameHeader;
using vkt::ipc::FrameType;

class Bytes {
public:
    Bytes(std::uint8_t const* data, std::size_t size) : data_(data), size_(size) {}
    bool empty() const { return size_ == 0; }
    std::uint8_t one() {
        if (empty()) return 0;
        --size_;
        return *data_++;
    }
    std::span<std::byte const> some(std::size_t n) {
        n = std::min(n, size_);
        std::span<std::byte const> const result(reinterpret_cast<std::byte const*>(data_), n);
        data_ += n;
        size_ -= n;
        return result;
    }

private:
    std::uint8_t const* data_;
    std::size_t size_;
};

void append(std::vector<std::uint8_t>& to, void const* data, std::size_t n) {
    auto const* bytes = static_cast<std::uint8_t const*>(data);
    to.insert(to.end(), bytes, bytes + n);
}

bool is_of_bricks(FrameType type) {
    return type == FrameType::bricks || type == FrameType::tree || type == FrameType::packed;
}

/// What a writer would say about the payload of a frame: the front part of slabs and bricks seeds the rest.
std::uint64_t payload_checksum(FrameType type, std::span<std::byte const> payload) {
    std::size_t const front = type == FrameType::slab ? sizeof(vkt::ipc::SlabHeader)
                              : is_of_bricks(type)    ? sizeof(vkt::ipc::BricksHeader)
                                                      : 0;
    if (front == 0 || payload.size() < front) return vkt::ipc::hash(payload);
    return vkt::ipc::hash(payload.subspan(front), vkt::ipc::hash(payload.first(front)));
}

/// Frames with the types, flags and lengths that the input asks for, sealed as a writer would. An END without a payload
/// gets the one that fits what came before.
std::vector<std::uint8_t> stream_from(Bytes input) {
    constexpr FrameType types[] = {FrameType::header, FrameType::slab, FrameType::bricks, FrameType::end,
                                   FrameType::error,  FrameType::tree, FrameType::packed};
    std::vector<std::uint8_t> stream;
    append(stream, vkt::ipc::magic.data(), vkt::ipc::magic.size());
    vkt::ipc::EndReport end;
    while (!input.empty() && stream.size() < 60000) {
        std::uint8_t const kind = input.one();
        FrameHeader frame;
        frame.type = kind % 8 < 7 ? types[kind % 8] : static_cast<FrameType>(kind);
        frame.flags = kind >> 4;
        if (kind & 8) append(stream, vkt::ipc::magic.data(), vkt::ipc::magic.size());
        std::size_t const low = input.one(), high = input.one();
        auto payload = input.some(low | (high & 3) << 8);
        std::string const fitting = to_json(end);
        if (frame.type == FrameType::end && payload.empty()) payload = std::as_bytes(std::span(fitting));
        // Now and then a length that is not that of the payload.
        frame.length = payload.size() + (high >= 250 ? high : 0);
        if (frame.flags & vkt::ipc::flag_checksum) frame.checksum = payload_checksum(frame.type, payload);
        std::size_t const front = frame.type == FrameType::slab     ? sizeof(vkt::ipc::SlabHeader)
                                  : frame.type == FrameType::bricks ? sizeof(vkt::ipc::BricksHeader)
                                                                    : payload.size();
        bool const counts = frame.type == FrameType::slab || is_of_bricks(frame.type);
        if (counts && payload.size() >= front) {
            ++end.frames;
            end.bytes += payload.size() - front;
            end.checksum = vkt::ipc::hash(std::as_bytes(std::span(&frame.checksum, 1)), end.checksum);
        }
        frame = vkt::ipc::sealed(frame);
        append(stream, &frame, sizeof frame);
        append(stream, payload.data(), payload.size());
        if (frame.type == FrameType::end) end = {};
    }
    return stream;
}

/// Every volume whole, as render takes it.
void load_all(vkt::ipc::StreamSource& source) {
    vkt::Execution execution;
    execution.memory = std::size_t{16} << 20;
    for (int i = 0; i < 4 && source.next_volume(); ++i) {
        if (source.header().kind == vkt::Kind::hierarchical && i % 2 == 1)
            source.take_bricks(); // the table alone
        else
            vkt::load(source, execution);
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    if (size == 0) return 0;
    std::vector<std::uint8_t> stream(data + 1, data + size);
    if (data[0] & 1) stream = stream_from(Bytes(data + 1, size - 1));
    try {
        int const descriptor = vkt::fuzz::descriptor_with(stream.data(), stream.size(), (data[0] & 2) != 0);
        vkt::ipc::StreamOptions options;
        options.whole = (data[0] & 4) != 0;
        vkt::ipc::StreamSource source(std::make_unique<vkt::ByteSource>(descriptor, "input"), options);
        if (options.whole)
            load_all(source);
        else
            vkt::fuzz::consume(source);
    } catch (vkt::Error const&) {
    } // the only thing that may come out of a reader
    return 0;
}
