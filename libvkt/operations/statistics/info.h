// What is known about a volume without its voxels: the header, and what a tree consists of.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tree.h"
#include "libvkt/engine/operation.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Reports the header of each volume; of hierarchical ones also bricks and cells by level.
class Info : public Operation {
public:
    std::vector<std::string> files;
    bool head = false; ///< only of the first volume, of which nothing more is read

    std::string_view name() const override { return "info"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return static_cast<int>(input_names().size()); }
    std::vector<std::string> input_names() const override {
        return files.empty() ? std::vector<std::string>{"-"} : files;
    }
    void parameters(Parameters& p) override;
    Plan plan(std::span<Header const> inputs) const override;
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override;

private:
    void measure_input(Source& source, std::string const& name, Measurement& to);
    std::optional<TreeSummary> tree_of_next_file(std::string const& name, Execution const& execution);

    std::size_t file_ = 0; ///< of an input, the next to look for a tree in
};

} // namespace vkt
