// volkit's files and streams over vkt.h.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cstring>
#include <string>
#include <utility>

using namespace vkt;
using namespace vkt::volkit;

struct vktVolumeFile_impl {
    std::string path{};
    vktOpenMode mode = vktOpenModeRead;
    Owned volume{}; ///< what it holds, if it was opened to be read and can be
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
vktBool_t vktVolumeFileGood(vktVolumeFile file) { return file != nullptr && file->volume ? VKT_TRUE : VKT_FALSE; }

void vktRawFileCreateS(vktRawFile* file, char const* fileName, char const* mode) {
    bool const reads = mode != nullptr && *mode == 'r';
    bool const both = mode != nullptr && std::strchr(mode, '+') != nullptr;
    vktVolumeFileCreateS(file, fileName, both ? vktOpenModeReadWrite : reads ? vktOpenModeRead : vktOpenModeWrite);
}
vktDataSource vktRawFileGetBase(vktRawFile file) { return vktVolumeFileGetBase(file); }
void vktRawFileDestroy(vktRawFile file) { vktVolumeFileDestroy(file); }
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
        c::need(stream, "stream");
        vktVolumeFile_impl const& file = *stream->source;
        if (file.mode == vktOpenModeWrite) throw Failed{vktInvalidDataSource};
        if (!file.volume) throw Failed{vktReadError};
        vkt_description d = description_of(file.volume.get());
        if (d.hierarchical != 0)
            throw Error(ErrorKind::usage, text("'", file.path, "' holds bricks"), "make a grid of it: vkt resample");
        if (format_of(d.dtype) != volume->format) return paste(volume, file.volume.get(), {});
        vkt_description const like = description_of(volume->volume.get());
        void const* voxels = nullptr;
        vkt_volume* stored = nullptr;
        d.slope = like.slope;
        d.intercept = like.intercept;
        if (vkt_voxels(file.volume.get(), &voxels, nullptr) != VKT_OK || vkt_create(&d, voxels, &stored) != VKT_OK)
            throw Failed{vktReadError};
        Owned const owned(stored);
        paste(volume, stored, {});
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
        if (file.mode == vktOpenModeRead) throw Failed{vktInvalidDataSource};
        char const* const force = "--force";
        if (vkt_write(volume->volume.get(), file.path.c_str(), &force, 1) != VKT_OK) throw Failed{vktWriteError};
    });
}
