// What an operation does to a hierarchical volume, by its shape, and what these ways have in common; of TreeRun only.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/brick_sequence.h"
#include "libvkt/engine/tree_run.h"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace vkt {

class TreeRun::Work {
public:
    Work() = default;
    virtual ~Work() = default;
    Work(Work const&) = delete;
    Work& operator=(Work const&) = delete;

    Plan plan;
    virtual BrickSequence bricks(Header header, std::shared_ptr<Work> const& self) = 0;
    virtual std::vector<Remark> remarks() const = 0;
};

/// Brick by brick, or in long rows, as bricks come. Inputs are the same tree.
std::shared_ptr<TreeRun::Work> pointwise_work(Operation& operation, std::vector<BrickSequence> inputs, Plan plan,
                                              Execution const& execution, StageInfo const& info);
/// Level by level, with ghost cells.
std::shared_ptr<TreeRun::Work> neighbourhood_work(Operation& operation, BrickSequence input, Execution const& execution,
                                                  StageInfo const& info, TreeOptions const& options);

/// All bricks of a sequence once, for a scan, where that runs.
void scan_bricks(Operation& operation, BrickSequence& bricks, Execution const& execution, StageTimes* times);

/// Throws Error{usage}: no meaning on a hierarchical volume.
[[noreturn]] void refuse_tree(Operation const& operation, std::string const& why);

/// The header of a result on the input's tree.
Header tree_header(Operation const& operation, Plan const& plan, Header const& input);

std::vector<Header> headers_of(std::vector<BrickSequence> const& inputs);

/// Threads pay only where there are enough cells; smaller bricks are run by the calling thread.
Execution execution_for(Box const& box, Execution const& execution);

/// Where cells are worked on: on the GPU if that is asked for and the operation, which has begun, runs there. Throws
/// Error{usage} if nothing else would do.
Execution where_run(Operation const& operation, Execution execution);
/// The same of scans of a tree; cells of a background are left out on the host.
Execution where_scanned(Operation const& operation, Header const& tree, Execution execution);

/// Bytes of cells that are worked on at once, unless a brick has more.
std::size_t group_limit(Execution const& execution);

} // namespace vkt
