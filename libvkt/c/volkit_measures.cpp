// volkit's aggregates, histograms and bricks as words for vkt_measure() and vkt_apply().
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

using namespace vkt;
using namespace vkt::volkit;

struct vktHistogram_impl {
    std::vector<size_t> counts;
};

struct vktArray3D_vktStructuredVolume_impl {
    vktVec3i_t dims{0, 0, 0};
    std::vector<vktStructuredVolume> volumes{};
};

namespace {

float number(nlohmann::json const& json) {
    return json.is_number() ? static_cast<float>(json.get<double>()) : std::numeric_limits<float>::quiet_NaN();
}

vktVec3i_t place(nlohmann::json const& json) {
    return json.is_array() ? vktVec3i_t{json[0].get<int>(), json[1].get<int>(), json[2].get<int>()}
                           : vktVec3i_t{-1, -1, -1};
}

void aggregate(vktStructuredVolume volume, vktAggregates_t* aggregates, Box const& box) {
    needed(volume, "volume");
    c::need(aggregates, "aggregates");
    Box const there = within(box, volume);
    if (there.empty()) throw Error(ErrorKind::usage, "the region has no voxels of the volume");
    auto const json = nlohmann::json::parse(measured({"stats", "-", "--roi", region(there)}, volume->volume.get()));
    vktAggregates_t found{};
    found.min = number(json["min"]);
    found.max = number(json["max"]);
    found.mean = number(json["mean"]);
    found.stddev = number(json["stddev"]);
    found.var = number(json["variance"]);
    found.sum = number(json["sum"]);
    found.prod = number(json["product"]);
    found.argmin = place(json["argmin"]);
    found.argmax = place(json["argmax"]);
    *aggregates = found;
}

void count(vktStructuredVolume volume, vktHistogram histogram, Box const& box) {
    needed(volume, "volume");
    c::need(histogram, "histogram");
    Box const there = within(box, volume);
    std::vector<size_t> counts(histogram->counts.size());
    if (!there.empty()) {
        auto const json = nlohmann::json::parse(
            measured({"histogram", "-", text("--bins=", static_cast<std::uint64_t>(counts.size())),
                      "--range=" + text(double{volume->low}, ":", double{volume->high}), "--roi", region(there)},
                     volume->volume.get()));
        counts = json["counts"].get<std::vector<size_t>>();
    }
    histogram->counts = std::move(counts);
}

/// Calls f(index, first voxel with halo, beyond the last) for every brick.
template <class F>
void for_each_brick(vktStructuredVolume source, Index3 size, Index3 below, Index3 above, F const& f) {
    needed(source, "source");
    Index3 const n = dims_of(source->volume.get());
    if (size.x < 1 || size.y < 1 || size.z < 1) throw Error(ErrorKind::usage, text("bricks of ", size, " voxels"));
    for (int axis = 0; axis < 3; ++axis)
        if (below[axis] < 0 || above[axis] < 0) throw Error(ErrorKind::usage, "a halo is negative");
    for (std::int64_t z = 0; z * size.z < n.z; ++z)
        for (std::int64_t y = 0; y * size.y < n.y; ++y)
            for (std::int64_t x = 0; x * size.x < n.x; ++x) {
                Index3 const lower{x * size.x, y * size.y, z * size.z};
                Box const brick = intersect({lower, lower + size}, box_of(n));
                f(vktVec3i_t{static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)},
                  Box{brick.lower - below, brick.upper + above});
            }
}

} // namespace

vktError vktComputeAggregatesSV(vktStructuredVolume volume, vktAggregates_t* aggregates) {
    return run("vktComputeAggregatesSV", [&] { aggregate(volume, aggregates, whole(needed(volume, "volume"))); });
}
vktError vktComputeAggregatesRangeSV(vktStructuredVolume volume, vktAggregates_t* aggregates, int32_t firstX,
                                     int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ) {
    return run("vktComputeAggregatesRangeSV",
               [&] { aggregate(volume, aggregates, range(firstX, firstY, firstZ, lastX, lastY, lastZ)); });
}

void vktHistogramCreate(vktHistogram* histogram, size_t numBins) {
    if (histogram != nullptr) *histogram = nullptr;
    volkit::attempt([&] {
        c::need(histogram, "histogram");
        if (numBins < 1 || numBins > 65536) throw Error(ErrorKind::usage, "a histogram has 1 to 65536 bins");
        *histogram = new vktHistogram_impl{std::vector<size_t>(numBins)};
    });
}
void vktHistogramDestroy(vktHistogram histogram) { delete histogram; }
size_t vktHistogramGetNumBins(vktHistogram histogram) { return histogram == nullptr ? 0 : histogram->counts.size(); }
size_t* vktHistogramGetBinCounts(vktHistogram histogram) {
    return histogram == nullptr ? nullptr : histogram->counts.data();
}
vktError vktComputeHistogramSV(vktStructuredVolume volume, vktHistogram histogram) {
    return run("vktComputeHistogramSV", [&] { count(volume, histogram, whole(needed(volume, "volume"))); });
}
vktError vktComputeHistogramRangeSV(vktStructuredVolume volume, vktHistogram histogram, int32_t firstX, int32_t firstY,
                                    int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ) {
    return run("vktComputeHistogramRangeSV",
               [&] { count(volume, histogram, range(firstX, firstY, firstZ, lastX, lastY, lastZ)); });
}

void vktArray3D_vktStructuredVolume_Create(vktArray3D_vktStructuredVolume* arr, vktVec3i_t dims) {
    vktArray3D_vktStructuredVolume_CreateEmpty(arr);
    if (arr != nullptr && *arr != nullptr) vktArray3D_vktStructuredVolume_Resize(*arr, dims);
}
void vktArray3D_vktStructuredVolume_CreateEmpty(vktArray3D_vktStructuredVolume* arr) {
    if (arr != nullptr) *arr = nullptr;
    volkit::attempt([&] {
        c::need(arr, "arr");
        *arr = new vktArray3D_vktStructuredVolume_impl;
    });
}
void vktArray3D_vktStructuredVolume_Destroy(vktArray3D_vktStructuredVolume arr) { delete arr; }
void vktArray3D_vktStructuredVolume_Resize(vktArray3D_vktStructuredVolume arr, vktVec3i_t dims) {
    volkit::attempt([&] {
        c::need(arr, "arr");
        if (dims.x < 0 || dims.y < 0 || dims.z < 0) throw Error(ErrorKind::usage, "an array's extent is negative");
        auto const x = static_cast<std::size_t>(dims.x), y = static_cast<std::size_t>(dims.y),
                   z = static_cast<std::size_t>(dims.z);
        if (x * y > (std::size_t{1} << 40) / std::max<std::size_t>(z, 1))
            throw Error(ErrorKind::resources, "an array of so many volumes has no room");
        arr->volumes.assign(x * y * z, nullptr);
        arr->dims = dims;
    });
}
vktStructuredVolume* vktArray3D_vktStructuredVolume_Access(vktArray3D_vktStructuredVolume arr, vktVec3i_t index) {
    if (arr == nullptr || index.x < 0 || index.y < 0 || index.z < 0) return nullptr;
    vktVec3i_t const n = arr->dims;
    if (index.x >= n.x || index.y >= n.y || index.z >= n.z) return nullptr;
    std::int64_t const at = index.x + std::int64_t{n.x} * (index.y + std::int64_t{n.y} * index.z);
    return &arr->volumes[static_cast<std::size_t>(at)];
}
vktStructuredVolume* vktArray3D_vktStructuredVolume_Data(vktArray3D_vktStructuredVolume arr) {
    return arr == nullptr ? nullptr : arr->volumes.data();
}
vktVec3i_t vktArray3D_vktStructuredVolume_Dims(vktArray3D_vktStructuredVolume arr) {
    return arr == nullptr ? vktVec3i_t{0, 0, 0} : arr->dims;
}
size_t vktArray3D_vktStructuredVolume_NumElements(vktArray3D_vktStructuredVolume arr) {
    return arr == nullptr ? 0 : arr->volumes.size();
}
vktBool_t vktArray3D_vktStructuredVolume_Empty(vktArray3D_vktStructuredVolume arr) {
    return arr == nullptr || arr->volumes.empty() ? VKT_TRUE : VKT_FALSE;
}

vktError vktBrickDecomposeSV(vktArray3D_vktStructuredVolume decomp, vktStructuredVolume source, int32_t brickSizeX,
                             int32_t brickSizeY, int32_t brickSizeZ, int32_t haloSizeNegX, int32_t haloSizeNegY,
                             int32_t haloSizeNegZ, int32_t haloSizePosX, int32_t haloSizePosY, int32_t haloSizePosZ) {
    return run("vktBrickDecomposeSV", [&] {
        c::need(decomp, "decomp");
        for_each_brick(source, {brickSizeX, brickSizeY, brickSizeZ}, {haloSizeNegX, haloSizeNegY, haloSizeNegZ},
                       {haloSizePosX, haloSizePosY, haloSizePosZ}, [&](vktVec3i_t index, Box const& box) {
                           vktStructuredVolume* const brick = vktArray3D_vktStructuredVolume_Access(decomp, index);
                           if (brick == nullptr || *brick == nullptr)
                               throw Error(ErrorKind::usage,
                                           text("the array has no volume ", index.x, " ", index.y, " ", index.z),
                                           "vktBrickDecomposeResizeSV() makes them");
                           paste(*brick, part_of(source->volume.get(), box).get(), {});
                       });
    });
}
vktError vktBrickDecomposeResizeSV(vktArray3D_vktStructuredVolume decomp, vktStructuredVolume source,
                                   int32_t brickSizeX, int32_t brickSizeY, int32_t brickSizeZ, int32_t haloSizeNegX,
                                   int32_t haloSizeNegY, int32_t haloSizeNegZ, int32_t haloSizePosX,
                                   int32_t haloSizePosY, int32_t haloSizePosZ) {
    return run("vktBrickDecomposeResizeSV", [&] {
        c::need(decomp, "decomp");
        std::vector<std::unique_ptr<vktStructuredVolume_impl>> bricks;
        vktVec3i_t dims{0, 0, 0};
        for_each_brick(source, {brickSizeX, brickSizeY, brickSizeZ}, {haloSizeNegX, haloSizeNegY, haloSizeNegZ},
                       {haloSizePosX, haloSizePosY, haloSizePosZ}, [&](vktVec3i_t index, Box const& box) {
                           bricks.push_back(made_like(source, box.dims()));
                           paste(bricks.back().get(), part_of(source->volume.get(), box).get(), {});
                           dims = {index.x + 1, index.y + 1, index.z + 1};
                       });
        vktArray3D_vktStructuredVolume_Resize(decomp, dims);
        for (std::size_t i = 0; i < bricks.size(); ++i) decomp->volumes[i] = bricks[i].release();
    });
}
