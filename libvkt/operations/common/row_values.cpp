// Rows as numbers.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/row_values.h"

#include "libvkt/kernel/rows.h"

namespace vkt {

void read_row(ConstView view, std::int64_t y, std::int64_t z, double* to) {
    baseline::load_row(view.type, view.at(view.box.lower.x, y, z), to, view.dims().x);
}

} // namespace vkt
