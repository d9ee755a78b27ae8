// Smooth edges: pixels that differ from one beside them, and then more rays through these.
// SPDX-License-Identifier: MIT
#include "libvkt/render/edges.h"

#include "libvkt/render/crew.h"
#include "libvkt/render/levels.h"

#include <array>
#include <cmath>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace vkt::render {

namespace {

class Edges {
public:
    Edges(Drawing const& drawing, Image& image, Counters& total)
        : drawing_(drawing), image_(image), crew_(drawing, total), clear_(drawing.background.alpha < 1),
          wide_((image.width + tile_side - 1) / tile_side), high_((image.height + tile_side - 1) / tile_side),
          found_(static_cast<std::size_t>(wide_) * static_cast<std::size_t>(high_)) {
        Levels const levels(drawing.background);
        for (std::size_t c = 0; c < 3; ++c) behind_[c] = static_cast<float>(levels.behind(c));
    }

    void draw(int rays, Image const* fine, Quality& quality) {
        // Rows beside a part are those of another one.
        int const first = drawing_.scene.frame.top, last = first + image_.height;
        if (first > 0) above_ = row(first - 1);
        if (last < static_cast<int>(drawing_.scene.frame.height)) below_ = row(last);
        tiles(1, 0, [&](Tile const& tile, Found& found, Counters&) { find(tile, found); });
        SceneView scene = drawing_.scene;
        scene.rays = rays;
        tiles(1, 0, [&](Tile const& tile, Found& found, Counters& counters) {
            for (std::uint8_t const place : found) {
                int const x = tile.x0 + place % tile_side, y = tile.y0 + place / tile_side;
                if (fine != nullptr)
                    std::copy_n(fine->at(x, y), 4, image_.pixels.begin() + (fine->at(x, y) - fine->pixels.data()));
                else
                    drawing_.draw(scene, {x, y, x + 1, y + 1}, image_.pixels.data(), counters);
            }
        });
        double count = 0;
        for (Found const& found : found_) count += static_cast<double>(found.size());
        quality.edges = count / (static_cast<double>(image_.width) * image_.height);
        quality.rays = 1 + (rays - 1) * quality.edges;
        quality.stopped = quality.stopped || crew_.stopped();
    }

private:
    using Found = std::vector<std::uint8_t>; ///< places in a tile, row by row

    /// A row of the whole picture, of one ray a pixel.
    std::vector<float> row(int y) const {
        std::vector<float> pixels(4 * static_cast<std::size_t>(image_.width));
        SceneView scene = drawing_.scene;
        scene.frame.top = y;
        Counters counters; // of what is not in the picture
        drawing_.draw(scene, {0, 0, image_.width, 1}, pixels.data(), counters);
        return pixels;
    }

    template <class Body> void tiles(double share, double width, Body const& body) {
        crew_.work(static_cast<std::int64_t>(found_.size()), true, share, width, [&](std::int64_t i, Counters& all) {
            int const x = static_cast<int>(i % wide_) * tile_side, y = static_cast<int>(i / wide_) * tile_side;
            body({x, y, std::min(x + tile_side, image_.width), std::min(y + tile_side, image_.height)},
                 found_[static_cast<std::size_t>(i)], all);
        });
    }

    using Shown = std::array<float, 4>;
    /// What a pixel looks like: square roots of light, which displays and eyes are close to, and alpha.
    Shown shown(float const* light) const {
        Shown result;
        for (std::size_t c = 0; c < 3; ++c) result[c] = std::sqrt(std::max(light[c] + light[3] * behind_[c], 0.0F));
        result[3] = clear_ ? light[3] : 0.0F;
        return result;
    }
    static bool differ(Shown const& a, Shown const& b) {
        constexpr auto most = static_cast<float>(levels_of_edge / 255);
        float apart = 0;
        for (std::size_t c = 0; c < 4; ++c) apart = std::max(apart, std::abs(a[c] - b[c]));
        return apart > most;
    }

    /// A pixel, also of the rows beside the part; beyond the picture's edge the nearest one.
    float const* pixel(int x, int y) const {
        auto const u = static_cast<std::size_t>(std::clamp(x, 0, image_.width - 1));
        if (y < 0 && !above_.empty()) return &above_[4 * u];
        if (y >= image_.height && !below_.empty()) return &below_[4 * u];
        return image_.at(static_cast<int>(u), std::clamp(y, 0, image_.height - 1));
    }

    void find(Tile const& tile, Found& found) const {
        constexpr std::size_t side = tile_side + 2;
        std::array<Shown, side * side> around;
        auto const at = [&](int x, int y) -> Shown& {
            int const row = y - tile.y0 + 1, column = x - tile.x0 + 1;
            return around[static_cast<std::size_t>(row) * side + static_cast<std::size_t>(column)];
        };
        for (int y = tile.y0 - 1; y <= tile.y1; ++y)
            for (int x = tile.x0 - 1; x <= tile.x1; ++x) at(x, y) = shown(pixel(x, y));
        for (int y = tile.y0; y < tile.y1; ++y)
            for (int x = tile.x0; x < tile.x1; ++x) {
                Shown const& here = at(x, y);
                if (differ(here, at(x - 1, y)) || differ(here, at(x + 1, y)) || differ(here, at(x, y - 1)) ||
                    differ(here, at(x, y + 1)))
                    found.push_back(static_cast<std::uint8_t>((y - tile.y0) * tile_side + (x - tile.x0)));
            }
    }

    Drawing const& drawing_;
    Image& image_;
    Crew crew_;
    std::array<float, 3> behind_{};    ///< linear
    bool clear_;                       ///< the background
    int wide_, high_;                  ///< in tiles
    std::vector<Found> found_;         ///< of each
    std::vector<float> above_, below_; ///< rows beside the part; empty at the picture's own edge
};

} // namespace

void smooth_edges(Drawing const& drawing, int rays, Image const* fine, Image& image, Counters& total,
                  Quality& quality) {
    Edges(drawing, image, total).draw(rays, fine, quality);
}

} // namespace vkt::render
