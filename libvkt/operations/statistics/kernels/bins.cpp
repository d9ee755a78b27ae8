// Counting in bins: every thread for itself, in four sets of counters where they are few.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/bins.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/bin_of.h"

#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Voxels that are equal would wait for each other's counter.
constexpr std::int64_t sets = 4;

/// A thread's counters. A type of this back end, lest its vector is one that others may link.
struct Share {
    std::vector<std::int64_t> counters;
};

template <class T>
void count_rows(View<T const> in, Box const& box, BinRule const& rule, std::int64_t* counters,
                Execution const& execution) {
    bool const few = rule.count <= 4096;
    auto const stride = static_cast<std::size_t>(rule.count + 1); // the first counts what is not finite
    std::vector<Share> shares(static_cast<std::size_t>(std::max(1, execution.threads)));
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        auto& share = shares[static_cast<std::size_t>(omp_get_thread_num())].counters;
        if (share.empty()) share.resize(stride * (few ? sets : 1));
        std::int64_t* const to = share.data() + 1;
        T const* const row = &in(x, y, z);
        auto const step = static_cast<std::int64_t>(few ? stride : 0);
        for (std::int64_t i = 0; i < n; ++i) ++to[(i % sets) * step + bin_of(row[i], rule)];
    });
    for (auto const& share : shares)
        for (std::size_t i = 0; i < share.counters.size(); ++i)
            if (i % stride != 0) counters[i % stride - 1] += share.counters[i];
}

} // namespace

void count_bins(ConstView in, BinRule const& rule, std::int64_t* counters, Execution const& execution) {
    Box const box = driver::dense(in.box, in) && !in.box.empty() ? driver::as_one_row(in.box) : in.box;
    with_type(in.type, [&]<class T>(T) { count_rows<T>(in.as<T>(), box, rule, counters, execution); });
}

} // namespace VKT_BACKEND
} // namespace vkt
