// Two ends of one pipe within a test.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/text.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/pipeline.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>
#include <vector>

namespace vkt::test {

inline Volume patterned(Index3 dims, std::uint32_t seed) {
    Header header;
    header.dims = dims;
    header.dtype = DataType::uint32;
    Volume volume(header);
    auto* voxels = reinterpret_cast<std::uint32_t*>(volume.mutable_view().data);
    for (std::int64_t i = 0; i < header.voxels(); ++i) voxels[i] = static_cast<std::uint32_t>(i) * 2654435761u + seed;
    return volume;
}

struct Pipe {
    Pipe() {
        int ends[2];
        if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("pipe");
        read_end = ends[0];
        write_end = ends[1];
    }
    int read_end = -1, write_end = -1;
};

/// Writes the volumes into one end, in slabs of so many slices, and closes it.
inline void produce(int descriptor, ipc::Transport transport, std::vector<Volume> const& volumes, std::int64_t slab,
                    std::string* notice) {
    {
        ipc::StreamOptions options;
        options.transport = transport;
        options.notice = [&](std::string const& message) { *notice = message; };
        ipc::StreamSink sink(descriptor, options);
        Execution execution;
        execution.slab = slab;
        auto const source = volume_source(volumes);
        drain(*source, sink, execution);
    }
    ::close(descriptor);
}

inline std::vector<Volume> consume(Source& source) {
    std::vector<Volume> volumes;
    while (source.next_volume()) volumes.push_back(load(source, {}));
    return volumes;
}

/// What a program that is no vkt does between two stages; closes both ends.
inline void pass_bytes(int from, int to) {
    std::vector<char> buffer(100000);
    ssize_t n = 0;
    while ((n = ::read(from, buffer.data(), buffer.size())) > 0) {
        iovec part{buffer.data(), static_cast<std::size_t>(n)};
        ipc::write_all(to, std::span(&part, 1));
    }
    ::close(to);
    ::close(from);
}

/// Meets the writer of a pipe at its socket, as the reader would, says some words, and leaves.
inline void greet_and_leave(int read_end, std::array<std::uint32_t, 2> const& words) {
    struct stat status {};
    ASSERT_EQ(::fstat(read_end, &status), 0);
    std::string const name =
        text("vkt-", static_cast<std::uint64_t>(::getuid()), "-", static_cast<std::uint64_t>(status.st_dev), "-",
             static_cast<std::uint64_t>(status.st_ino));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data(), name.size());
    auto const length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    int const peer = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    for (int tries = 0; ::connect(peer, reinterpret_cast<sockaddr const*>(&address), length) != 0; ++tries) {
        ASSERT_LT(tries, 1000);
        ::usleep(1000);
    }
    EXPECT_EQ(::send(peer, words.data(), sizeof words, MSG_NOSIGNAL), static_cast<ssize_t>(sizeof words));
    ::usleep(50000); // the writer waits for the next word
    ::close(peer);
}

inline void expect_same(std::vector<Volume> const& a, std::vector<Volume> const& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        ASSERT_EQ(a[i].header().dims, b[i].header().dims);
        EXPECT_EQ(std::memcmp(a[i].view().data, b[i].view().data, a[i].header().bytes()), 0) << i;
    }
}

} // namespace vkt::test
