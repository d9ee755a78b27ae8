// Connected components of a volume in device memory. What Components does for rows that come on CPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/shape/kernels/component_facts.h"

#include <optional>
#include <vector>

namespace vkt {

/// What lies in device memory: a bit a voxel, 4 bytes for 32 voxels, 4 a run of voxels; where values matter, another
/// bit a voxel and 8 bytes a run. Where voxels touch at corners and values do not matter, runs are those of two by two
/// rows together: what lies next to one another there belongs together.
struct DeviceComponents {
    Index3 dims;
    int connectivity = 6;
    bool holes = false;               ///< zero voxels form components, others do not
    bool by_value = false;            ///< only equal values belong together
    std::int64_t count = 0;           ///< components, once they are numbered
    std::int64_t nan = 0;             ///< voxels so far
    Buffer bits;                      ///< 32 voxels of a row a word
    Buffer changed;                   ///< as bits are, if values matter: which differ from the voxel to the left
    std::vector<Buffer> run_values;   ///< … and 8 bytes a run, of what came together
    std::vector<std::int64_t> runs;   ///< … how many these are
    Buffer before;                    ///< runs before each word of the rows that they are of
    Buffer component;                 ///< of each run, from 0
    Buffer first;                     ///< 8 bytes a component: where the bit of its first voxel is
    Buffer values;                    ///< 8 bytes a component, see component_values()
    std::vector<std::uint32_t> names; ///< of components; if there are none they are numbered from 1
};

/// Which of these voxels form components: those that are neither zero nor NaN, or zero. Rows may come in any
/// order; where values matter, in x-fastest order, whole slices or rows of one.
VKT_KERNEL(component_bits,
           (DeviceComponents & components, ConstView rows, std::optional<double> zero, Execution const& execution),
           (components, rows, zero, execution))
/// Once all rows have come: components get numbers by their first voxel in x-fastest order. Throws Error{resources} for
/// 2^32 runs or more.
VKT_KERNEL(component_numbers, (DeviceComponents & components, Execution const& execution), (components, execution))
/// What there is to know of all components but for `value_before`.
VKT_KERNEL(component_facts,
           (DeviceComponents & components, std::vector<ComponentFacts>& facts, Execution const& execution),
           (components, facts, execution))
/// The names of the voxels of out.box, whole rows of the volume; 0 for those of no component.
VKT_KERNEL(component_labels, (DeviceComponents & components, AnyView out, Execution const& execution),
           (components, out, execution))
/// Keeps, for components whose first voxel follows one of these in x-fastest order, the value of that one.
VKT_KERNEL(component_values, (DeviceComponents & components, ConstView rows, Execution const& execution),
           (components, rows, execution))
/// Voxels of out.box, whole rows, get the value of their component if that has a name.
VKT_KERNEL(component_paint, (DeviceComponents & components, AnyView out, Execution const& execution),
           (components, out, execution))

} // namespace vkt
