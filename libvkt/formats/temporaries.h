// Names of temporary files that must not outlive the process, for file systems without unnamed files.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt {

/// Remembers a temporary file until it is forgotten. Beyond 64 at a time it is not remembered, and only removed by its
/// owner. Returns the slot.
int remember_temporary(std::string const& path);
void forget_temporary(int slot);

/// Removes every remembered file. Async-signal-safe: a program calls it from its handler of fatal signals.
void remove_temporaries() noexcept;

} // namespace vkt
