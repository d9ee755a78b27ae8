// Compares every operation that runs on the GPU with the CPU, on awkward shapes and poisoned outputs, then times them:
// parity [all|--no-comparing|--no-timing [WORD...]], only what has one of the words in its name.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"
#include "libvkt/core/device.h"
#include "libvkt/core/half.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/registry.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/resample/resample.h"
#include "libvkt/operations/statistics/histogram.h"
#include "libvkt/operations/statistics/statistics.h"
#include "libvkt/operations/voxels/crop.h"
#include "libvkt/operations/voxels/fill.h"
#include "libvkt/operations/voxels/flip.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <random>

namespace {

using namespace vkt;

int failures = 0, checks = 0, cpu_only = 0;
constexpr int skipped = 77;         ///< exit code by which CTest knows
std::vector<std::string> only_with; ///< what is compared and timed has one of these words in its name; empty: all

bool is_wanted(std::string const& what) {
    return only_with.empty() || std::any_of(only_with.begin(), only_with.end(), [&](std::string const& word) {
               return what.find(word) != std::string::npos;
           });
}

void report(bool ok, std::string const& what) {
    ++checks;
    if (ok) return;
    ++failures;
    std::printf("FAILED %s\n", what.c_str());
}

Execution cpu() {
    Execution execution = default_execution();
    execution.device = Device::cpu;
    return execution;
}
Execution gpu() {
    Execution execution = default_execution();
    execution.device = Device::gpu;
    return execution;
}

constexpr std::byte poison{0xa5};

/// Device memory with a host image. Rows have gaps and start off any alignment, so that strays are seen.
struct Twin {
    Twin(DataType t, Box const& b, std::int64_t gap) : type(t), box(b) {
        Index3 const n = b.dims();
        row = n.x + gap;
        slice = row * n.y + 2 * gap;
        first = gap;
        bytes = static_cast<std::size_t>(first + slice * n.z) * size_of(t);
        host.assign(bytes, poison);
        device = device_allocate(bytes);
        upload();
    }
    ~Twin() { device_free(device); }
    Twin(Twin const&) = delete;
    Twin& operator=(Twin const&) = delete;

    void upload() { copy_to_device(device, host.data(), bytes); }
    std::vector<std::byte> download() const {
        std::vector<std::byte> result(bytes);
        copy_to_host(result.data(), device, bytes);
        return result;
    }
    AnyView view(Space space) {
        std::byte* const base = space == Space::device ? device : host.data();
        return {base + static_cast<std::size_t>(first) * size_of(type), type, box, row, slice, space};
    }

    DataType type;
    Box box;
    std::int64_t row, slice, first;
    std::size_t bytes;
    std::vector<std::byte> host;
    std::byte* device;
};

void randomise(Twin& volume, unsigned seed) {
    std::mt19937 random(seed);
    AnyView const view = volume.view(Space::host);
    Index3 const n = view.dims();
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                std::byte* const at = view.at(view.box.lower.x + x, view.box.lower.y + y, view.box.lower.z + z);
                auto const r = static_cast<std::uint32_t>(random());
                double const v = static_cast<double>(r) * 100 / 4294967296.0;
                auto const f = static_cast<float>(v);
                Half const h(f);
                std::uint64_t const i = r % 101;
                switch (volume.type) {
                case DataType::float64:
                    std::memcpy(at, &v, 8);
                    break;
                case DataType::float32:
                    std::memcpy(at, &f, 4);
                    break;
                case DataType::float16:
                    std::memcpy(at, &h, 2);
                    break;
                default:
                    std::memcpy(at, &i, size_of(volume.type)); // little-endian
                }
            }
    volume.upload();
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

/// The voxels that an operation wants to see first, so many slices at a time.
void scan(Operation& operation, ConstView in, std::int64_t slab, Execution const& execution) {
    Box const all = operation.scanned(in.box);
    std::int64_t const height = slab > 0 ? slab : all.dims().z;
    do {
        for (std::int64_t z = all.lower.z; z < all.upper.z; z += height) {
            Box part = all;
            part.lower.z = z;
            part.upper.z = std::min(z + height, all.upper.z);
            operation.scan(in.part(part), execution);
        }
        operation.scan_end();
    } while (operation.scans_again());
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

/// As on the command line.
std::unique_ptr<Operation> operation_of(std::vector<std::string> words) {
    std::string name = words.front();
    std::size_t taken = 1;
    if (name == "filter") name += " " + words[taken++];
    words.erase(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(taken));
    auto operation = make_operation(name);
    Parameters parameters;
    operation->parameters(parameters);
    (void)read_words(words, {&parameters});
    operation->check();
    return operation;
}
std::vector<std::string> words_of(std::string const& line) { return split(line, ' '); }

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
                for (char const* const what : {"max", "min", "mean", "sum", "std"})
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
                    for (char const* const words : {"label", "label --connectivity 18", "label --connectivity 26",
                                                    "label --connectivity 26 --keep-largest 2 --dtype uint8",
                                                    "label --min-size 4 --roi 1:,:,1:"}) {
                        if (dims.z < 2 && std::strstr(words, "roi") != nullptr) continue;
                        if (dims.x < 2 && std::strstr(words, "roi") != nullptr) continue;
                        auto const label = operation_of(words_of(words));
                        compare(*label, in, words + that, -1, block > 1 ? 0 : 3);
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

double milliseconds(std::function<void()> const& run) {
    device_synchronize();
    auto const begin = std::chrono::steady_clock::now();
    run();
    device_synchronize();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

/// The best of some: what is planned before the voxels are asked for, once for all of a volume, stands by itself.
struct Milliseconds {
    double planned = 1e30, run = 1e30;
};
Milliseconds best_ms(std::function<void()> const& plan, std::function<void()> const& run) {
    Milliseconds best;
    for (int i = 0; i < 8; ++i) {
        double const planned = milliseconds(plan), ran = milliseconds(run);
        if (i > 0) best = {std::min(best.planned, planned), std::min(best.run, ran)};
    }
    return best;
}

/// An operation as on the command line, on a cube of zeros and what lies around it.
template <class Line> void time_words(std::vector<std::string> words, DataType type, std::int64_t n, Line const& line) {
    std::string what;
    for (std::string const& word : words) what += (what.empty() ? "" : " ") + word;
    if (!is_wanted(what)) return;
    auto const operation = operation_of(std::move(words));
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Header const output = begun(*operation, std::vector<Header>{header}).output;
    Box const box = box_of(output.dims), need = operation->footprint(box, 0);
    Execution const execution = gpu();
    Buffer in_memory(static_cast<std::size_t>(need.voxels()) * size_of(type)), out_memory(output.bytes());
    device_clear(in_memory.write(Space::device), in_memory.bytes());
    ConstView const in = dense_view(in_memory.read(Space::device), type, need, Space::device);
    AnyView const out = dense_view(out_memory.write(Space::device), output.dtype, box, Space::device);
    Milliseconds const ms = best_ms(
        [&] {
            (void)begun(*operation, std::vector<Header>{header}); // forgets what is kept
            operation->fit(output.dims, execution);
        },
        [&] {
            operation->run({&in, 1}, out, execution);
        });
    line(what, ms, static_cast<double>(in.bytes()) + static_cast<double>(out.bytes()));
}

/// A reduction of a cube of 200 values in no order, or of one.
template <class Line>
void time_scan(Operation& reduction, std::string const& what, DataType type, std::int64_t n, Line const& line) {
    if (!is_wanted(what)) return;
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Buffer memory(header.bytes());
    for (bool const constant : {false, true}) {
        std::vector<std::byte> part(std::size_t{1} << 22);
        std::mt19937 random(1);
        for (std::size_t at = 0; at < part.size(); at += size_of(type)) {
            VoxelBytes const voxel = voxel_bytes(type, constant ? 7.0 : 1.0 + static_cast<double>(random() % 200));
            std::memcpy(part.data() + at, voxel.data(), size_of(type));
        }
        std::byte* const to = memory.write(Space::device);
        for (std::size_t at = 0; at < header.bytes(); at += part.size())
            copy_to_device(to + at, part.data(), std::min(part.size(), header.bytes() - at));
        ConstView const in = dense_view(static_cast<std::byte const*>(to), type, box_of(header.dims), Space::device);
        Milliseconds const ms = best_ms([&] { (void)begun(reduction, std::vector<Header>{header}); },
                                        [&] {
                                            do {
                                                reduction.scan(in, gpu());
                                                reduction.scan_end();
                                            } while (reduction.scans_again());
                                        });
        line(what + (constant ? ", constant" : ""), ms, static_cast<double>(header.bytes()));
    }
}

/// Blobs: noise on a lattice, linear in between, above what leaves about this share.
void fill_blobs(std::vector<std::uint8_t>& voxels, std::int64_t n, std::int64_t cell, double level) {
    auto const at = [](std::int64_t x, std::int64_t y, std::int64_t z) {
        auto h = static_cast<std::uint64_t>(x * 73856093 ^ y * 19349663 ^ z * 83492791);
        h = (h ^ h >> 31) * 0x9e3779b97f4a7c15u;
        return static_cast<double>(h >> 40) * 0x1p-24;
    };
#pragma omp parallel for
    for (std::int64_t z = 0; z < n; ++z)
        for (std::int64_t y = 0; y < n; ++y)
            for (std::int64_t x = 0; x < n; ++x) {
                std::int64_t const i = x / cell, j = y / cell, k = z / cell;
                auto const of = [cell](std::int64_t a, std::int64_t b) {
                    return static_cast<double>(a - b * cell) / static_cast<double>(cell);
                };
                double const u = of(x, i), v = of(y, j), w = of(z, k);
                double sum = 0;
                for (int c = 0; c < 8; ++c)
                    sum += at(i + c % 2, j + c / 2 % 2, k + c / 4) * (c % 2 != 0 ? u : 1 - u) *
                           (c / 2 % 2 != 0 ? v : 1 - v) * (c / 4 != 0 ? w : 1 - w);
                voxels[static_cast<std::size_t>((z * n + y) * n + x)] = sum > level ? 1 : 0;
            }
}

/// What takes as long as its input is shaped.
template <class Line> void time_shapes(std::int64_t n, Line const& line) {
    Header header;
    header.dims = {n, n, n};
    header.dtype = DataType::uint8;
    std::vector<std::uint8_t> voxels(header.bytes());
    Buffer in_memory(header.bytes()), out_memory(4 * header.bytes());
    auto const fill = [&](std::string const& what) {
        auto const set = [&](auto const& inside) {
#pragma omp parallel for
            for (std::int64_t i = 0; i < n * n * n; ++i) {
                auto h = static_cast<std::uint64_t>(i) * 0x9e3779b97f4a7c15u;
                h = (h ^ h >> 29) * 0xbf58476d1ce4e5b9u;
                double const random = static_cast<double>((h ^ h >> 32) >> 11) * 0x1p-53;
                voxels[static_cast<std::size_t>(i)] = inside(i % n, i / n % n, i / n / n, random) ? 1 : 0;
            }
        };
        using I = std::int64_t;
        if (what == "blobs") fill_blobs(voxels, n, 12, 0.6);
        if (what == "many blobs") fill_blobs(voxels, n, 6, 0.5);
        if (what == "30 % noise") set([](I, I, I, double r) { return r < 0.3; });
        if (what == "50 % noise") set([](I, I, I, double r) { return r < 0.5; });
        if (what == "checkerboard") set([](I x, I y, I z, double) { return (x + y + z) % 2 == 0; });
        if (what == "comb") set([n](I x, I y, I z, double) { return x % 2 == 0 || (y == n - 1 && z == n - 1); });
        if (what == "all but one") set([](I x, I y, I z, double) { return x + y + z > 0; });
        if (what == "all but the middle")
            set([n](I x, I y, I z, double) { return x != n / 2 || y != n / 2 || z != n / 2; });
        if (what == "ball")
            set([n](I x, I y, I z, double) {
                I const h = n / 2;
                return (x - h) * (x - h) + (y - h) * (y - h) + (z - h) * (z - h) < h * h;
            });
        if (what == "20 sites") set([n](I, I, I, double r) { return r > 20.0 / static_cast<double>(n * n * n); });
        copy_to_device(in_memory.write(Space::device), voxels.data(), voxels.size());
    };
    auto const time = [&](std::string const& words, std::string const& what) {
        if (!is_wanted(words)) return;
        auto const operation = operation_of(words_of(words));
        Header const output = begun(*operation, std::vector<Header>{header}).output;
        ConstView const in =
            dense_view(in_memory.read(Space::device), header.dtype, box_of(header.dims), Space::device);
        AnyView const out =
            dense_view(out_memory.write(Space::device), output.dtype, box_of(output.dims), Space::device);
        bool scans = false;
        Milliseconds const ms = best_ms([&] { scans = begun(*operation, std::vector<Header>{header}).scans; },
                                        [&] {
                                            if (scans) scan(*operation, in, 0, gpu());
                                            operation->run({&in, 1}, out, gpu());
                                        });
        line(words + ", " + what, ms, static_cast<double>(in.bytes() + out.bytes()));
    };
    for (char const* const what : {"blobs", "many blobs", "30 % noise", "50 % noise", "checkerboard", "comb",
                                   "all but one", "all but the middle", "ball", "20 sites"}) {
        fill(what);
        if (std::strstr(what, "all") == nullptr && std::strcmp(what, "20 sites") != 0)
            for (char const* const words : {"label", "label --connectivity 18", "label --connectivity 26"})
                time(words, what);
        time("distance", what);
    }
    time("distance --signed", "20 sites");
}

/// What is timed at 256^3, of noise.
template <class Line> void time_small(DataType type, Line const& line) {
    Header header;
    header.dims = {256, 256, 256};
    header.dtype = type;
    Twin noise(type, box_of(header.dims), 0);
    Buffer out_memory(header.bytes());
    bool filled = false;
    for (char const* const words : {"clahe", "filter nlmeans --strength 9 --search 3"}) {
        if (!is_wanted(words)) continue;
        if (!filled) randomise(noise, 5);
        filled = true;
        auto const operation = operation_of(words_of(words));
        Header const output = begun(*operation, std::vector<Header>{header}).output;
        Box const box = box_of(output.dims), need = operation->footprint(box, 0);
        Twin around(type, need, 0);
        fill_border(around.view(Space::device), box_of(header.dims), header.dims, Boundary::clamp, 0, gpu());
        ConstView const in = ConstView(noise.view(Space::device));
        ConstView const grown = need == box_of(header.dims) ? in : ConstView(around.view(Space::device));
        AnyView const out = dense_view(out_memory.write(Space::device), output.dtype, box, Space::device);
        bool scans = false;
        Milliseconds const ms = best_ms([&] { scans = begun(*operation, std::vector<Header>{header}).scans; },
                                        [&] {
                                            if (scans) scan(*operation, in, 0, gpu());
                                            operation->fit(output.dims, gpu());
                                            operation->run({&grown, 1}, out, gpu());
                                        });
        line(std::string(words) + " 256^3", ms, static_cast<double>(in.bytes() + out.bytes()));
    }
}

void time_all() {
    if (std::FILE* const cube = std::fopen("cube.txt", "w")) {
        std::fputs("3 3 3", cube);
        for (int i = 0; i < 27; ++i) std::fprintf(cube, " %d", i * i % 11);
        std::fclose(cube);
    }
    std::printf("\n%-44s %8s %10s %10s %8s %8s\n", "operation", "type", "planned", "ms", "TB/s", "of copy");
    for (DataType const type : {DataType::uint8, DataType::float32})
        time_small(type, [type](std::string const& what, Milliseconds const& ms, double moved) {
            std::printf("%-44s %8s %10.3f %10.3f %8.2f\n", what.c_str(), std::string(name_of(type)).c_str(), ms.planned,
                        ms.run, moved / ms.run * 1e-9);
        });
    for (std::int64_t n : {512, 1024})
        for (DataType type : {DataType::float32, DataType::uint16, DataType::uint8}) {
            Header header;
            header.dims = {n, n, n};
            header.dtype = type;
            std::size_t const bytes = header.bytes();
            std::byte* const from = device_allocate(bytes);
            std::byte* const to = device_allocate(bytes);
            device_clear(from, bytes);
            Milliseconds const copied = best_ms([] {}, [&] { copy_on_device(to, from, bytes); });
            auto line = [&](std::string const& what, Milliseconds const& ms, double moved) {
                std::printf("%-44s %8s %10.3f %10.3f %8.2f %8.2f\n", (what + " " + to_text(n) + "^3").c_str(),
                            std::string(name_of(type)).c_str(), ms.planned, ms.run, moved / ms.run * 1e-9,
                            moved / ms.run / (2 * static_cast<double>(bytes) / copied.run));
            };
            line("copy", copied, 2 * static_cast<double>(bytes));
            auto time = [&](Operation& operation, std::string const& what) {
                if (!is_wanted(what)) return;
                Header const output = begun(operation, std::vector<Header>{header}).output;
                Box const box = box_of(output.dims), need = operation.footprint(box, 0);
                ConstView const in = ConstView(dense_view(from, type, box_of(header.dims), Space::device)).part(need);
                AnyView const out = dense_view(to, output.dtype, box, Space::device);
                Execution const execution = gpu();
                Milliseconds const ms = best_ms(
                    [&] {
                        (void)begun(operation, std::vector<Header>{header}); // forgets kept planes
                        operation.fit(output.dims, execution);
                    },
                    [&] {
                        operation.run({&in, 1}, out, execution);
                    });
                double const read = what == "fill" ? 0 : static_cast<double>(in.bytes());
                line(what, ms, read + static_cast<double>(out.bytes()));
            };
            Fill fill(1);
            time(fill, "fill");
            Flip x(Axis::x), y(Axis::y), z(Axis::z);
            time(x, "flip x");
            time(y, "flip y");
            time(z, "flip z");
            Crop crop(Roi{"1:-2,1:,1:"});
            time(crop, "crop, off alignment");
            Crop half(Roi{"25%:75%,25%:75%,25%:75%"});
            time(half, "crop to the middle");
            Gaussian gaussian({2, 2, 2});
            time(gaussian, "gaussian sigma 2");
            Resample resample;
            resample.dims = Index3{n / 2, n / 2, n / 2};
            time(resample, "resample to half");
            for (std::vector<std::string> words :
                 {words_of("permute zyx"), words_of("permute yxz"), words_of("permute xzy"),
                  words_of("pad --by 8:8,8:8,8:8 --boundary mirror"), words_of("rotate --axis z --angle 20"),
                  words_of("rotate --axis 1,2,3 --angle 20"), words_of("rotate --axis 1,2,3 --angle 20 --method cubic"),
                  words_of("filter kernel cube.txt"), words_of("filter sobel"), words_of("filter box --radius 2"),
                  words_of("filter median --radius 1"), words_of("filter gaussian --sigma 8"),
                  words_of("morphology erode --radius 2 --shape box"), words_of("threshold --above 1"),
                  words_of("arith add - 3"), words_of("convert --dtype uint8")})
                time_words(std::move(words), type, n, line);
            Statistics statistics;
            time_scan(statistics, "stats", type, n, line);
            Histogram histogram;
            time_scan(histogram, "histogram", type, n, line);
            auto const known = operation_of(words_of("histogram --range 0:256"));
            time_scan(*known, "histogram --range 0:256", type, n, line);
            for (char const* const words :
                 {"project max --axis z", "project max --axis y", "project max --axis x", "project mean --axis z",
                  "project mean --axis x", "project std --axis z", "project std --axis x"}) {
                auto const project = operation_of(words_of(words));
                time_scan(*project, words, type, n, line);
            }
            time_words({"scan"}, type, n, line);
            if (n == 512 && type == DataType::uint8) time_shapes(n, line);
            device_free(from);
            device_free(to);
        }
}

} // namespace

int main(int argc, char** argv) {
    try {
        if (device_count() == 0) {
            std::fprintf(stderr, "skipped: this machine has no CUDA device\n");
            return skipped;
        }
        std::string const only = argc > 1 ? argv[1] : "";
        for (int i = 2; i < argc; ++i) only_with.emplace_back(argv[i]);
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
