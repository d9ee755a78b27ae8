// Storing floats of which some stand for no value.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/background.h"

#include "libvkt/kernel/kernel.h"

namespace vkt::VKT_BACKEND {
namespace {

struct OrBackground {
    double background;
    VKT_HD double operator()(double v) const { return v == v ? v : background; }
    VKT_HD bool undefined(double v) const { return v != v; }
};

} // namespace

void store_or_background(ConstView in, AnyView out, double background, Losses& losses, Execution const& execution) {
    map<double>(execution, out, losses, OrBackground{background}, in);
}

} // namespace vkt::VKT_BACKEND
