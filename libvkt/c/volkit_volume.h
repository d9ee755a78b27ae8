// What volkit's names are made of: volumes that change in place, and calls of vkt.h whose failures are thrown.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/c/volkit.h"
#include "libvkt/core/error.h"
#include "libvkt/core/geometry.h"

#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

struct FreeVolume {
    void operator()(vkt_volume* volume) const { vkt_free(volume); }
};

struct vktStructuredVolume_impl {
    std::unique_ptr<vkt_volume, FreeVolume> volume{};
    vktDataFormat format = vktDataFormatUnspecified;
    float low = 0, high = 1;
    bool own = false; ///< nobody else can have the voxels: they may be written where they lie
};

namespace vkt::volkit {

using Owned = std::unique_ptr<vkt_volume, FreeVolume>;

/// A call of vkt.h failed; vkt_error() knows why.
struct Failed {
    vktError error = vktInvalidValue;
};

/// Another failure, which vkt_error() then tells. Throws Failed.
[[noreturn]] void fail(vktError error, Error const& why);

/// Runs the body of a function and prints how long it took, if the thread wants that.
vktError run(char const* name, std::function<void()> const& body) noexcept;
/// For functions without a status.
void attempt(std::function<void()> const& body) noexcept;
/// Whether this thread wants times.
bool& prints_performance();
/// Whether this thread asked for a GPU that cannot be used: then algorithms fail instead of running elsewhere.
bool& lacks_gpu();

/// Throws Error{usage} for null.
vktStructuredVolume needed(vktStructuredVolume volume, char const* argument);

/// vkt_apply(). Throws Failed.
Owned applied(std::vector<std::string> const& words, std::initializer_list<vkt_volume const*> inputs = {});
/// vkt_measure().
std::string measured(std::vector<std::string> const& words, vkt_volume const* input);
vkt_description description_of(vkt_volume const* volume);
Index3 dims_of(vkt_volume const* volume);

char const* name_of(vktDataFormat format); ///< throws Error{usage}
std::size_t size_of(vktDataFormat format); ///< 0 if it is none

/// Stored zeros of a type, and what they stand for. Throws.
std::unique_ptr<vktStructuredVolume_impl> made(Index3 dims, vktDataFormat format, vktVec3f_t dist, float low,
                                               float high);
/// Zeros of other extents.
std::unique_ptr<vktStructuredVolume_impl> made_like(vktStructuredVolume volume, Index3 dims);
/// What an operation made becomes the volume's.
void take(vktStructuredVolume to, Owned volume);
/// The stored voxels, to be written.
std::uint8_t* writable(vktStructuredVolume volume);

/// [first, last); throws Error{usage} where it ends before it begins.
Box range(int32_t x, int32_t y, int32_t z, int32_t endX, int32_t endY, int32_t endZ);
Box whole(vktStructuredVolume volume);
/// The part of a region that the volume has.
Box within(Box const& box, vktStructuredVolume volume);

/// Words of numbers: "1.5,2,3", "0:4,0:4,0:4".
std::string triple(double x, double y, double z);
std::string region(Box const& box);

/// A box of a volume, which may reach beyond it, where the border voxels go on. Null of an empty box.
Owned part_of(vkt_volume const* volume, Box const& box);
/// Writes a part into a volume as far as it has voxels there; values are kept.
void paste(vktStructuredVolume to, vkt_volume const* part, Index3 at);

} // namespace vkt::volkit
