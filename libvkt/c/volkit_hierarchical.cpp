// volkit's hierarchical volumes: bricks of cells of several widths.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstring>
#include <utility>

using namespace vkt;
using namespace vkt::volkit;

struct vktHierarchicalVolume_impl {
    Owned volume{}; ///< its bricks are in the order of their offsets
    std::vector<vktBrick_t> bricks{};
    Index3 lowest{}; ///< of all bricks: where the volume's grid begins
    vktDataFormat format = vktDataFormatUnspecified;
    float low = 0, high = 1;
    bool own = false; ///< nobody else can have the cells: they may be written where they lie
};

namespace {

constexpr unsigned coarsest = 30;

vktHierarchicalVolume needed_tree(vktHierarchicalVolume volume) {
    c::need(volume, "volume");
    return volume;
}

Index3 index_of(vktVec3i_t v) { return {v.x, v.y, v.z}; }

/// What stored integers stand for.
ValueMap mapping_of(vktDataFormat format, float low, float high) {
    vkt_description const d = description_of(made({1, 1, 1}, format, {1, 1, 1}, low, high)->volume.get());
    return {d.slope, d.intercept};
}

/// Bricks as the library has them: with dense cells in the order of the offsets, in a grid that begins at `lowest`.
std::vector<Brick> placed(std::vector<vktBrick_t> bricks, std::size_t cell_bytes, Index3& lowest) {
    std::stable_sort(bricks.begin(), bricks.end(),
                     [](vktBrick_t const& a, vktBrick_t const& b) { return a.offsetInBytes < b.offsetInBytes; });
    std::vector<Brick> result;
    std::size_t next = 0;
    lowest = index_of(bricks.front().lower);
    for (vktBrick_t const& brick : bricks) {
        Brick const one{index_of(brick.lower), index_of(brick.dims), static_cast<int>(std::min(brick.level, coarsest))};
        if (brick.level > coarsest || one.dims.x < 1 || one.dims.y < 1 || one.dims.z < 1)
            throw Error(ErrorKind::usage, text("a brick of ", one.dims, " cells of level ", std::int64_t{brick.level}));
        if (brick.offsetInBytes != next)
            throw Error(ErrorKind::usage,
                        text("the cells of a brick begin at byte ", std::uint64_t{brick.offsetInBytes},
                             ", those before it end at byte ", std::uint64_t{next}),
                        "offsets count the bytes of the bricks before, without gaps");
        next += static_cast<std::size_t>(one.cells()) * cell_bytes;
        for (int a = 0; a < 3; ++a) lowest[a] = std::min(lowest[a], one.lower[a]);
        result.push_back(one);
    }
    for (Brick& brick : result) brick.lower = brick.lower - lowest;
    return result;
}

/// Its cells, to be written.
std::uint8_t* writable(vktHierarchicalVolume volume) {
    Volume& now = volume->volume->volume;
    if (!volume->own) {
        Volume copy(now.header(), now.bricks());
        std::memcpy(copy.buffer().write(Space::host), now.buffer().read(Space::host), now.buffer().bytes());
        now = std::move(copy);
        volume->own = true;
    }
    return reinterpret_cast<std::uint8_t*>(now.buffer().update(Space::host));
}

void fill(vktHierarchicalVolume volume, std::vector<std::string> words) {
    volume->volume = applied(words, {volume->volume.get()});
    volume->own = false;
}

} // namespace

uint8_t vktHierarchicalVolumeGetMaxBytesPerVoxel(void) { return vktStructuredVolumeGetMaxBytesPerVoxel(); }

void vktHierarchicalVolumeCreate(vktHierarchicalVolume* volume, vktBrick_t* bricks, size_t numBricks,
                                 vktDataFormat dataFormat, float mappingLo, float mappingHi) {
    if (volume != nullptr) *volume = nullptr;
    volkit::attempt([&] {
        c::need(volume, "volume");
        c::need(bricks, "bricks");
        if (numBricks == 0) throw Error(ErrorKind::usage, "a hierarchical volume without bricks");
        auto made = std::make_unique<vktHierarchicalVolume_impl>();
        made->bricks.assign(bricks, bricks + numBricks);
        made->format = dataFormat;
        made->low = mappingLo;
        made->high = mappingHi;
        Header header;
        header.kind = Kind::hierarchical;
        header.dtype = parse_data_type(volkit::name_of(dataFormat));
        header.values = mapping_of(dataFormat, mappingLo, mappingHi);
        std::vector<Brick> own = placed(made->bricks, volkit::size_of(dataFormat), made->lowest);
        header.dims = {1, 1, 1};
        for (Brick const& brick : own)
            for (int a = 0; a < 3; ++a)
                header.dims[a] = std::max(header.dims[a], brick.lower[a] + brick.dims[a] * brick.cell_width());
        Volume cells(std::move(header), std::move(own));
        std::memset(cells.buffer().write(Space::host), 0, cells.buffer().bytes());
        made->volume.reset(c::wrapped(std::move(cells)));
        made->own = true;
        *volume = made.release();
    });
}
void vktHierarchicalVolumeCreateCopy(vktHierarchicalVolume* volume, vktHierarchicalVolume rhs) {
    if (volume != nullptr) *volume = nullptr;
    volkit::attempt([&] {
        c::need(volume, "volume");
        auto copy = std::make_unique<vktHierarchicalVolume_impl>();
        copy->volume.reset(
            c::wrapped(needed_tree(rhs)->volume->volume)); // of the same cells, until one of them is written
        copy->bricks = rhs->bricks;
        copy->lowest = rhs->lowest;
        copy->format = rhs->format;
        copy->low = rhs->low;
        copy->high = rhs->high;
        rhs->own = false;
        *volume = copy.release();
    });
}

void vktHierarchicalVolumeDestroy(vktHierarchicalVolume volume) { delete volume; }

vktVec3i_t vktHierarchicalVolumeGetDims3iv(vktHierarchicalVolume volume) {
    vktVec3i_t result{0, 0, 0};
    vktHierarchicalVolumeGetDims3i(volume, &result.x, &result.y, &result.z);
    return result;
}
void vktHierarchicalVolumeGetDims3i(vktHierarchicalVolume volume, int32_t* dimX, int32_t* dimY, int32_t* dimZ) {
    volkit::attempt([&] {
        Index3 const dims = dims_of(needed_tree(volume)->volume.get());
        if (dimX != nullptr) *dimX = static_cast<int32_t>(dims.x);
        if (dimY != nullptr) *dimY = static_cast<int32_t>(dims.y);
        if (dimZ != nullptr) *dimZ = static_cast<int32_t>(dims.z);
    });
}
size_t vktHierarchicalVolumeGetNumBricks(vktHierarchicalVolume volume) {
    return volume == nullptr ? 0 : volume->bricks.size();
}
vktBrick_t* vktHierarchicalVolumeGetBricks(vktHierarchicalVolume volume) {
    return volume == nullptr ? nullptr : volume->bricks.data();
}
vktDataFormat vktHierarchicalVolumeGetDataFormat(vktHierarchicalVolume volume) {
    return volume == nullptr ? vktDataFormatUnspecified : volume->format;
}

void vktHierarchicalVolumeSetVoxelMapping2f(vktHierarchicalVolume volume, float lo, float hi) {
    volkit::attempt([&] {
        needed_tree(volume)->volume->volume.header().values = mapping_of(volume->format, lo, hi);
        volume->low = lo;
        volume->high = hi;
    });
}
void vktHierarchicalVolumeGetVoxelMapping2f(vktHierarchicalVolume volume, float* lo, float* hi) {
    if (volume == nullptr) return;
    if (lo != nullptr) *lo = volume->low;
    if (hi != nullptr) *hi = volume->high;
}
void vktHierarchicalVolumeSetVoxelMapping2fv(vktHierarchicalVolume volume, vktVec2f_t mapping) {
    vktHierarchicalVolumeSetVoxelMapping2f(volume, mapping.x, mapping.y);
}
vktVec2f_t vktHierarchicalVolumeGetVoxelMapping2fv(vktHierarchicalVolume volume) {
    vktVec2f_t result{0, 0};
    vktHierarchicalVolumeGetVoxelMapping2f(volume, &result.x, &result.y);
    return result;
}

uint8_t* vktHierarchicalVolumeGetData(vktHierarchicalVolume volume) {
    std::uint8_t* data = nullptr;
    volkit::attempt([&] { data = writable(needed_tree(volume)); });
    return data;
}

vktError vktFillHV(vktHierarchicalVolume volume, float value) {
    return run("vktFillHV", [&] { fill(needed_tree(volume), {"fill", "--value=" + to_text(double{value})}); });
}
vktError vktFillRangeHV(vktHierarchicalVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX,
                        int32_t lastY, int32_t lastZ, float value) {
    return run("vktFillRangeHV", [&] {
        Box const asked = range(firstX, firstY, firstZ, lastX, lastY, lastZ);
        Index3 const lowest = needed_tree(volume)->lowest;
        Box const box = intersect({asked.lower - lowest, asked.upper - lowest}, box_of(dims_of(volume->volume.get())));
        if (!box.empty()) fill(volume, {"fill", "--value=" + to_text(double{value}), "--roi", region(box)});
    });
}
