// Volumes in memory through one operation slab by slab, as a pipeline does it: what is measured to predict seconds.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"
#include "libvkt/engine/pipeline.h"

#include <memory>
#include <string>
#include <vector>

namespace vkt::shell {

/// An operation of the registry with its options read: {"filter", "box", "--radius", "2"}, of which the name is the
/// first two words.
std::unique_ptr<Operation> configured(std::string const& name, std::vector<std::string> const& words);

/// So many times; what comes out goes nowhere.
void pass_through(Operation& operation, std::vector<Volume> const& inputs, std::size_t times, int threads,
                  StageInfo const& info = {});

/// Of all threads of this process. Where one computes alone, these are the seconds that it takes on a processor of its
/// own, whatever others do on the machine.
double processor_seconds();

} // namespace vkt::shell
