// Drawing on a GPU: what rays see is copied there once, and pixels come back.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/render/environment.h"
#include "libvkt/render/image.h"
#include "libvkt/render/passes.h"
#include "libvkt/render/tiles.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace vkt::render {

/// An array of the host on the current GPU, which has to outlive it and must not change.
Buffer copied_to_device(void const* host, std::size_t bytes);
template <class T> T const* on_device(Buffer& buffer) { return reinterpret_cast<T const*>(buffer.read(Space::device)); }

/// Arrays of the host that are wanted on the GPU. They have to outlive it and must not change.
class DeviceCopies {
public:
    DeviceCopies() = default;
    /// With the lattice's voxels, so many bytes.
    DeviceCopies(LatticeView const& lattice, std::size_t bytes);
    LatticeView lattice();

    /// The scene with its cells, table, knots and labels on the GPU. They are copied when `made_for`, which keeps them
    /// alive, is another than the last time; the same goes for the environment, which may be null.
    SceneView scene(SceneView const& scene, std::shared_ptr<void const> const& made_for,
                    std::shared_ptr<Environment const> const& environment);

private:
    LatticeView lattice_;
    Buffer voxels_, lowest_, majorant_, distance_, depth_, nodes_, knots_, labels_, pixels_, row_ends_, column_ends_;
    std::shared_ptr<void const> made_for_;
    std::shared_ptr<Environment const> environment_;
};

/// Rows of a part that are drawn at once: of its bands, which are rows_of_band high, every step-th from `first` on.
struct Bands {
    Tile part{};
    int first = 0, step = 1;

    /// How many there are.
    VKT_HD int count() const {
        int const all = (part.y1 - part.y0 + rows_of_band - 1) / rows_of_band;
        return all > first ? (all - first + step - 1) / step : 0;
    }
    /// The first row of one of them.
    VKT_HD int row(int band) const { return part.y0 + (first + band * step) * rows_of_band; }

    static constexpr int rows_of_band = 16;
};

/// A launch for a scene whose arrays, like the volume that it draws, are memory of the current GPU: the pixels of
/// some bands, four floats each, and the four totals to which rays, segments, samples and capped paths are added.
using Launch = std::function<void(SceneView const& scene, Bands const& bands, float* pixels, std::uint64_t* totals)>;

/// A GPU that draws, the scene with arrays in its memory, and how it is launched there.
struct DrawingGpu {
    int gpu = 0;
    SceneView scene;
    Launch launch;
};

/// Draws the part of a drawing, each GPU some of its rows. Paths are drawn some at a time, until the watch says stop;
/// sums that the scenes name are of the host, and are brought up to date. `estimates`: of paths, the error is wanted.
/// Adds to the counters, and to the seconds that the GPUs were busy. The same pixels for any number of GPUs.
Quality draw_on_gpus(Drawing const& drawing, std::vector<DrawingGpu> const& gpus, Integrator integrator, bool estimates,
                     Image& image, Counters& total, double& seconds);

/// One launch: everything that scene and volume point to is memory of the current GPU.
void launch_drawing(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Bands const& bands,
                    float* pixels, std::uint64_t* totals);
void launch_drawing(SceneView const& scene, TreeView const& tree, Integrator integrator, Bands const& bands,
                    float* pixels, std::uint64_t* totals);

} // namespace vkt::render
