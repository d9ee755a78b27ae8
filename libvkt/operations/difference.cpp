// Comparing rows, merging them in order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/difference.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/wide.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/window.h"
#include "libvkt/operations/kernels/difference.h"

#include <cmath>
#include <limits>
#include <vector>

namespace vkt {

namespace {

/// One source's slabs, in place or copied, where they are compared.
class Slabs {
public:
    Slabs(Source& source, Execution const& on) : source_(source), on_(on) {
        window_.reset({.volume_dims = source.header().dims, .type = source.header().dtype});
        source.expect(box_of(source.header().dims));
    }
    ConstView at(Box const& box) {
        if (auto const lent = source_.borrow(box); lent && lent->space == on_.space()) return *lent;
        return window_.fetch(source_, box, on_);
    }

private:
    Source& source_;
    Execution on_;
    Window window_;
};

} // namespace

DifferenceResult compare(Source& a, Source& b, Execution const& execution) {
    Header const& ha = a.header();
    Header const& hb = b.header();
    if (ha.kind != Kind::structured || hb.kind != Kind::structured)
        throw Error(ErrorKind::usage, "one of the volumes is hierarchical",
                    "make it a grid first: vkt resample --cells 50M");
    DifferenceResult r;
    r.same_dims = ha.dims == hb.dims;
    r.same_type = ha.dtype == hb.dtype;
    r.same_geometry = r.same_dims && same_place(ha, hb);
    double low = std::numeric_limits<double>::infinity(), high = -low;
    long double squares = 0;
    if (r.same_dims) {
        Index3 const n = ha.dims;
        Execution const on = where_looked_at(execution, a.space() == Space::device && b.space() == Space::device);
        Cut const cut = cut_of(ha, slab_hint_on(on, ha, a.natural_slab()), on);
        Slabs slabs_a(a, on), slabs_b(b, on);
        std::vector<RowDifference> rows;
        for_each_piece(box_of(n), cut, [&](Box const& box) {
            SlabPair const pair{slabs_a.at(box), slabs_b.at(box), ha.values, hb.values};
            std::int64_t const ny = box.dims().y;
            rows.resize(static_cast<std::size_t>(ny * box.dims().z));
            difference_rows(pair, rows.data(), on);
            for (std::size_t i = 0; i < rows.size(); ++i) {
                RowDifference const& row = rows[i];
                auto const at = static_cast<std::int64_t>(i);
                if (row.differing > 0 && r.differing == 0)
                    r.first = {row.first, box.lower.y + at % ny, box.lower.z + at / ny};
                r.differing += row.differing;
                r.max_abs = std::max(r.max_abs, row.max_abs);
                squares += row.squares;
                low = std::min(low, row.low);
                high = std::max(high, row.high);
            }
        });
        r.count = ha.voxels();
        long double const rmse = std::sqrt(squares / static_cast<long double>(r.count));
        long double const range = high > low ? static_cast<long double>(high) - low : 0;
        r.rmse = static_cast<double>(rmse);
        r.range = static_cast<double>(range);
        r.psnr =
            rmse > 0 ? static_cast<double>(20 * std::log10(range / rmse)) : std::numeric_limits<double>::infinity();
    }
    a.finish();
    b.finish();
    return r;
}

} // namespace vkt
