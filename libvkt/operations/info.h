// What is known about a volume without its voxels: the header, and what a tree consists of.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tree.h"
#include "libvkt/engine/operation.h"

#include <optional>
#include <string>

namespace vkt {

/// Reports the header of each volume; of hierarchical ones also bricks and cells by level.
class Info : public Operation {
public:
    bool head = false; ///< only of the first volume, of which nothing more is read

    std::string_view name() const override { return "info"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    void parameters(Parameters& p) override;
    Plan plan(std::span<Header const> inputs) override;
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override;

private:
    std::optional<TreeSummary> tree_of_next_file(std::string const& name, Execution const& execution);

    std::size_t file_ = 0; ///< of the inputs, the next to look for a tree in
};

} // namespace vkt
