// A sliding, padded copy of a source's region: keeps the slices it shares with the last request, fills borders.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/source.h"

#include <algorithm>

namespace vkt {

/// Reads to.box of a source to `to`, whichever of them lies on a GPU; `staging` is for what cannot go there directly.
void read_across(Source& source, AnyView to, Buffer& staging, Execution const& execution);

/// How a window continues outside its volume, and where it lies.
struct WindowRule {
    Index3 volume_dims;
    DataType type = DataType::uint8;
    Boundary boundary = Boundary::clamp;
    double border_value = 0;
    std::size_t most_bytes = 0; ///< of the largest region that will be asked for, if that is known
    /// Slices before the first that the first region reaches, and beyond the last that the last one does. Those of the
    /// volume that stand for them are kept.
    std::int64_t slices_below = 0, slices_above = 0;

    /// `footprint`: of the whole output.
    void expect(Box const& footprint) {
        slices_below = std::max<std::int64_t>(-footprint.lower.z, 0);
        slices_above = std::max<std::int64_t>(footprint.upper.z - volume_dims.z, 0);
    }
    /// A region with the slices that it or later ones mirror, which a source that only goes forward would not give
    /// again.
    Box with_mirrored(Box region) const {
        if (boundary != Boundary::mirror) return region;
        if (slices_below > 0) region.upper.z = std::max(region.upper.z, std::min(volume_dims.z, slices_below));
        if (slices_above > 0)
            region.lower.z = std::min(region.lower.z, std::max<std::int64_t>(volume_dims.z - slices_above, 0));
        return region;
    }
};

/// Regions that reach outside the volume are filled by the boundary rule here and nowhere else: kernels test no border.
class Window {
public:
    /// Forgets what it holds (a new volume begins).
    void reset(WindowRule const& rule) {
        rule_ = rule;
        forget();
    }
    /// The next region is read anew, all of it.
    void forget() { held_ = {}; }
    /// A view that covers `region`, read from the source (slices already held are not read again).
    ConstView fetch(Source& source, Box const& region, Execution const& execution);

private:
    /// The region and the columns from which its outside is folded: a part of a wrapped volume needs its far side, of
    /// which whole rows are read where they belong instead.
    Box with_fold_sources(Box region) const;
    void shift_to(Box const& region, Box const& kept, Space space);
    void read_slices(Source& source, std::int64_t z0, std::int64_t z1, std::int64_t from_z, Execution const& execution);
    void read_part(Source& source, Box const& part, Index3 target, Execution const& execution);
    void fill_outer_slices(Source& source, std::int64_t kept0, std::int64_t kept1, Execution const& execution);
    AnyView view(Box const& part) const { return whole_.part(part); }

    WindowRule rule_;
    Buffer buffer_, spare_, staging_;
    AnyView whole_;
    Box held_; ///< what the window holds, borders included
};

} // namespace vkt
