// Checks, headers and layers of regions.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/region_write.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <utility>

namespace vkt {

std::int64_t checked_volume(RegionTarget const& target, Header const& part, WriteOptions const& options,
                            std::int64_t written) {
    auto const refuse = [&](std::string const& what, std::string const& hint) {
        throw Error(ErrorKind::usage, text("'", target.name, "' ", what), hint);
    };
    Header const& whole = target.whole;
    if (target.volumes > 1 && !options.at_volume)
        refuse(text("has ", target.volumes, " volumes, and it is not said which of them is written to"),
               "say --index N, counted from 0; further volumes go into those behind it");
    std::int64_t const number = options.at_volume.value_or(0) + written;
    if (number >= target.volumes)
        refuse(
            text("has ", target.volumes, target.volumes == 1 ? " volume" : " volumes", ", and none of number ", number),
            "they are counted from 0");
    Index3 const lower = *options.at;
    if (Box const box{lower, lower + part.dims}; !box_of(whole.dims).contains(box))
        refuse(text("has ", whole.dims, " voxels, in which the part of ", part.dims, " at ", lower, " does not lie"),
               "cut it with 'vkt crop'");
    if (part.dtype != whole.dtype)
        refuse(text("is ", whole.dtype, ", and the part ", part.dtype), text("vkt convert --dtype ", whole.dtype));
    if (!(part.values == whole.values))
        refuse(text("holds values as ", whole.values.slope, " * stored + ", whole.values.intercept,
                    ", and the part as ", part.values.slope, " * stored + ", part.values.intercept),
               text("let 'vkt copy' convert them: vkt copy PART ", shell_quoted(target.name), " --at ... -o OUT"));
    return number;
}

Header with_part(RegionTarget const& target, Header const& part, Index3 at) {
    Header whole = target.whole;
    VolumeError error = whole.error.kind < part.error.kind ? part.error : whole.error;
    error.at_most = std::max(whole.error.at_most, part.error.at_most);
    error.values.reset();
    if (whole.error.values && part.error.values)
        error.values = whole.error.values->with(part.error.values->low).with(part.error.values->high);
    whole.error = error;
    // As that of the command that makes the same of two volumes; of one volume among several there is none.
    if (part.history && whole.history && target.volumes == 1)
        whole.history = History{{"copy", "-", "<(…)", "--at", to_text(at.x), to_text(at.y), to_text(at.z)},
                                {*part.history, *whole.history}};
    else
        whole.history.reset();
    return whole;
}

void RegionLayers::begin(Header const& part, Index3 at, std::int64_t depth, std::size_t most) {
    dims_ = part.dims;
    at_ = at;
    row_ = static_cast<std::size_t>(dims_.x) * size_of(part.dtype);
    most_ = std::max(most, row_);
    depth_ = std::min(depth, static_cast<std::int64_t>(most_ / (row_ * static_cast<std::size_t>(dims_.y))));
    rows_ = 0;
}

void RegionLayers::add(std::byte const* voxels, std::size_t n,
                       std::function<void(Box const&, std::byte const*)> const& flush) {
    while (n > 0) {
        // Up to where the next layer of chunks begins; of large slices some rows, which do not go on in the next slice.
        std::int64_t const slice = rows_ / dims_.y, done = rows_ % dims_.y;
        std::int64_t rows = std::min(dims_.y - done, static_cast<std::int64_t>(most_ / row_)), slices = 1;
        if (depth_ > 0) {
            slices = std::min(depth_ - (at_.z + slice) % depth_, dims_.z - slice);
            rows = dims_.y;
        }
        std::size_t const full = static_cast<std::size_t>(rows * slices) * row_,
                          count = std::min(n, full - held_.size());
        held_.insert(held_.end(), voxels, voxels + count);
        voxels += count;
        n -= count;
        if (held_.size() < full) return;
        Index3 const lower = at_ + Index3{0, done, slice};
        flush({lower, lower + Index3{dims_.x, rows, slices}}, held_.data());
        rows_ += rows * slices;
        held_.clear();
    }
}

} // namespace vkt
