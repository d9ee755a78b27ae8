// Parts, pastes and calls for volkit's names.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace vkt::volkit {
namespace {

struct Format {
    vktDataFormat format;
    char const* name;
    std::size_t size;
};
constexpr std::array<Format, 7> formats{{{vktDataFormatInt8, "int8", 1},
                                         {vktDataFormatInt16, "int16", 2},
                                         {vktDataFormatInt32, "int32", 4},
                                         {vktDataFormatUInt8, "uint8", 1},
                                         {vktDataFormatUInt16, "uint16", 2},
                                         {vktDataFormatUInt32, "uint32", 4},
                                         {vktDataFormatFloat32, "float32", 4}}};

Format const* find(vktDataFormat format) {
    auto const* const found =
        std::find_if(formats.begin(), formats.end(), [&](Format const& f) { return f.format == format; });
    return found == formats.end() ? nullptr : found;
}

std::vector<char const*> pointers(std::vector<std::string> const& words) {
    std::vector<char const*> result;
    result.reserve(words.size());
    for (std::string const& word : words) result.push_back(word.c_str());
    return result;
}

} // namespace

void fail(vktError error, Error const& why) {
    (void)c::attempted([&] { throw why; });
    throw Failed{error};
}

void attempt(std::function<void()> const& body) noexcept {
    (void)c::attempted([&] {
        try {
            body();
        } catch (Failed const&) { // vkt_error() knows
        }
    });
}

vktError run(char const* name, std::function<void()> const& body) noexcept {
    auto const begin = std::chrono::steady_clock::now();
    vktError result = vktNoError;
    bool const fine = c::attempted([&] {
        if (lacks_gpu())
            throw Error(ErrorKind::resources, "the thread's execution policy asks for a GPU, and there is none to use",
                        "vktSetThreadExecutionPolicy() with vktExecutionPolicyDeviceCPU");
        try {
            body();
        } catch (Failed const& failed) {
            result = failed.error;
        }
    });
    if (prints_performance()) {
        std::chrono::duration<double, std::milli> const time = std::chrono::steady_clock::now() - begin;
        std::fprintf(stderr, "%s: %.3f ms\n", name, time.count());
    }
    return fine ? result : vktInvalidValue;
}

bool& prints_performance() {
    thread_local bool wanted = false;
    return wanted;
}

bool& lacks_gpu() {
    thread_local bool lacking = false;
    return lacking;
}

vktStructuredVolume needed(vktStructuredVolume volume, char const* argument) {
    c::need(volume, argument);
    return volume;
}

Owned applied(std::vector<std::string> const& words, std::initializer_list<vkt_volume const*> inputs) {
    vkt_volume* result = nullptr;
    auto const list = pointers(words);
    if (vkt_apply(list.data(), list.size(), inputs.begin(), inputs.size(), &result) != VKT_OK) throw Failed{};
    return Owned(result);
}

std::string measured(std::vector<std::string> const& words, vkt_volume const* input) {
    char* json = nullptr;
    auto const list = pointers(words);
    if (vkt_measure(list.data(), list.size(), &input, 1, &json) != VKT_OK) throw Failed{};
    std::string text = json;
    vkt_free_text(json);
    return text;
}

vkt_description description_of(vkt_volume const* volume) {
    vkt_description description;
    if (vkt_describe(volume, &description) != VKT_OK) throw Failed{};
    return description;
}

Index3 dims_of(vkt_volume const* volume) {
    vkt_description const d = description_of(volume);
    return {d.dims[0], d.dims[1], d.dims[2]};
}

char const* name_of(vktDataFormat format) {
    if (Format const* const found = find(format)) return found->name;
    throw Error(ErrorKind::usage, text("there is no data format ", static_cast<int>(format)));
}

std::size_t size_of(vktDataFormat format) {
    Format const* const found = find(format);
    return found == nullptr ? 0 : found->size;
}

std::unique_ptr<vktStructuredVolume_impl> made(Index3 dims, vktDataFormat format, vktVec3f_t dist, float low,
                                               float high) {
    std::vector<std::string> words{"declare-sv",
                                   "--dims=" + text(dims.x, ",", dims.y, ",", dims.z),
                                   "--dtype",
                                   name_of(format),
                                   "--dist",
                                   to_text(double{dist.x}),
                                   to_text(double{dist.y}),
                                   to_text(double{dist.z})};
    if (format != vktDataFormatFloat32) words.push_back("--voxel-mapping=" + text(double{low}, ",", double{high}));
    auto result = std::make_unique<vktStructuredVolume_impl>();
    result->volume = applied(words);
    result->format = format;
    result->low = low;
    result->high = high;
    return result;
}

std::unique_ptr<vktStructuredVolume_impl> made_like(vktStructuredVolume volume, Index3 dims) {
    vkt_description const d = description_of(volume->volume.get());
    return made(dims, volume->format,
                {static_cast<float>(d.spacing[0]), static_cast<float>(d.spacing[1]), static_cast<float>(d.spacing[2])},
                volume->low, volume->high);
}

void take(vktStructuredVolume to, Owned volume) {
    to->volume = std::move(volume);
    to->own = false;
}

std::uint8_t* writable(vktStructuredVolume volume) {
    void const* voxels = nullptr;
    if (vkt_voxels(volume->volume.get(), &voxels, nullptr) != VKT_OK) throw Failed{};
    if (!volume->own) {
        vkt_description const d = description_of(volume->volume.get());
        vkt_volume* copy = nullptr;
        if (vkt_create(&d, voxels, &copy) != VKT_OK) throw Failed{};
        volume->volume.reset(copy);
        volume->own = true;
        if (vkt_voxels(copy, &voxels, nullptr) != VKT_OK) throw Failed{};
    }
    return static_cast<std::uint8_t*>(const_cast<void*>(voxels)); // of a volume that this one alone has
}

std::string triple(double x, double y, double z) { return text(x, ",", y, ",", z); }

std::string region(Box const& box) {
    return text(box.lower.x, ":", box.upper.x, ",", box.lower.y, ":", box.upper.y, ",", box.lower.z, ":", box.upper.z);
}

Owned part_of(vkt_volume const* volume, Box const& box) {
    if (box.empty()) return nullptr;
    Index3 const n = dims_of(volume);
    Index3 below, above;
    bool outside = false;
    for (int axis = 0; axis < 3; ++axis) {
        below[axis] = std::max<std::int64_t>(0, -box.lower[axis]);
        above[axis] = std::max<std::int64_t>(0, box.upper[axis] - n[axis]);
        outside = outside || below[axis] > 0 || above[axis] > 0;
    }
    if (!outside) return applied({"crop", "--roi", region(box)}, {volume});
    Owned const padded = applied({"pad", "--by", region({below, above}), "--boundary", "clamp"}, {volume});
    return applied({"crop", "--roi", region({box.lower + below, box.upper + below})}, {padded.get()});
}

void paste(vktStructuredVolume to, vkt_volume const* part, Index3 at) {
    if (part == nullptr) return;
    Box const place{at, at + dims_of(part)};
    Box const inside = intersect(place, box_of(dims_of(to->volume.get())));
    if (inside.empty()) return;
    Owned cut;
    if (inside != place) {
        cut = applied({"crop", "--roi", region({inside.lower - at, inside.upper - at})}, {part});
        part = cut.get();
    }
    std::string const where = text(inside.lower.x, ",", inside.lower.y, ",", inside.lower.z);
    take(to, applied({"copy", "-", "-", "--at=" + where}, {part, to->volume.get()}));
}

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

} // namespace vkt::volkit

void vktAllocate(void** ptr, size_t size) {
    if (ptr != nullptr) *ptr = std::malloc(size);
}
void vktFree(void* ptr) { std::free(ptr); }
void vktMemcpy(void* dst, void const* src, size_t size, vktCopyKind) {
    if (size > 0) std::memcpy(dst, src, size);
}
