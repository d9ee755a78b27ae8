// volkit's algorithms as words for vkt_apply() and vkt_measure().
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <sys/mman.h>
#include <unistd.h>
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

constexpr double pi = 3.14159265358979323846;

Index3 most(Index3 a, Index3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }

/// [first, last); throws Error{usage} where it ends before it begins.
Box range(int32_t x, int32_t y, int32_t z, int32_t endX, int32_t endY, int32_t endZ) {
    if (endX < x || endY < y || endZ < z)
        throw Error(ErrorKind::usage, text("the region ends at ", endX, " ", endY, " ", endZ, ", before it begins at ",
                                           x, " ", y, " ", z));
    return {{x, y, z}, {endX, endY, endZ}};
}

Box whole(vktStructuredVolume volume) { return box_of(dims_of(volume->volume.get())); }

/// The part of a region that the volume has.
Box within(Box const& box, vktStructuredVolume volume) { return intersect(box, whole(volume)); }

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
    // Where the region comes to lie: voxels whose nearest one of the source is in it.
    auto const mask = made(dims_of(from->volume.get()), vktDataFormatUInt8, {1, 1, 1}, 0, 255);
    fill(mask.get(), within(box, from), 1);
    vkt_description const d = description_of(from->volume.get());
    vktStructuredVolumeSetDist3f(mask.get(), static_cast<float>(d.spacing[0]), static_cast<float>(d.spacing[1]),
                                 static_cast<float>(d.spacing[2]));
    words.resize(words.size() - 2);
    words.insert(words.end(), {"--method", "nearest", "--background", "0"});
    // A grid that is larger than the source continues it, but not its region.
    Index3 const grid = most(dims_of(to->volume.get()), dims_of(from->volume.get()));
    auto const there = made(grid, vktDataFormatUInt8, vktStructuredVolumeGetDist3fv(mask.get()), 0, 255);
    paste(there.get(), mask->volume.get(), {});
    Owned const taken = made_on_grid_of(to, there->volume.get(), words);

    auto written = made_like(to, dims_of(to->volume.get()));
    paste(written.get(), moved.get(), {});
    Owned const result =
        applied({"arith", "where", "-", "-", "-"}, {taken.get(), written->volume.get(), to->volume.get()});
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

void calculate(char const* operation, vktStructuredVolume to, vktStructuredVolume a, vktStructuredVolume b,
               Box const& box, Index3 offset) {
    needed(to, "dest");
    needed(a, "source1");
    needed(b, "source2");
    // What nobody would see need not be computed.
    Box const wanted = intersect(box, {whole(to).lower - offset, whole(to).upper - offset});
    if (wanted.empty()) return;
    Owned const first = part_of(a->volume.get(), wanted), second = part_of(b->volume.get(), wanted);
    paste(to, applied({"arith", operation, "-", "-", "--dtype", "float64"}, {first.get(), second.get()}).get(),
          wanted.lower + offset);
}

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

vktError vktSumSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktSumSV", [&] { calculate("add", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktSumRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                       int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                       int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktSumRangeSV", [&] {
        calculate("add", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktDiffSV", [&] { calculate("sub", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                        int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                        int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktDiffRangeSV", [&] {
        calculate("sub", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktProdSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktProdSV", [&] { calculate("mul", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktProdRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                        int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                        int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktProdRangeSV", [&] {
        calculate("mul", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktQuotSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktQuotSV", [&] { calculate("div", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktQuotRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                        int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                        int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktQuotRangeSV", [&] {
        calculate("div", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
                  {dstOffsetX, dstOffsetY, dstOffsetZ});
    });
}
vktError vktAbsDiffSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2) {
    return run("vktAbsDiffSV",
               [&] { calculate("absdiff", dest, source1, source2, whole(needed(source1, "source1")), {}); });
}
vktError vktAbsDiffRangeSV(vktStructuredVolume dest, vktStructuredVolume source1, vktStructuredVolume source2,
                           int32_t firstX, int32_t firstY, int32_t firstZ, int32_t lastX, int32_t lastY, int32_t lastZ,
                           int32_t dstOffsetX, int32_t dstOffsetY, int32_t dstOffsetZ) {
    return run("vktAbsDiffRangeSV", [&] {
        calculate("absdiff", dest, source1, source2, range(firstX, firstY, firstZ, lastX, lastY, lastZ),
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
