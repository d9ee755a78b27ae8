// One pipeline, several times: each instance computes some of the slices, on a GPU of its own, and they come out as
// one.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/source.h"

#include <memory>
#include <vector>

namespace vkt {

/// A pipeline that works by itself, and its operations in their order.
struct Share {
    std::unique_ptr<Source> source;
    std::vector<Operation*> operations;
};

/// What each of the shares yields, equal pipelines on equal inputs: slabs are computed by the shares in turn, in
/// threads, and kept until they are asked for; each share keeps two at most, and all of them no more than half of
/// execution.memory. The same bytes and remarks as one share alone makes. Volumes that cannot be divided, see
/// Source::divisible(), are left to the first share, and all after them, too.
std::unique_ptr<Source> divided(std::vector<Share> shares, Execution const& execution);

/// The execution of one of so many shares: threads and memory are divided.
Execution share_of(Execution execution, int shares);

/// The same input for several shares. Its volumes are kept as a whole, in memory up to a share of the budget and in a
/// file beyond, as soon as there are several and the first of them reads.
class SharedInput {
public:
    SharedInput(std::unique_ptr<Source> source, Execution const& execution);
    ~SharedInput();
    /// A source that reads it. The first of them moves on to the next volume; the others follow.
    std::unique_ptr<Source> reader();

private:
    class Reader;
    struct State;
    std::shared_ptr<State> state_;
};

} // namespace vkt
