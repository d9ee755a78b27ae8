// volkit's arithmetic as words for vkt_apply(), and functions of the program for every voxel.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cstdint>

using namespace vkt;
using namespace vkt::volkit;

namespace {

/// dest = an expression of the physical values v and a. (arith would combine stored ones.)
void calculate(char const* expression, vktStructuredVolume to, vktStructuredVolume a, vktStructuredVolume b,
               Box const& box, Index3 offset) {
    needed(to, "dest");
    needed(a, "source1");
    needed(b, "source2");
    // What nobody would see need not be computed.
    Box const wanted = intersect(box, {whole(to).lower - offset, whole(to).upper - offset});
    if (wanted.empty()) return;
    Owned const first = part_of(a->volume.get(), wanted);
    Owned second = part_of(b->volume.get(), wanted);
    vktVec3f_t const dist = vktStructuredVolumeGetDist3fv(a), other = vktStructuredVolumeGetDist3fv(b);
    if (dist.x != other.x || dist.y != other.y || dist.z != other.z) { // voxels meet by their number here
        auto same = made(wanted.upper, b->format, dist, b->low, b->high);
        paste(same.get(), second.get(), wanted.lower);
        second = part_of(same->volume.get(), wanted);
    }
    paste(to, applied({"transform", expression, "-", "-", "--dtype", "float64"}, {first.get(), second.get()}).get(),
          wanted.lower + offset);
}

} // namespace

vktError vktSumSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktSumSV", [&] { calculate("v + a", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktSumRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                       int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                       int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktSumRangeSV", [&] {
        calculate("v + a", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktDiffSV", [&] { calculate("v - a", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                        int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                        int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktDiffRangeSV", [&] {
        calculate("v - a", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktProdSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktProdSV", [&] { calculate("v * a", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktProdRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                        int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                        int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktProdRangeSV", [&] {
        calculate("v * a", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktQuotSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktQuotSV", [&] { calculate("v / a", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktQuotRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                        int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                        int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktQuotRangeSV", [&] {
        calculate("v / a", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktAbsDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktAbsDiffSV",
               [&] { calculate("abs(v - a)", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktAbsDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                           int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                           int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktAbsDiffRangeSV", [&] {
        calculate("abs(v - a)", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktSafeSumSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return vktSumSV(dest, source1, source2);
}
vktError vktSafeSumRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                           int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                           int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return vktSumRangeSV(dest, source1, source2, firstX, firstY, firstZ, lastX, lastY, lastZ, dstOffsetX, dstOffsetY,
                         dstOffsetZ);
}
vktError vktSafeDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return vktDiffSV(dest, source1, source2);
}
vktError vktSafeDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                            int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                            int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return vktDiffRangeSV(dest, source1, source2, firstX, firstY, firstZ, lastX, lastY, lastZ, dstOffsetX, dstOffsetY,
                          dstOffsetZ);
}
vktError vktSafeProdSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return vktProdSV(dest, source1, source2);
}
vktError vktSafeProdRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                            int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                            int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return vktProdRangeSV(dest, source1, source2, firstX, firstY, firstZ, lastX, lastY, lastZ, dstOffsetX, dstOffsetY,
                          dstOffsetZ);
}
vktError vktSafeQuotSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return vktQuotSV(dest, source1, source2);
}
vktError vktSafeQuotRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                            int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                            int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return vktQuotRangeSV(dest, source1, source2, firstX, firstY, firstZ, lastX, lastY, lastZ, dstOffsetX, dstOffsetY,
                          dstOffsetZ);
}

namespace {

vktVoxelView_t voxel_of(vktStructuredVolume volume, std::uint8_t* data, Index3 dims, Index3 p) {
    std::size_t const size = volkit::size_of(volume->format);
    return {data + static_cast<std::size_t>(p.x + dims.x * (p.y + dims.y * p.z)) * size, volume->format, volume->low,
            volume->high};
}

void transform(vktStructuredVolume volume, Box const& box, vktTransformUnaryOp op) {
    if (op == nullptr) c::need(nullptr, "unaryOp");
    std::uint8_t* const data = writable(volume);
    Index3 const n = dims_of(volume->volume.get());
    Box const there = intersect(box, box_of(n));
    for (std::int64_t z = there.lower.z; z < there.upper.z; ++z)
        for (std::int64_t y = there.lower.y; y < there.upper.y; ++y)
            for (std::int64_t x = there.lower.x; x < there.upper.x; ++x)
                op(static_cast<int32_t>(x), static_cast<int32_t>(y), static_cast<int32_t>(z),
                   voxel_of(volume, data, n, {x, y, z}));
}

void transform(vktStructuredVolume first, vktStructuredVolume second, Box const& box, Index3 shift,
               vktTransformBinaryOp op) {
    if (op == nullptr) c::need(nullptr, "binaryOp");
    std::uint8_t* const one = writable(first);
    std::uint8_t* const two = writable(second);
    Index3 const n = dims_of(first->volume.get()), m = dims_of(second->volume.get());
    Box const there = intersect(intersect(box, box_of(n)), {Index3{} - shift, m - shift});
    for (std::int64_t z = there.lower.z; z < there.upper.z; ++z)
        for (std::int64_t y = there.lower.y; y < there.upper.y; ++y)
            for (std::int64_t x = there.lower.x; x < there.upper.x; ++x)
                op(static_cast<int32_t>(x), static_cast<int32_t>(y), static_cast<int32_t>(z),
                   voxel_of(first, one, n, {x, y, z}), voxel_of(second, two, m, Index3{x, y, z} + shift));
}

} // namespace

vktError vktTransformSV1(vktStructuredVolume volume, vktTransformUnaryOp unaryOp) {
    return run("vktTransformSV1", [&] { transform(volume, whole(needed(volume, "volume")), unaryOp); });
}
vktError vktTransformSV2(vktStructuredVolume volume1, vktStructuredVolume volume2, vktTransformBinaryOp binaryOp) {
    return run("vktTransformSV2", [&] {
        transform(volume1, needed(volume2, "volume2"), whole(needed(volume1, "volume1")), {}, binaryOp);
    });
}
vktError vktTransformRangeSV1(vktStructuredVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX,
                              int32_t lastY, int32_t lastZ, vktTransformUnaryOp unaryOp) {
    return run("vktTransformRangeSV1", [&] {
        transform(needed(volume, "volume"), range(firstX, firstY, firstZ, lastX, lastY, lastZ), unaryOp);
    });
}
vktError vktTransformRangeSV2(vktStructuredVolume volume1, vktStructuredVolume volume2, int32_t firstX, int32_t firstY,
                              int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t volume2OffsetX,
                              int32_t volume2OffsetY, int32_t volume2OffsetZ, vktTransformBinaryOp binaryOp) {
    return run("vktTransformRangeSV2", [&] {
        Box const box = range(firstX, firstY, firstZ, lastX, lastY, lastZ);
        transform(needed(volume1, "volume1"), needed(volume2, "volume2"), box,
                  Index3{volume2OffsetX, volume2OffsetY, volume2OffsetZ} - box.lower, binaryOp);
    });
}
