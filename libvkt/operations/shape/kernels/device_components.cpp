// Only GPUs do it so; see libvkt/operations/shape/components.h for CPUs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/device_components.h"

#include "libvkt/core/device.h"

namespace vkt::VKT_BACKEND {

void component_bits(DeviceComponents&, ConstView, std::optional<double>, Execution const&) { throw_without_cuda(); }
void component_numbers(DeviceComponents&, Execution const&) { throw_without_cuda(); }
void component_facts(DeviceComponents&, std::vector<ComponentFacts>&, Execution const&) { throw_without_cuda(); }
void component_labels(DeviceComponents&, AnyView, Execution const&) { throw_without_cuda(); }
void component_values(DeviceComponents&, ConstView, Execution const&) { throw_without_cuda(); }
void component_paint(DeviceComponents&, AnyView, Execution const&) { throw_without_cuda(); }

} // namespace vkt::VKT_BACKEND
