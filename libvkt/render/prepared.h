// What a renderer keeps from one picture to the next.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/categories.h"
#include "libvkt/render/device.h"
#include "libvkt/render/device_tree.h"
#include "libvkt/render/render.h"

#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace vkt::render {

/// All that decides a Prepared.
struct PreparedFor {
    Algorithm algorithm;
    std::optional<TransferFunction> transfer;
    std::vector<double> lut;
    std::optional<DataKind> preset;
    std::string colormap, opacity, domain, unit;
    double opacity_scale, shade;
    std::vector<double> isos, iso_colors, iso_opacities;
    std::shared_ptr<Histogram const> chosen_from;
    bool labels, skip;
    friend bool operator==(PreparedFor const&, PreparedFor const&) = default;
};

struct Renderer::Prepared {
    PreparedFor made_for;
    Appearance appearance;
    std::vector<Knot> knots;
    TransferTable table;
    CellVisibility cells;
    Tree::Visibility bricks;
    StoredBlocks blocks; ///< of a tree that is marched through them
};

/// How a picture was drawn.
struct Renderer::Drawn {
    Integrator integrator;
    bool in_passes, sparsely, with_gpu;
    int labels, before; ///< labels in the volume; paths of earlier pictures
    Counters counters;
};

/// What a GPU has of the volume and of the scene.
struct OnGpu {
    std::unique_ptr<DeviceCopies> scene;
    std::unique_ptr<DeviceTree> tree;
};

struct Renderer::Cache {
    std::mutex mutex;
    std::shared_ptr<Prepared const> last;
    std::shared_ptr<Categories const> labels;
    std::int64_t made = 0;
    std::unique_ptr<Renderer const> grid; ///< of the labels of a hierarchical volume
    std::mutex drawing;                   ///< of who draws with the copies
    std::vector<OnGpu> copies;            ///< of each GPU
};

} // namespace vkt::render
