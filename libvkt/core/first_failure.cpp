// Keeping and throwing again.
// SPDX-License-Identifier: MIT
#include "libvkt/core/first_failure.h"

namespace vkt {

FirstFailure::FirstFailure() = default;
FirstFailure::~FirstFailure() = default;

void FirstFailure::keep() noexcept {
    std::lock_guard const lock(mutex_);
    if (!first_) first_ = std::current_exception();
}

void FirstFailure::rethrow() const {
    if (first_) std::rethrow_exception(first_);
}

} // namespace vkt
