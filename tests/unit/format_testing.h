// Helpers of the format tests: scratch directories, files in memory, whole and partial reads, volumes of noise.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace vkt::testing {

using Bytes = std::vector<std::byte>;

/// A directory that vanishes with the object.
class Scratch {
public:
    Scratch() {
        std::string name = (std::filesystem::temp_directory_path() / "vkt-test-XXXXXX").string();
        if (!::mkdtemp(name.data())) throw std::runtime_error("mkdtemp");
        path_ = name;
    }
    ~Scratch() { std::filesystem::remove_all(path_); }
    Scratch(Scratch const&) = delete;
    Scratch& operator=(Scratch const&) = delete;

    std::string operator/(std::string const& name) const { return (path_ / name).string(); }
    std::string path() const { return path_.string(); }
    /// Names of everything in it, hidden files included.
    std::size_t files() const {
        return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
    }

private:
    std::filesystem::path path_;
};

inline Bytes bytes_of(std::string const& s) {
    auto const* data = reinterpret_cast<std::byte const*>(s.data());
    return {data, data + s.size()};
}

inline void put_file(std::string const& path, std::string const& contents) {
    std::ofstream(path, std::ios::binary) << contents;
}

inline std::string get_file(std::string const& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

/// A seekable byte source over a copy of `contents`.
inline std::unique_ptr<ByteSource> memory_file(std::string const& contents, std::string name = "memory") {
    int const descriptor = ::memfd_create("vkt-test", MFD_CLOEXEC);
    if (::write(descriptor, contents.data(), contents.size()) != static_cast<ssize_t>(contents.size()))
        throw std::runtime_error("memfd");
    ::lseek(descriptor, 0, SEEK_SET);
    return std::make_unique<ByteSource>(descriptor, std::move(name));
}

/// A byte source over a pipe; the contents must fit into its buffer.
inline std::unique_ptr<ByteSource> pipe_file(std::string const& contents, std::string name = "pipe") {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("pipe");
    ::fcntl(ends[1], F_SETPIPE_SZ, 1 << 20);
    if (::write(ends[1], contents.data(), contents.size()) != static_cast<ssize_t>(contents.size()))
        throw std::runtime_error("pipe");
    ::close(ends[1]);
    return std::make_unique<ByteSource>(ends[0], std::move(name));
}

inline Bytes read_box(Source& source, Box const& box) {
    DataType const type = source.header().dtype;
    Bytes bytes(static_cast<std::size_t>(box.voxels()) * size_of(type));
    source.read(dense_view(bytes.data(), type, box));
    return bytes;
}

/// The current volume, in slabs of `height` slices.
inline Bytes read_volume(Source& source, std::int64_t height = 1000000) {
    Index3 const dims = source.header().dims;
    Bytes all;
    for (std::int64_t z = 0; z < dims.z; z += height) {
        Bytes const slab = read_box(source, {{0, 0, z}, {dims.x, dims.y, std::min(dims.z, z + height)}});
        all.insert(all.end(), slab.begin(), slab.end());
    }
    source.finish();
    return all;
}

inline Bytes cut(Bytes const& volume, Index3 dims, DataType type, Box const& box) {
    Bytes part(static_cast<std::size_t>(box.voxels()) * size_of(type));
    copy(dense_view(volume.data(), type, box_of(dims)).part(box), dense_view(part.data(), type, box));
    return part;
}

inline Bytes noise(std::size_t n, unsigned seed) {
    std::mt19937 random(seed);
    Bytes bytes(n);
    for (auto& b : bytes) b = static_cast<std::byte>(random() & 0x3f);
    return bytes;
}

inline Box random_box(Index3 dims, std::mt19937& random) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        auto const any = [&](std::int64_t lowest, std::int64_t highest) {
            return std::uniform_int_distribution<std::int64_t>(lowest, highest)(random);
        };
        box.lower[axis] = any(0, dims[axis] - 1);
        box.upper[axis] = any(box.lower[axis] + 1, dims[axis]);
    }
    return box;
}

/// Every region equals the same part of the whole; forward sources are opened anew for each.
inline void expect_regions(std::function<std::unique_ptr<Source>()> const& open, Bytes const& whole, int boxes = 60) {
    std::mt19937 random(7);
    std::unique_ptr<Source> source;
    for (int i = 0; i < boxes; ++i) {
        if (!source || source->access() == Access::forward) {
            source = open();
            ASSERT_TRUE(source->next_volume());
        }
        Header const& header = source->header();
        Box const box = random_box(header.dims, random);
        ASSERT_EQ(read_box(*source, box), cut(whole, header.dims, header.dtype, box)) << text(box);
    }
}

/// Runs `body` and returns the kind and message of the Error that it throws, or an empty message.
struct Caught {
    ErrorKind kind = ErrorKind::failure;
    std::string message, hint;
};
inline Caught caught(std::function<void()> const& body) {
    try {
        body();
    } catch (Error const& e) {
        return {e.kind(), e.what(), e.hint()};
    }
    return {};
}

/// Writes volumes through the public interface, in slabs of `height`.
inline void write_volumes(std::string const& path, std::vector<Header> const& headers,
                          std::vector<Bytes> const& volumes, WriteOptions const& options = {},
                          std::int64_t height = 3) {
    auto const sink = create_volume(path, options);
    for (std::size_t i = 0; i < headers.size(); ++i) {
        Index3 const dims = headers[i].dims;
        auto const whole = dense_view(volumes[i].data(), headers[i].dtype, box_of(dims));
        sink->begin(headers[i]);
        for (std::int64_t z = 0; z < dims.z; z += height) {
            Box const slab{{0, 0, z}, {dims.x, dims.y, std::min(dims.z, z + height)}};
            copy(whole.part(slab), sink->acquire(slab));
            sink->commit();
        }
        sink->end();
    }
    sink->close();
}

} // namespace vkt::testing
