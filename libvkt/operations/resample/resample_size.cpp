// Sizes of resampled volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/resample_size.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>

namespace vkt {

WantedDims ValueText<WantedDims>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> parts = w.size() == 1 ? split(w.front(), ',') : w;
    std::int64_t given = 0;
    for (auto& part : parts) {
        if (part == "auto") {
            part = "0";
            continue;
        }
        ++given;
        if (part == "0") throw Error(ErrorKind::usage, text(name, ": 0 is not a positive number of voxels"));
    }
    if (given == 0)
        throw Error(ErrorKind::usage, text(name, " gives no axis a number of voxels"),
                    "for example --dims 512,auto,auto");
    Index3 const dims = ValueText<Index3>::read(parts, name);
    if (std::min({dims.x, dims.y, dims.z}) < 0)
        throw Error(ErrorKind::usage, text(name, ": ", dims, " are not positive numbers of voxels"));
    return dims;
}

std::vector<std::string> ValueText<WantedDims>::write(WantedDims v) {
    std::vector<std::string> words(3, "auto");
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (std::int64_t const n = v.value[static_cast<int>(axis)]; n != 0) words[axis] = to_text(n);
    return words;
}

CellCount ValueText<CellCount>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string number = w.front();
    double factor = 1;
    if (!number.empty()) {
        char const unit = number.back();
        factor = unit == 'k' || unit == 'K' ? 1e3 : unit == 'M' ? 1e6 : unit == 'G' ? 1e9 : 1;
        if (factor > 1) number.pop_back();
    }
    double const count = ValueText<double>::read({number}, name) * factor;
    if (!(count >= 1 && count <= 1e15))
        throw Error(ErrorKind::usage, text(name, ": ", w.front(), " is not a number of cells"),
                    "for example --cells 50M");
    return {static_cast<std::int64_t>(std::llround(count))};
}

std::int64_t rounded_extent(double voxels) {
    double const n = std::floor(voxels + 0.5);
    if (!(n < static_cast<double>(max_extent)))
        throw Error(ErrorKind::usage, text("the result would have ", voxels, " voxels along an axis"));
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(n));
}

Index3 filled_in(Index3 wanted, Index3 dims) {
    double factor = 0;
    for (int axis = 0; axis < 3; ++axis) {
        if (wanted[axis] == 0) continue;
        double const here = static_cast<double>(wanted[axis]) / static_cast<double>(dims[axis]);
        factor = factor == 0 ? here : std::min(factor, here);
    }
    for (int axis = 0; axis < 3; ++axis)
        if (wanted[axis] == 0) wanted[axis] = rounded_extent(static_cast<double>(dims[axis]) * factor);
    return wanted;
}

void check_wanted(Header const& output) {
    try {
        check(output);
    } catch (Error const& error) {
        throw Error(ErrorKind::usage, error.what(), error.hint());
    }
}

} // namespace vkt
