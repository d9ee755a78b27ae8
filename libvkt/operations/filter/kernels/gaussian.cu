// Gaussian on the GPU: the passes of gaussian_device.h for the type at hand.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/gaussian_device.h"

namespace vkt::VKT_BACKEND {
namespace {

template <class T, class C>
void run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses&, Execution const&) {
    gaussian::Launcher<T, C>(passes, planes, in, out).run();
}

} // namespace

void gaussian_run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
                  Execution const& execution) {
    if (out.box.empty()) return;
    with_type(out.type, [&]<class T>(T) {
        if constexpr (std::is_same_v<compute_t<T>, double>)
            run<T, double>(passes, planes, in, out, losses, execution);
        else if (passes.wide)
            run<T, double>(passes, planes, in, out, losses, execution);
        else
            run<T, float>(passes, planes, in, out, losses, execution);
    });
}

} // namespace vkt::VKT_BACKEND
