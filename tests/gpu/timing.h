// Times every operation that runs on a GPU on volumes that lie there, against the bandwidth of copies.
// SPDX-License-Identifier: MIT
#pragma once

namespace vkt::gpu_test {

/// Prints a line for each operation, size and type that is_wanted().
void time_all();

} // namespace vkt::gpu_test
