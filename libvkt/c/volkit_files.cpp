// volkit's files and streams over vkt.h.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string>
#include <utility>

using namespace vkt;
using namespace vkt::volkit;

struct vktVolumeFile_impl {
    std::string path{};
    vktOpenMode mode = vktOpenModeRead;
    Owned volume{};      ///< what it holds, if it was opened to be read and can be
    size_t position = 0; ///< bytes of the voxels that were read or passed over
};
struct vktInputStream_impl {
    vktDataSource source;
};
struct vktOutputStream_impl {
    vktDataSource source;
};

namespace {

vktDataFormat format_of(char const* name) {
    for (int i = vktDataFormatUnspecified + 1; i < vktVoxelFormatCount; ++i)
        if (std::strcmp(name_of(static_cast<vktDataFormat>(i)), name) == 0) return static_cast<vktDataFormat>(i);
    return vktDataFormatUnspecified;
}

/// A file that voxels can be read from. Throws Failed.
vktVolumeFile_impl& readable(vktInputStream stream) {
    c::need(stream, "stream");
    vktVolumeFile_impl& file = *stream->source;
    if (file.mode == vktOpenModeWrite)
        fail(vktInvalidDataSource, Error(ErrorKind::usage, text("'", file.path, "' was opened for writing")));
    if (!file.volume) fail(vktReadError, Error(ErrorKind::io, text("'", file.path, "' could not be read")));
    return file;
}

struct Bytes {
    std::byte const* data = nullptr;
    size_t size = 0;
};

/// The voxels of a file as they are stored. Throws Failed.
Bytes stored(vktVolumeFile_impl const& file) {
    void const* voxels = nullptr;
    size_t bytes = 0;
    if (vkt_voxels(file.volume.get(), &voxels, &bytes) != VKT_OK) throw Failed{vktReadError};
    return {static_cast<std::byte const*>(voxels), bytes};
}

/// The next bytes of a file as rows of a region of a volume.
void read_next(vktVolumeFile_impl& file, vktStructuredVolume volume, Box const& region) {
    vkt_description const d = description_of(file.volume.get());
    if (format_of(d.dtype) != volume->format)
        throw Error(ErrorKind::usage, text("'", file.path, "' holds ", d.dtype,
                                           ", which are not read piece by piece into ", name_of(volume->format)));
    Box const all = whole(volume);
    if (!(intersect(region, all) == region))
        throw Error(ErrorKind::usage, text("the region ", region, " leaves the volume"));
    Bytes const from = stored(file);
    size_t const bytes = static_cast<size_t>(region.voxels()) * size_of(volume->format);
    if (file.position > from.size || from.size - file.position < bytes)
        fail(vktReadError, Error(ErrorKind::data, text("'", file.path, "' has ", from.size, " bytes of voxels, and ",
                                                       bytes, " from ", file.position, " on were asked for")));
    std::uint8_t* const to = writable(volume);
    size_t const row = static_cast<size_t>(region.dims().x) * size_of(volume->format);
    for (std::int64_t z = region.lower.z; z < region.upper.z; ++z)
        for (std::int64_t y = region.lower.y; y < region.upper.y; ++y) {
            std::int64_t const first = (z * all.upper.y + y) * all.upper.x + region.lower.x;
            std::memcpy(to + static_cast<size_t>(first) * size_of(volume->format), from.data + file.position, row);
            file.position += row;
        }
}

} // namespace

void vktVolumeFileCreateS(vktVolumeFile* file, char const* fileName, vktOpenMode om) {
    if (file != nullptr) *file = nullptr;
    volkit::attempt([&] {
        c::need(file, "file");
        c::need(fileName, "fileName");
        auto result = std::make_unique<vktVolumeFile_impl>();
        result->path = fileName;
        result->mode = om;
        vkt_volume* volume = nullptr;
        if (om != vktOpenModeWrite && vkt_read(fileName, nullptr, 0, &volume) == VKT_OK) result->volume.reset(volume);
        *file = result.release();
    });
}
vktDataSource vktVolumeFileGetBase(vktVolumeFile file) { return file; }
void vktVolumeFileDestroy(vktVolumeFile file) { delete file; }

vktVolumeFileHeader_t vktVolumeFileGetHeader(vktVolumeFile file) {
    vktVolumeFileHeader_t header{};
    volkit::attempt([&] {
        if (file == nullptr || !file->volume) return;
        vkt_description const d = description_of(file->volume.get());
        header.isStructured = d.hierarchical == 0 ? VKT_TRUE : VKT_FALSE;
        header.isHierarchical = d.hierarchical != 0 ? VKT_TRUE : VKT_FALSE;
        if (d.hierarchical != 0) return;
        header.dims = {static_cast<int>(d.dims[0]), static_cast<int>(d.dims[1]), static_cast<int>(d.dims[2])};
        header.dataFormat = format_of(d.dtype);
    });
    return header;
}
size_t vktVolumeFileRead(vktVolumeFile file, char* buf, size_t len) {
    size_t read = 0;
    volkit::attempt([&] {
        c::need(file, "file");
        c::need(buf, "buf");
        if (!file->volume) return;
        Bytes const from = stored(*file);
        read = std::min(len, from.size - file->position);
        std::memcpy(buf, from.data + file->position, read);
        file->position += read;
    });
    return read;
}
vktBool_t vktVolumeFileGood(vktVolumeFile file) { return file != nullptr && file->volume ? VKT_TRUE : VKT_FALSE; }

void vktRawFileCreateS(vktRawFile* file, char const* fileName, char const* mode) {
    bool const reads = mode != nullptr && *mode == 'r';
    bool const both = mode != nullptr && std::strchr(mode, '+') != nullptr;
    vktVolumeFileCreateS(file, fileName, both ? vktOpenModeReadWrite : reads ? vktOpenModeRead : vktOpenModeWrite);
}
vktDataSource vktRawFileGetBase(vktRawFile file) { return vktVolumeFileGetBase(file); }
void vktRawFileDestroy(vktRawFile file) { vktVolumeFileDestroy(file); }
size_t vktRawFileRead(vktRawFile file, char* buf, size_t len) { return vktVolumeFileRead(file, buf, len); }
vktBool_t vktRawFileGood(vktRawFile file) { return vktVolumeFileGood(file); }
vktVec3i_t vktRawFileGetDims3iv(vktRawFile file) { return vktVolumeFileGetHeader(file).dims; }
vktDataFormat vktRawFileGetDataFormat(vktRawFile file) { return vktVolumeFileGetHeader(file).dataFormat; }

void vktInputStreamCreate(vktInputStream* stream, vktDataSource source) {
    if (stream != nullptr) *stream = nullptr;
    volkit::attempt([&] {
        c::need(stream, "stream");
        c::need(source, "source");
        *stream = new vktInputStream_impl{source};
    });
}
void vktInputStreamDestroy(vktInputStream stream) { delete stream; }

vktError vktInputStreamReadSV(vktInputStream stream, vktStructuredVolume volume) {
    return run("vktInputStreamReadSV", [&] {
        needed(volume, "volume");
        vktVolumeFile_impl& file = readable(stream);
        if (file.position > 0) return read_next(file, volume, whole(volume));
        vkt_description d = description_of(file.volume.get());
        if (d.hierarchical != 0)
            throw Error(ErrorKind::usage, text("'", file.path, "' holds bricks"), "make a grid of it: vkt resample");
        if (format_of(d.dtype) != volume->format) return paste(volume, file.volume.get(), {});
        vkt_description const like = description_of(volume->volume.get());
        vkt_volume* mapped = nullptr;
        d.slope = like.slope;
        d.intercept = like.intercept;
        if (vkt_create(&d, stored(file).data, &mapped) != VKT_OK) throw Failed{vktReadError};
        Owned const owned(mapped);
        paste(volume, mapped, {});
    });
}

vktError vktInputStreamReadRangeSV(vktInputStream stream, vktStructuredVolume volume, int32_t firstX, int32_t firstY,
                                   int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ) {
    return run("vktInputStreamReadRangeSV", [&] {
        needed(volume, "volume");
        read_next(readable(stream), volume, range(firstX, firstY, firstZ, lastX, lastY, lastZ));
    });
}

vktError vktInputStreamSeek(vktInputStream stream, size_t pos) {
    return run("vktInputStreamSeek", [&] {
        vktVolumeFile_impl& file = readable(stream);
        size_t const bytes = stored(file).size;
        if (pos > bytes)
            throw Error(ErrorKind::usage, text("'", file.path, "' has ", bytes, " bytes of voxels, not ", pos));
        file.position = pos;
    });
}

void vktOutputStreamCreate(vktOutputStream* stream, vktDataSource source) {
    if (stream != nullptr) *stream = nullptr;
    volkit::attempt([&] {
        c::need(stream, "stream");
        c::need(source, "source");
        *stream = new vktOutputStream_impl{source};
    });
}
void vktOutputStreamDestroy(vktOutputStream stream) { delete stream; }

vktError vktOutputStreamWriteSV(vktOutputStream stream, vktStructuredVolume volume) {
    return run("vktOutputStreamWriteSV", [&] {
        needed(volume, "volume");
        c::need(stream, "stream");
        vktVolumeFile_impl const& file = *stream->source;
        if (file.mode == vktOpenModeRead)
            fail(vktInvalidDataSource, Error(ErrorKind::usage, text("'", file.path, "' was opened for reading")));
        char const* const force = "--force";
        if (vkt_write(volume->volume.get(), file.path.c_str(), &force, 1) != VKT_OK) throw Failed{vktWriteError};
    });
}
