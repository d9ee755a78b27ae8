// Values by way of physical ones.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/paste.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct Remapped {
    double slope, intercept, to_slope, to_intercept;
    VKT_HD double operator()(double v) const { return (slope * v + intercept - to_intercept) / to_slope; }
};

} // namespace

void paste_mapped(ConstView in, AnyView out, ValueMap const& from, ValueMap const& to, Losses& losses,
                  Execution const& execution) {
    map<double>(execution, out, losses, Remapped{from.slope, from.intercept, to.slope, to.intercept}, in);
}

} // namespace VKT_BACKEND
} // namespace vkt
