// The macrocells that can be seen, projected: their bounding rectangles, a pixel wider.
// SPDX-License-Identifier: MIT
#include "libvkt/render/screen.h"

#include "libvkt/render/inner/march.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <omp.h>

namespace vkt::render {

namespace {

/// Shares of the frame's forward, right and up that a vector of the lattice is the sum of, as rows.
struct Shares {
    Double3 forward, right, up;
    bool there;
};
Shares shares_of(RayFrame const& f) {
    auto const cross = [](Double3 a, Double3 b) {
        return Double3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    };
    double const volume = dot(f.forward, cross(f.right, f.up));
    double const per = 1 / volume;
    Shares const shares{cross(f.right, f.up) * per, cross(f.up, f.forward) * per, cross(f.forward, f.right) * per,
                        std::isfinite(per)};
    return shares;
}

/// Pixels of rays that meet nothing; `pixels` is the first one of the tile's first row.
void leave_out(SceneView const& view, bool marched, Tile tile, float* pixels, Counters& counters) {
    Ray ray;
    auto const meets = [&](int x, int y) { return make_ray(view.frame, x + 0.5, y + 0.5, view.shown, ray); };
    for (int y = tile.y0; y < tile.y1; ++y, pixels += 4 * static_cast<std::int64_t>(view.frame.width)) {
        // What is shown is convex: between two rays that meet it all do.
        bool const between = !marched && meets(tile.x0, y) && meets(tile.x1 - 1, y);
        for (int x = tile.x0; x < tile.x1; ++x) {
            if (between || meets(x, y)) {
                ++counters.rays;
                if (marched) counters.segments += segments_of(ray, view.step);
            }
            float* const p = pixels + 4 * static_cast<std::int64_t>(x);
            p[0] = p[1] = p[2] = 0, p[3] = 1;
        }
    }
}

} // namespace

Screen::Screen(SceneView const& scene, CellVisibility const& cells, int first, int rows, int threads)
    : width_(static_cast<int>(scene.frame.width)), first_(first), across_((width_ + side - 1) / side) {
    RayFrame const& f = scene.frame;
    // A cell takes about as long as a ray that meets nothing.
    if (cells.visible_count > static_cast<std::int64_t>(width_) * rows / 2) return;
    Shares const shares = shares_of(f);
    if (!shares.there) return;
    std::size_t const count = static_cast<std::size_t>(across_) * static_cast<std::size_t>((rows + side - 1) / side);
    std::vector<std::uint8_t> of_threads(count * static_cast<std::size_t>(threads));
    std::atomic<bool> all{false};
    int const nx = scene.cells.nx, ny = scene.cells.ny, nz = scene.cells.nz;
    constexpr double slack = 0.02, size = macrocell_size + 2 * slack; // voxels: more than positions are rounded by
    double const half_width = f.width / 2, half_height = f.height / 2;
#pragma omp parallel num_threads(threads)
    {
        std::uint8_t* const own = of_threads.data() + count * static_cast<std::size_t>(omp_get_thread_num());
#pragma omp for schedule(dynamic, 1)
        for (int z = 0; z < nz; ++z) {
            for (int y = 0; y < ny; ++y)
                for (int x = 0; x < nx && !all; ++x) {
                    int const cell[3] = {x, y, z};
                    if (cells.distance[static_cast<std::size_t>(scene.cells.index(cell))] != 0) continue;
                    auto const edge = [](int i) {
                        return static_cast<double>(macrocell_origin) + macrocell_size * i - slack;
                    };
                    Double3 const lower{edge(x), edge(y), edge(z)};
                    Double3 const from = lower - f.eye;
                    double left = 1e30, right = -1e30, top = 1e30, bottom = -1e30;
                    bool before = true;
                    for (int corner = 0; corner < 8; ++corner) {
                        Double3 const p =
                            from + Double3{(corner & 1) * size, (corner >> 1 & 1) * size, (corner >> 2) * size};
                        double const depth = dot(shares.forward, p);
                        before = before && depth > 0;
                        double const per = f.perspective ? 1 / depth : 1;
                        double const px = (dot(shares.right, p) * per + 1) * half_width,
                                     py = (1 - dot(shares.up, p) * per) * half_height - first;
                        left = std::min(left, px), right = std::max(right, px);
                        top = std::min(top, py), bottom = std::max(bottom, py);
                    }
                    if (f.perspective && !before) {
                        all = true;
                        break;
                    }
                    auto const square = [](double pixel, int last) {
                        return static_cast<int>(std::clamp(pixel, 0.0, static_cast<double>(last)) / side);
                    };
                    if (!(left < width_ + 1 && right > -1 && top < rows + 1 && bottom > -1)) continue;
                    int const x0 = square(left - 1, width_ - 1), x1 = square(right + 1, width_ - 1);
                    for (int row = square(top - 1, rows - 1); row <= square(bottom + 1, rows - 1); ++row)
                        std::fill_n(own + static_cast<std::ptrdiff_t>(row) * across_ + x0, x1 - x0 + 1,
                                    std::uint8_t{1});
                }
        }
    }
    if (all) return;
    seen_.assign(of_threads.begin(), of_threads.begin() + static_cast<std::ptrdiff_t>(count));
    for (std::size_t i = count; i < of_threads.size(); ++i) seen_[i % count] |= of_threads[i];
}

void Screen::draw(SceneView const& view, bool marched, Tile tile, float* pixels, Counters& counters,
                  std::function<void(Tile)> const& draw) const {
    if (seen_.empty()) return draw(tile);
    int const down = view.frame.top - first_; // from rows of the view to those of the squares
    for (int y = tile.y0, y1; y < tile.y1; y = y1) {
        int const square = (y + down) / side;
        y1 = std::min(tile.y1, (square + 1) * side - down);
        std::uint8_t const* const row = seen_.data() + static_cast<std::ptrdiff_t>(square) * across_;
        for (int x = tile.x0, x1; x < tile.x1; x = x1) {
            std::uint8_t const seen = row[x / side];
            x1 = x;
            while (x1 < tile.x1 && row[x1 / side] == seen) x1 = std::min(tile.x1, (x1 / side + 1) * side);
            Tile const part{x, y, x1, y1};
            if (seen != 0)
                draw(part);
            else
                leave_out(view, marched, part, pixels + 4 * static_cast<std::int64_t>(y) * width_, counters);
        }
    }
}

} // namespace vkt::render
