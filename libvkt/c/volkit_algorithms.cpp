// volkit's fills, copies, moves and filters as words for vkt_apply().
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <sys/mman.h>
#include <unistd.h>
#include <utility>
#include <vector>

using namespace vkt;
using namespace vkt::volkit;

namespace {

constexpr double pi = 3.14159265358979323846;

Index3 most(Index3 a, Index3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }

void fill(vktStructuredVolume volume, Box const& box, double value) {
    if (box.empty()) return;
    take(volume, applied({"fill", "--value=" + to_text(value), "--roi", region(box)}, {volume->volume.get()}));
}

char letter(vktAxis axis) {
    if (axis != vktAxisX && axis != vktAxisY && axis != vktAxisZ)
        throw Error(ErrorKind::usage, text("there is no axis ", static_cast<int>(axis)));
    return static_cast<char>('x' + static_cast<int>(axis));
}

/// What words make of a volume that is as large as both, cut to the extents of `to`.
Owned made_on_grid_of(vktStructuredVolume to, vkt_volume const* content, std::vector<std::string> const& words) {
    Index3 const wanted = dims_of(to->volume.get()), has = dims_of(content), all = most(wanted, has);
    Owned grown, cut;
    if (all != has) {
        grown = part_of(content, box_of(all));
        content = grown.get();
    }
    Owned result = applied(words, {content});
    if (all != wanted) cut = part_of(result.get(), box_of(wanted));
    return cut ? std::move(cut) : std::move(result);
}

/// Moves a region of the source, and writes it where it comes to lie.
void move_region(vktStructuredVolume to, vktStructuredVolume from, Box const& box, std::vector<std::string> words) {
    words.insert(words.end(), {"--boundary", "clamp"});
    Owned const moved = made_on_grid_of(to, from->volume.get(), words);
    words.resize(words.size() - 2);
    words.insert(words.end(), {"--method", "nearest", "--background", "0"});
    // Where the region comes to lie: voxels whose nearest one of the source is in it.
    Index3 const grid = most(dims_of(to->volume.get()), dims_of(from->volume.get()));
    auto const there = made(grid, vktDataFormatUInt8, vktStructuredVolumeGetDist3fv(from), 0, 255);
    fill(there.get(), within(box, from), 1);
    Owned const taken = made_on_grid_of(to, there->volume.get(), words);

    auto written = made_like(to, dims_of(to->volume.get()));
    paste(written.get(), moved.get(), {});
    auto where = made(dims_of(to->volume.get()), vktDataFormatUInt8, vktStructuredVolumeGetDist3fv(to), 0, 255);
    paste(where.get(), taken.get(), {});
    Owned const result =
        applied({"arith", "where", "-", "-", "-"}, {where->volume.get(), written->volume.get(), to->volume.get()});
    paste(to, result.get(), {});
}

void rotate(vktStructuredVolume to, vktStructuredVolume from, Box const& box, vktVec3f_t axis, float angle,
            vktVec3f_t centre) {
    double degrees = double{angle} * 180 / pi;
    double const quarter = std::nearbyint(degrees / 90) * 90;
    if (std::abs(degrees - quarter) < 2e-5) degrees = quarter; // no float is a quarter turn
    move_region(to, from, box,
                {"rotate", "--axis=" + triple(double{axis.x}, double{axis.y}, double{axis.z}),
                 "--angle=" + to_text(degrees),
                 "--about=" + triple(double{centre.x} - 0.5, double{centre.y} - 0.5, double{centre.z} - 0.5)});
}

void scale(vktStructuredVolume to, vktStructuredVolume from, Box const& box, vktVec3f_t factor, vktVec3f_t centre) {
    move_region(to, from, box,
                {"scale", "--factor=" + triple(double{factor.x}, double{factor.y}, double{factor.z}),
                 "--about=" + triple(double{centre.x} - 0.5, double{centre.y} - 0.5, double{centre.z} - 0.5)});
}

/// Puts what is made on the grid of a volume into it, resampled if it has other extents.
void fit(vktStructuredVolume to, Owned content, char const* method) {
    Index3 const n = dims_of(to->volume.get());
    if (dims_of(content.get()) != n)
        content = applied({"resample", text("--dims=", n.x, ",", n.y, ",", n.z), "--method", method}, {content.get()});
    paste(to, content.get(), {});
}

/// A file without a name, for the one operation that reads weights from a file.
class Weights {
public:
    Weights(float const* weights, int32_t x, int32_t y, int32_t z)
        : descriptor_(::memfd_create("weights", MFD_CLOEXEC)) {
        if (descriptor_ < 0)
            throw Error(ErrorKind::resources, text("no room for the weights of a filter: ", std::strerror(errno)));
        std::string written = text(x, " ", y, " ", z);
        std::int64_t const count = std::int64_t{x} * y * z;
        for (std::int64_t i = 0; i < count; ++i) written += " " + to_text(double{weights[i]});
        for (std::size_t done = 0; done < written.size();) {
            ssize_t const n = ::write(descriptor_, written.data() + done, written.size() - done);
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) {
                ::close(descriptor_);
                throw Error(ErrorKind::resources, text("no room for the weights of a filter: ", std::strerror(errno)));
            }
            done += static_cast<std::size_t>(n);
        }
    }
    ~Weights() { ::close(descriptor_); }
    Weights(Weights const&) = delete;
    Weights& operator=(Weights const&) = delete;
    std::string path() const { return text("/proc/self/fd/", descriptor_); }

private:
    int descriptor_;
};

char const* boundary(vktAddressMode mode) {
    switch (mode) {
    case vktAddressModeWrap:
        return "wrap";
    case vktAddressModeMirror:
        return "mirror";
    case vktAddressModeClamp:
        return "clamp";
    case vktAddressModeBorder:
        return "border";
    }
    throw Error(ErrorKind::usage, text("there is no address mode ", static_cast<int>(mode)));
}

void filter(vktStructuredVolume to, vktStructuredVolume from, Box const& box, float const* weights, Index3 dims,
            vktAddressMode mode) {
    c::need(weights, "weights");
    for (int axis = 0; axis < 3; ++axis)
        if (dims[axis] < 1 || dims[axis] > 129 || dims[axis] % 2 == 0)
            throw Error(ErrorKind::usage, text("weights of ", dims, ": extents are odd, from 1 to 129"));
    Weights const file(weights, static_cast<int32_t>(dims.x), static_cast<int32_t>(dims.y),
                       static_cast<int32_t>(dims.z));
    Owned const sums = applied({"filter", "kernel", file.path(), "--boundary", boundary(mode)}, {from->volume.get()});
    Box const there = within(box, from);
    paste(to, part_of(sums.get(), there).get(), there.lower);
}

} // namespace

vktError vktFillSV(vktStructuredVolume volume, float value) {
    return run("vktFillSV", [&] { fill(volume, whole(needed(volume, "volume")), double{value}); });
}
vktError vktFillRangeSV(vktStructuredVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX,
                        int32_t lastY, int32_t lastZ, float value) {
    return run("vktFillRangeSV", [&] {
        fill(volume, within(range(firstX, firstY, firstZ, lastX, lastY, lastZ), needed(volume, "volume")),
             double{value});
    });
}

vktError vktFillSubVoxelRangeSV(vktStructuredVolume volume, float firstX, float firstY, float firstZ, float lastX,
                                float lastY, float lastZ, float value) {
    return run("vktFillSubVoxelRangeSV", [&] {
        needed(volume, "volume");
        double const first[3] = {double{firstX}, double{firstY}, double{firstZ}};
        double const last[3] = {double{lastX}, double{lastY}, double{lastZ}};
        std::string covered;
        Box box;
        for (int axis = 0; axis < 3; ++axis) {
            if (!(first[axis] <= last[axis]) || !(std::abs(first[axis]) <= 1e9) || !(std::abs(last[axis]) <= 1e9))
                throw Error(ErrorKind::usage, "the region ends before it begins");
            box.lower[axis] = static_cast<std::int64_t>(std::floor(first[axis]));
            box.upper[axis] = static_cast<std::int64_t>(std::ceil(last[axis]));
            char const at = static_cast<char>('x' + axis);
            covered += text(axis == 0 ? "" : " * ", "max(0, min(", std::string(1, at), " + 1, ", last[axis], ") - max(",
                            std::string(1, at), ", ", first[axis], "))");
        }
        box = within(box, volume);
        if (box.empty()) return;
        take(volume, applied({"transform", text("v + (", double{value}, " - v) * ", covered), "--roi", region(box)},
                             {volume->volume.get()}));
    });
}

vktError vktDeleteSV(vktStructuredVolume volume) {
    return run("vktDeleteSV", [&] { fill(volume, whole(needed(volume, "volume")), 0); });
}
vktError vktDeleteRangeSV(vktStructuredVolume volume, int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX,
                          int32_t lastY, int32_t lastZ) {
    return run("vktDeleteRangeSV", [&] {
        fill(volume, within(range(firstX, firstY, firstZ, lastX, lastY, lastZ), needed(volume, "volume")), 0);
    });
}

vktError vktCopySV(vktStructuredVolume dst, vktStructuredVolume src) {
    return run("vktCopySV", [&] { paste(needed(dst, "dst"), needed(src, "src")->volume.get(), {}); });
}
vktError vktCopyRangeSV(vktStructuredVolume dst, vktStructuredVolume src, int32_t firstX, int32_t firstY,
                        int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t dstOffsetX,
                        int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktCopyRangeSV", [&] {
        needed(src, "src");
        Box const box = range(firstX, firstY, firstZ, lastX, lastY, lastZ), there = whole(needed(dst, "dst"));
        Index3 const shift = Index3{dstOffsetX, dstOffsetY, dstOffsetZ} - box.lower;
        Box const wanted = intersect(box, {there.lower - shift, there.upper - shift});
        paste(dst, part_of(src->volume.get(), wanted).get(), wanted.lower + shift);
    });
}

vktError vktFlipSV(vktStructuredVolume dest, vktStructuredVolume source, vktAxis axis) {
    return run("vktFlipSV", [&] {
        needed(dest, "dest");
        paste(dest, applied({"flip", std::string(1, letter(axis))}, {needed(source, "source")->volume.get()}).get(),
              {});
    });
}
vktError vktFlipRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                        int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t dstOffsetX,
                        int32_t dstOffsetY, int32_t dstOffsetZ, vktAxis axis) {
    return run("vktFlipRangeSV", [&] {
        needed(dest, "dest");
        Box const box = within(range(firstX, firstY, firstZ, lastX, lastY, lastZ), needed(source, "source"));
        std::string const along(1, letter(axis));
        if (box.empty()) return;
        Owned const part = part_of(source->volume.get(), box);
        paste(dest, applied({"flip", along}, {part.get()}).get(),
              box.lower + Index3{dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}

vktError vktRotateSV(vktStructuredVolume dest, vktStructuredVolume source, vktVec3f_t axis, float angleInRadians,
                     vktVec3f_t centerOfRotation) {
    return run("vktRotateSV", [&] {
        rotate(needed(dest, "dest"), source, whole(needed(source, "source")), axis, angleInRadians, centerOfRotation);
    });
}
vktError vktRotateRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                          int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, vktVec3f_t axis,
                          float angleInRadians, vktVec3f_t centerOfRotation) {
    return run("vktRotateRangeSV", [&] {
        needed(source, "source");
        rotate(needed(dest, "dest"), source, range(firstX, firstY, firstZ, lastX, lastY, lastZ), axis, angleInRadians,
               centerOfRotation);
    });
}
vktError vktScaleSV(vktStructuredVolume dest, vktStructuredVolume source, vktVec3f_t scalingFactor,
                    vktVec3f_t centerOfScaling) {
    return run("vktScaleSV", [&] {
        scale(needed(dest, "dest"), source, whole(needed(source, "source")), scalingFactor, centerOfScaling);
    });
}
vktError vktScaleRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                         int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, vktVec3f_t scalingFactor,
                         vktVec3f_t centerOfScaling) {
    return run("vktScaleRangeSV", [&] {
        needed(source, "source");
        scale(needed(dest, "dest"), source, range(firstX, firstY, firstZ, lastX, lastY, lastZ), scalingFactor,
              centerOfScaling);
    });
}

vktError vktResampleSV(vktStructuredVolume dst, vktStructuredVolume src, vktFilterMode fm) {
    return run("vktResampleSV", [&] {
        needed(dst, "dst");
        if (fm != vktFilterModeNearest && fm != vktFilterModeLinear)
            throw Error(ErrorKind::usage, text("there is no filter mode ", static_cast<int>(fm)));
        Owned same = part_of(needed(src, "src")->volume.get(), whole(src));
        fit(dst, std::move(same), fm == vktFilterModeNearest ? "nearest" : "auto");
    });
}
vktError vktResampleCLAHESV(vktStructuredVolume dst, vktStructuredVolume src) {
    return run("vktResampleCLAHESV", [&] {
        needed(dst, "dst");
        fit(dst, applied({"clahe"}, {needed(src, "src")->volume.get()}), "auto");
    });
}

vktError vktApplyFilterSV(vktStructuredVolume dest, vktStructuredVolume source, float const* weights, int32_t dimX,
                          int32_t dimY, int32_t dimZ, vktAddressMode am) {
    return run("vktApplyFilterSV", [&] {
        filter(needed(dest, "dest"), source, whole(needed(source, "source")), weights, {dimX, dimY, dimZ}, am);
    });
}
vktError vktApplyFilterRangeSV(vktStructuredVolume dest, vktStructuredVolume source, int32_t firstX, int32_t firstY,
                               int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, float const* weights,
                               int32_t dimX, int32_t dimY, int32_t dimZ, vktAddressMode am) {
    return run("vktApplyFilterRangeSV", [&] {
        needed(source, "source");
        filter(needed(dest, "dest"), source, range(firstX, firstY, firstZ, lastX, lastY, lastZ), weights,
               {dimX, dimY, dimZ}, am);
    });
}

vktError vktScanSV(vktStructuredVolume dst, vktStructuredVolume src) {
    return run("vktScanSV", [&] {
        needed(dst, "dst");
        paste(dst, applied({"scan"}, {needed(src, "src")->volume.get()}).get(), {});
    });
}
vktError vktScanRangeSV(vktStructuredVolume dst, vktStructuredVolume src, int32_t firstX, int32_t firstY,
                        int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ, int32_t dstOffsetX,
                        int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktScanRangeSV", [&] {
        needed(dst, "dst");
        Box const box = within(range(firstX, firstY, firstZ, lastX, lastY, lastZ), needed(src, "src"));
        if (box.empty()) return;
        Owned const part = part_of(src->volume.get(), box);
        paste(dst, applied({"scan"}, {part.get()}).get(), {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
