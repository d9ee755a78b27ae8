// Counting in bins of equal width on GPUs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/bins.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/bin_of.h"
#include "libvkt/operations/statistics/kernels/device_counts.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct RuleSlot {
    BinRule rule;
    /// The first slot is for what is not finite.
    template <class T> VKT_DEVICE int operator()(T value) const { return static_cast<int>(bin_of(value, rule)) + 1; }
};

} // namespace

void count_bins(ConstView in, BinRule const& rule, std::int64_t* counters, Execution const&) {
    with_type(in.type, [&]<class T>(T) {
        auto const slots = static_cast<std::size_t>(rule.count) + 1;
        driver::DeviceCounters const found(slots);
        driver::count_on_device<T>(in, {in.box, {1, 1, 1}}, RuleSlot{rule}, slots, found.get());
        std::vector<std::uint64_t> const counts = found.on_host();
        for (std::size_t i = 1; i < counts.size(); ++i) counters[i - 1] += static_cast<std::int64_t>(counts[i]);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
