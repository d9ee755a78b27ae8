// Compares every operation that runs on the GPU with the CPU, on awkward shapes and poisoned outputs, then times them:
// parity [all|--no-comparing|--no-timing [WORD...]], only what has one of the words in its name.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/half.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/registry.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/resample/resample.h"
#include "libvkt/operations/voxels/crop.h"
#include "libvkt/operations/voxels/fill.h"
#include "libvkt/operations/voxels/flip.h"
#include "tests/gpu/timing.h"
#include "tests/gpu/twins.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>

namespace {

using namespace vkt;
using namespace vkt::gpu_test;

int failures = 0, checks = 0, cpu_only = 0;
constexpr int skipped = 77; ///< exit code by which CTest knows

void report(bool ok, std::string const& what) {
    ++checks;
    if (ok) return;
    ++failures;
    std::printf("FAILED %s\n", what.c_str());
}

double value_at(ConstView view, std::byte const* at) {
    switch (view.type) {
    case DataType::uint8:
        return static_cast<double>(*reinterpret_cast<std::uint8_t const*>(at));
    case DataType::int8:
        return static_cast<double>(*reinterpret_cast<std::int8_t const*>(at));
    case DataType::uint16:
        return static_cast<double>(*reinterpret_cast<std::uint16_t const*>(at));
    case DataType::int16:
        return static_cast<double>(*reinterpret_cast<std::int16_t const*>(at));
    case DataType::uint32:
        return static_cast<double>(*reinterpret_cast<std::uint32_t const*>(at));
    case DataType::int32:
        return static_cast<double>(*reinterpret_cast<std::int32_t const*>(at));
    case DataType::uint64:
        return static_cast<double>(*reinterpret_cast<std::uint64_t const*>(at));
    case DataType::int64:
        return static_cast<double>(*reinterpret_cast<std::int64_t const*>(at));
    case DataType::float16:
        return static_cast<double>(*reinterpret_cast<Half const*>(at));
    case DataType::float32:
        return static_cast<double>(*reinterpret_cast<float const*>(at));
    case DataType::float64:
        return *reinterpret_cast<double const*>(at);
    }
    return 0;
}

/// Runs on both and compares all of the output's memory, gaps included, reports, and what was remarked. bound < 0 asks
/// for equal bits.
void compare(Operation& operation, Twin& in, std::string const& what, double bound, std::int64_t slab = 0,
             Geometry const& geometry = {}) {
    if (!is_wanted(what)) return;
    Header header;
    header.geometry = geometry;
    header.dims = in.box.dims();
    header.dtype = in.type;
    std::vector<Header> const headers{header};
    std::unique_ptr<Twin> out;
    std::string said[2];
    for (Execution const& execution : {cpu(), gpu()}) {
        Plan const plan = begun(operation, headers);
        Header const planned = plan.output;
        // Otherwise host code would be given device memory; the command runs it on the CPU and says so.
        if (!operation.runs_on_gpu()) {
            ++cpu_only;
            return;
        }
        if (!out) out = std::make_unique<Twin>(planned.dtype, box_of(planned.dims), 3);
        std::int64_t const height = slab > 0 ? slab : planned.dims.z;
        if (plan.scans) scan(operation, in.view(execution.space()), slab, execution);
        operation.fit({planned.dims.x, planned.dims.y, std::min(height, planned.dims.z)}, execution);
        for (std::int64_t z = 0; z < planned.dims.z; z += height) {
            Box part = box_of(planned.dims);
            part.lower.z = z;
            part.upper.z = std::min(z + height, planned.dims.z);
            Box const need = operation.footprint(part, 0);
            if (!need.empty() && !in.box.contains(need)) {
                report(false, what + ": footprint leaves the volume");
                return;
            }
            ConstView const all = in.view(execution.space());
            ConstView const window = need.empty() // as the engine has it: the operation has seen all that it needs
                                         ? dense_view(static_cast<std::byte const*>(nullptr), in.type, need)
                                         : all.part(need);
            operation.run({&window, 1}, out->view(execution.space()).part(part), execution);
        }
        std::string& words = said[execution.device == Device::gpu ? 1 : 0];
        if (operation.reports() && (in.type == DataType::uint8 || in.type == DataType::float32))
            words += operation.report().json();
        for (Remark const& remark : operation.remarks()) words += remark.message + "\n";
    }
    if (said[0] != said[1]) return report(false, what + ": says\n" + said[1] + "instead of\n" + said[0]);
    device_synchronize();
    std::vector<std::byte> const got = out->download();
    // Outside the box bytes must be equal, inside values close; one NaN is as good as another.
    ConstView const expected = out->view(Space::host);
    Index3 const n = expected.dims();
    std::vector<std::byte> rest = got;
    double worst = 0;
    bool numbers = true;
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                std::byte const* const a = expected.at(x, y, z);
                std::size_t const offset = static_cast<std::size_t>(a - out->host.data());
                double const v = value_at(expected, a), w = value_at(expected, got.data() + offset);
                numbers = numbers && std::isnan(v) == std::isnan(w);
                bool const same = v == w || (std::isnan(v) && std::isnan(w));
                if (!same) worst = std::max(worst, std::abs(v - w));
                if (bound >= 0 || std::isnan(v)) std::memcpy(rest.data() + offset, a, size_of(out->type));
            }
    char text[96];
    std::snprintf(text, sizeof text, ": error %g, bound %g%s", worst, bound, numbers ? "" : ", NaN elsewhere");
    report(rest == out->host && worst <= std::max(bound, 0.0) && numbers, what + text);
}

void compare_all() {
    Index3 const shapes[] = {{1000, 37, 5}, {64, 48, 20},  {1, 1, 1},    {17, 1, 9},
                             {3, 300, 7},   {131, 70, 33}, {1, 1, 70000}};
    for (int t = 0; t < data_type_count; ++t) {
        auto const type = static_cast<DataType>(t);
        for (Index3 const dims : shapes)
            for (std::int64_t gap : {0, 1, 5}) {
                Twin in(type, box_of(dims), gap);
                randomise(in, 7);
                std::string const name = std::string(name_of(type)) + " " + to_text(dims) + " gap " + to_text(gap);
                for (Axis axis : {Axis::x, Axis::y, Axis::z}) {
                    Flip flip(axis);
                    compare(flip, in, "flip " + enum_name(axis) + " " + name, -1);
                }
                Fill fill(42);
                compare(fill, in, "fill " + name, -1);
                Crop crop(Roi{"10%:,:90%,5%:95%"});
                compare(crop, in, "crop " + name, -1);
                if (dims.x > 10 && dims.y > 10) {
                    Flip inside(Axis::x, Roi{"3:10,1:9,:"});
                    compare(inside, in, "flip in a region " + name, -1);
                    Fill part(7.5, Roi{"3:10,1:9,:"});
                    compare(part, in, "fill of a region " + name, -1);
                }
                if (gap != 1) continue;
                double const whole = is_integer(type) ? 1 : type == DataType::float16 ? 0.1 : 1e-3;
                for (Boundary boundary : {Boundary::mirror, Boundary::clamp, Boundary::border}) {
                    Gaussian gaussian({1.5, 2, 0.8}, boundary);
                    compare(gaussian, in, "gaussian " + enum_name(boundary) + " " + name, whole * 1.001);
                    compare(gaussian, in, "gaussian in slabs of 7 " + name, whole * 1.001, 7);
                }
                Gaussian wide({40, 30, 3});
                if (dims.z < 100) compare(wide, in, "gaussian, large sigma " + name, whole * 1.001);
                for (ResampleMethod method : {ResampleMethod::nearest, ResampleMethod::linear, ResampleMethod::area}) {
                    Resample resample;
                    resample.dims = Index3{std::max<std::int64_t>(1, dims.x * 2 / 3), dims.y + 1,
                                           std::max<std::int64_t>(1, dims.z / 2)};
                    resample.method = method;
                    compare(resample, in, "resample " + enum_name(method) + " " + name,
                            method == ResampleMethod::nearest ? -1 : whole * 1.001);
                }
            }
    }
}

/// Some voxels become zero: of blocks of so many voxels along each axis all but a share.
void thin(Twin& volume, unsigned seed, double share, std::int64_t block) {
    AnyView const view = volume.view(Space::host);
    Index3 const n = view.dims();
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                auto h = static_cast<std::uint64_t>(seed + x / block + 4099 * (y / block) + 8381029 * (z / block)) *
                         0x9e3779b97f4a7c15u;
                h = (h ^ h >> 29) * 0xbf58476d1ce4e5b9u;
                if (static_cast<double>((h ^ h >> 32) >> 11) * 0x1p-53 > share)
                    std::memset(view.at(x, y, z), 0, size_of(volume.type));
            }
    volume.upload();
}
/// Voxels that are not zero become 1, 2 or 3: in some blocks of 7 by 5 by 3 all are alike.
void make_few(Twin& volume) {
    AnyView const view = volume.view(Space::host);
    Index3 const n = view.dims();
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                std::byte* const at = view.at(x, y, z);
                double const v = value_at(view, at);
                if (v == 0) continue;
                std::int64_t const block = x / 7 + y / 5 + z / 3;
                double const few = 1 + static_cast<double>((block % 2 == 0 ? block : static_cast<std::int64_t>(v)) % 3);
                VoxelBytes const voxel = voxel_bytes(volume.type, few);
                std::memcpy(at, voxel.data(), size_of(volume.type));
            }
    volume.upload();
}
/// Some voxels are no numbers.
void spoil(Twin& volume, std::int64_t every) {
    AnyView const view = volume.view(Space::host);
    Index3 const n = view.dims();
    for (std::int64_t i = every / 2; i < n.x * n.y * n.z && !is_integer(volume.type); i += every) {
        VoxelBytes const voxel = voxel_bytes(volume.type, i % 3 == 0 ? HUGE_VAL : std::nan(""));
        std::memcpy(view.at(i % n.x, i / n.x % n.y, i / n.x / n.y), voxel.data(), size_of(volume.type));
    }
    volume.upload();
}

/// What looks at whole lines and whole volumes.
void compare_far() {
    Index3 const shapes[] = {{1000, 37, 5}, {64, 48, 20}, {1, 1, 1},     {17, 1, 9},   {3, 300, 7},
                             {131, 70, 33}, {1, 1, 700},  {33, 3, 1100}, {2050, 9, 3}, {6200, 2, 2}};
    for (int t = 0; t < data_type_count; ++t) {
        auto const type = static_cast<DataType>(t);
        for (Index3 const dims : shapes) {
            std::string const name = " " + std::string(name_of(type)) + " " + to_text(dims);
            for (bool const odd : {false, true}) {
                if (odd && is_integer(type)) continue;
                Twin in(type, box_of(dims), odd ? 5 : 1);
                randomise(in, 7);
                if (odd) spoil(in, 29);
                for (char const* const what : {"max", "min", "mean", "sum", "std", "median"})
                    for (char const* const axis : {"x", "y", "z"}) {
                        // Along rows numbers are summed in another order.
                        bool const sums = what[0] == 's' || std::strcmp(what, "mean") == 0;
                        bool const exact = !sums || axis[0] != 'x' || (is_integer(type) && what[1] != 't');
                        auto const project = operation_of({"project", what, "--axis", axis});
                        for (std::int64_t const slab : {0, 3}) {
                            double const bound = exact ? -1 : type == DataType::float16 ? 0.05 : 1e-4;
                            compare(*project, in, std::string("project ") + what + " " + axis + name, bound, slab);
                        }
                    }
                for (bool const exclusive : {false, true}) {
                    auto const sums = operation_of(exclusive ? words_of("scan --exclusive") : words_of("scan"));
                    for (std::int64_t const slab : {0, 7})
                        compare(*sums, in, (exclusive ? "scan --exclusive" : "scan") + name,
                                is_integer(type) ? -1 : 1e-5, slab);
                }
            }
            for (double const share : {0.05, 0.3, 0.95, 1.0})
                for (std::int64_t const block : {1, 5}) {
                    if (block > 1 && share > 0.9) continue;
                    Twin in(type, box_of(dims), 3);
                    randomise(in, 11);
                    thin(in, 5, share, block);
                    spoil(in, 101);
                    std::string const that = name + " share " + to_text(share) + " of blocks of " + to_text(block);
                    for (char const* const words :
                         {"label", "label --connectivity 18", "label --connectivity 26",
                          "label --connectivity 26 --keep-largest 2 --dtype uint8", "label --by-value",
                          "label --by-value --connectivity 18", "label --by-value --connectivity 26 --keep-largest 9",
                          "label --min-size 4 --roi 1:,:,1:", "label --by-value --connectivity 26 --roi 1:,:,1:"}) {
                        if (dims.z < 2 && std::strstr(words, "roi") != nullptr) continue;
                        if (dims.x < 2 && std::strstr(words, "roi") != nullptr) continue;
                        auto const label = operation_of(words_of(words));
                        compare(*label, in, words + that, -1, block > 1 ? 0 : 3);
                    }
                    Twin few(type, box_of(dims), 3);
                    randomise(few, 13);
                    thin(few, 5, share, block);
                    make_few(few);
                    spoil(few, 101);
                    for (char const* const connectivity : {"6", "18", "26"}) {
                        auto const label = operation_of({"label", "--by-value", "--connectivity", connectivity});
                        compare(*label, few, "label --by-value of few values, " + (connectivity + that), -1,
                                block > 1 ? 0 : 3);
                    }
                    for (char const* const words : {"fill-holes", "fill-holes --connectivity 26 --max-size 3",
                                                    "fill-holes --connectivity 18 --value 9", "slice --axis x",
                                                    "slice --axis y --range 0:50", "slice --range 2:90"}) {
                        auto const operation = operation_of(words_of(words));
                        compare(*operation, in, words + that, -1);
                    }
                    Geometry fine, odd;
                    fine.spacing = {0.5, 1, 2.5};
                    odd.spacing = {0.31, 0.7777, 2.1234567};
                    for (char const* const words : {"distance", "distance --signed"}) {
                        auto const distance = operation_of(words_of(words));
                        compare(*distance, in, words + that, -1);
                        compare(*distance, in, words + that + " spaced", -1, 0, fine);
                        compare(*distance, in, words + that + " oddly spaced", -1, 0, odd);
                    }
                }
        }
    }
}

void compare_borders() {
    for (Boundary boundary : {Boundary::mirror, Boundary::clamp, Boundary::wrap, Boundary::border})
        for (DataType type : {DataType::uint8, DataType::float16, DataType::float32, DataType::float64}) {
            Index3 const dims{33, 20, 11};
            Twin window(type, {{-5, -40, -3}, {60, 25, 14}}, 1);
            randomise(window, 3);
            fill_border(window.view(Space::host), box_of(dims), dims, boundary, 3, cpu());
            fill_border(window.view(Space::device), box_of(dims), dims, boundary, 3, gpu());
            device_synchronize();
            report(window.download() == window.host,
                   "border " + enum_name(boundary) + " " + std::string(name_of(type)));
        }
    // Parts of volumes between host and device, both with gaps.
    Twin a(DataType::uint16, box_of({50, 40, 9}), 5), b(DataType::uint16, box_of({50, 40, 9}), 2);
    randomise(a, 1);
    Box const part{{3, 7, 1}, {41, 30, 8}};
    copy_region(ConstView(a.view(Space::host)).part(part), b.view(Space::host).part(part), cpu());
    copy_region(ConstView(a.view(Space::host)).part(part), b.view(Space::device).part(part), gpu());
    report(b.download() == b.host, "copy of a region to the device");
    Twin c(DataType::uint16, box_of({50, 40, 9}), 2);
    copy_region(ConstView(a.view(Space::device)).part(part), c.view(Space::host).part(part), gpu());
    report(c.host == b.host, "copy of a region from the device");
}

} // namespace

int main(int argc, char** argv) {
    try {
        if (device_count() == 0) {
            std::fprintf(stderr, "skipped: this machine has no CUDA device\n");
            return skipped;
        }
        std::string const only = argc > 1 ? argv[1] : "";
        for (int i = 2; i < argc; ++i) wanted_words().emplace_back(argv[i]);
        if (only != "--no-comparing") {
            compare_far();
            compare_all();
            compare_borders();
            std::printf("%d comparisons, %d failed, %d of operations that run on CPUs only\n", checks, failures,
                        cpu_only);
        }
        if (only != "--no-timing") time_all();
    } catch (Error const& error) {
        std::fprintf(stderr, "parity: %s\n", error.what());
        return 1;
    }
    return failures == 0 ? 0 : 1;
}
