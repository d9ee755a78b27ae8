// Ray marching with fewer rays and longer steps: corners of blocks, then what they leave open.
// SPDX-License-Identifier: MIT
#include "libvkt/render/sparse.h"

#include "libvkt/render/crew.h"
#include "libvkt/render/levels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

namespace vkt::render {

namespace {

constexpr int side = 4;               ///< of a block, in pixels
constexpr int per_tile = 16 / side;   ///< blocks of a tile, each way
constexpr double longest_segment = 4; ///< voxels; what samplers are made for
constexpr int most_doublings = 3;     ///< of the step

/// Levels of linear light by a table, to 1e-4 of one: many are asked for.
class Curve {
public:
    Curve() {
        for (std::size_t i = 0; i < table_.size(); ++i)
            table_[i] = static_cast<float>(255 * linear_to_srgb(static_cast<double>(std::bit_cast<float>(
                                                     first + static_cast<std::uint32_t>(i) * node))));
    }
    float operator()(float light) const {
        constexpr float least = 0x1p-9F; // of the part that is a straight line
        if (!(light > least)) return light > 0 ? 255 * 12.92F * light : 0.0F;
        if (light >= 1) return 255;
        std::uint32_t const bits = std::bit_cast<std::uint32_t>(light) - first;
        float const share = static_cast<float>(bits % node) * (1.0F / node);
        std::size_t const i = bits / node;
        return table_[i] + (table_[i + 1] - table_[i]) * share;
    }

private:
    static constexpr std::uint32_t first = 0x3b000000, node = 1U << 17; // 2^-9, and 64 nodes for twice the light
    std::array<float, 9 * 64 + 1> table_;
};

using Levels3 = std::array<float, 3>;
float apart(Levels3 const& a, Levels3 const& b) {
    return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

/// Weights of four equidistant numbers at a share of the way from the second to the third.
std::array<float, 4> cubic_weights(float t) {
    float const t2 = t * t, t3 = t2 * t;
    return {0.5F * (-t + 2 * t2 - t3), 0.5F * (2 - 5 * t2 + 3 * t3), 0.5F * (t + 4 * t2 - 3 * t3), 0.5F * (t3 - t2)};
}

class Sparse {
public:
    Sparse(Drawing const& drawing, double tolerance, Image& image, Counters& total)
        : drawing_(drawing), image_(image), crew_(drawing, total), tolerance_(static_cast<float>(tolerance)),
          first_row_(drawing.scene.frame.top), last_row_(first_row_ + image.height), nx_((image.width - 1) / side),
          ny_((static_cast<int>(drawing.scene.frame.height) - 1) / side), first_(first_row_ / side),
          last_((last_row_ + side - 1) / side), corner_rows_{std::max(0, first_ - sparse_halo / side),
                                                             std::min(ny_, last_ + sparse_halo / side) + 1} {
        Levels const levels(drawing.background);
        for (std::size_t c = 0; c < 3; ++c) behind_[c] = static_cast<float>(levels.behind(c));
        for (int k = 0; k < side; ++k) weights_[k] = cubic_weights(static_cast<float>(k) / side);
        std::size_t const corners = index(nx_, corner_rows_.last - 1) + 1;
        level_.resize(corners);
        doublings_.resize(corners);
        bend_.resize(corners);
        blocks_.resize(corners); // the last of a row and of a column are cut off by the picture's edge
        hold(corner_rows_.first * side, std::max(last_row_, (corner_rows_.last - 1) * side + 1));
        coarse_.resize(image.pixels.size());
        for (int k = 0; k <= most_doublings; ++k) {
            scenes_.push_back(drawing.scene);
            scenes_.back().step = std::ldexp(drawing.scene.step, k);
            scenes_.back().frame.top = top_;
            if (static_cast<double>(scenes_.back().step) <= longest_segment) most_ = k;
        }
    }

    Quality draw(Savings& savings) {
        // Corners that have to do with the part, and blocks.
        tiles(corner_rows_, nx_ + 1, 2 * per_tile, 0, 0.2,
              [&](int i, int j, Counters& counters, Tally&) { draw_corner(i, j, counters); });
        for (int j = corner_rows_.first; j < corner_rows_.last; ++j)
            for (int i = 0; i <= nx_; ++i) bend_[index(i, j)] = bend(i, j);
        Range const near{std::max(0, first_ - 1), std::min(ny_, last_ + 1)};
        tiles(near, nx_, per_tile, 0.2, 0.1,
              [&](int i, int j, Counters& counters, Tally&) { look_at(i, j, counters); });
        Range const own{first_, std::min(ny_ + 1, last_)};
        Tally const all = tiles(own, nx_ + 1, per_tile, 0.3, 0.7,
                                [&](int i, int j, Counters& counters, Tally& tally) { finish(i, j, counters, tally); });
        hold(first_row_, last_row_);
        Quality q;
        q.stopped = crew_.stopped();
        double const pixels = static_cast<double>(image_.width) * image_.height;
        double const drawn = static_cast<double>(all.drawn), filled = static_cast<double>(all.filled);
        q.undrawn = std::max(0.0, 1 - (drawn + filled) / pixels);
        q.rays = drawn / pixels;
        savings = {filled / pixels, drawn > 0 ? static_cast<double>(all.longer) / drawn : 0};
        return q;
    }

private:
    struct Range {
        int first, last;
    };
    struct Block {
        int doublings = 0; ///< of the step
        bool bends = true; ///< too much to be looked at
        float missed = 0;  ///< by the cubic in the middle, in levels; 0 where it bends
    };
    /// Pixels of the part: with rays, of these those with longer steps only, without rays.
    struct Tally {
        std::int64_t drawn = 0, longer = 0, filled = 0;
    };

    /// Makes the image hold these rows of the picture.
    void hold(int first, int last) {
        auto const floats = [&](int rows) { return 4 * static_cast<std::ptrdiff_t>(rows) * image_.width; };
        image_.pixels.reserve(static_cast<std::size_t>(floats(last - std::min(first, top_))));
        if (first < top_)
            image_.pixels.insert(image_.pixels.begin(), static_cast<std::size_t>(floats(top_ - first)), 0.0F);
        else
            image_.pixels.erase(image_.pixels.begin(), image_.pixels.begin() + floats(first - top_));
        top_ = first;
        image_.height = last - first;
        image_.pixels.resize(static_cast<std::size_t>(floats(image_.height)));
    }

    // Rows are those of the picture.
    std::size_t index(int i, int j) const {
        return static_cast<std::size_t>(j - corner_rows_.first) * static_cast<std::size_t>(nx_ + 1) +
               static_cast<std::size_t>(i);
    }
    float* pixel(std::vector<float>& pixels, int x, int y) const {
        return pixels.data() + 4 * (static_cast<std::size_t>(y - top_) * static_cast<std::size_t>(image_.width) +
                                    static_cast<std::size_t>(x));
    }
    void draw_pixels(SceneView const& scene, Tile tile, std::vector<float>& pixels, Counters& counters) const {
        drawing_.draw(scene, {tile.x0, tile.y0 - top_, tile.x1, tile.y1 - top_}, pixels.data(), counters);
    }
    Levels3 levels_of(float const* light) const {
        Levels3 levels;
        for (std::size_t c = 0; c < 3; ++c) levels[c] = curve_(light[c] + light[3] * behind_[c]);
        return levels;
    }

    /// body(i, j, counters, tally) for corners or blocks, a square of `across` each way at a time.
    template <class Body>
    Tally tiles(Range rows, int columns, int across, double share, double width, Body const& body) {
        int const wide = (columns + across - 1) / across, high = (rows.last - rows.first + across - 1) / across;
        std::int64_t const count = std::int64_t{std::max(0, wide)} * std::max(0, high);
        std::vector<Tally> tallies(static_cast<std::size_t>(count));
        crew_.work(count, true, share, width, [&](std::int64_t t, Counters& counters) {
            int const i0 = static_cast<int>(t % wide) * across, j0 = rows.first + static_cast<int>(t / wide) * across;
            for (int j = j0; j < std::min(rows.last, j0 + across); ++j)
                for (int i = i0; i < std::min(columns, i0 + across); ++i)
                    body(i, j, counters, tallies[static_cast<std::size_t>(t)]);
        });
        Tally all;
        for (Tally const& t : tallies) all.drawn += t.drawn, all.longer += t.longer, all.filled += t.filled;
        return all;
    }

    void draw_corner(int i, int j, Counters& counters) {
        int const x = side * i, y = side * j;
        Tile const tile{x, y, x + 1, y + 1};
        draw_pixels(scenes_[0], tile, image_.pixels, counters);
        Levels3 const level = levels_of(pixel(image_.pixels, x, y));
        int longest = 0;
        while (longest < most_) {
            draw_pixels(scenes_[static_cast<std::size_t>(longest) + 1], tile, coarse_, counters);
            if (!(apart(levels_of(pixel(coarse_, x, y)), level) <= step_share * tolerance_)) break;
            ++longest;
        }
        level_[index(i, j)] = level;
        doublings_[index(i, j)] = longest;
    }

    /// The largest second difference at a corner.
    float bend(int i, int j) const {
        float most = 0;
        auto const along = [&](std::size_t before, std::size_t here, std::size_t behind) {
            for (std::size_t c = 0; c < 3; ++c)
                most = std::max(most, std::abs(level_[before][c] - 2 * level_[here][c] + level_[behind][c]));
        };
        if (i > 0 && i < nx_) along(index(i - 1, j), index(i, j), index(i + 1, j));
        if (j > corner_rows_.first && j + 1 < corner_rows_.last) along(index(i, j - 1), index(i, j), index(i, j + 1));
        return most;
    }

    /// Which steps a block takes, and, where its corners bend little, whether its middle is as they say.
    void look_at(int i, int j, Counters& counters) {
        Block& block = blocks_[index(i, j)];
        block.doublings = most_;
        float around = 0, own = 0;
        for (int v = std::max(0, j - 1); v <= std::min(ny_, j + 2); ++v)
            for (int u = std::max(0, i - 1); u <= std::min(nx_, i + 2); ++u) {
                std::size_t const at = index(u, v);
                block.doublings = std::min(block.doublings, doublings_[at]);
                around = std::max(around, bend_[at]);
                if (u >= i && u <= i + 1 && v >= j && v <= j + 1) own = std::max(own, bend_[at]);
            }
        if (around > rough * tolerance_) block.doublings = 0;
        block.bends = own > smooth * tolerance_;
        if (block.bends) return;
        int const x = side * i + side / 2, y = side * j + side / 2;
        draw_pixels(scenes_[static_cast<std::size_t>(block.doublings)], {x, y, x + 1, y + 1}, image_.pixels, counters);
        Light between;
        Cubic(*this, i, j).at(side / 2, side / 2, between);
        block.missed = apart(levels_of(between.data()), levels_of(pixel(image_.pixels, x, y)));
    }

    using Light = std::array<float, 4>;
    /// The 16 corners around a block; beyond the picture they go on straight.
    class Cubic {
    public:
        Cubic(Sparse const& sparse, int i, int j) : weights_(sparse.weights_) {
            for (int v = 0; v < 4; ++v)
                for (int u = 0; u < 4; ++u) light_[4 * v + u] = sparse.beyond(i + u - 1, j + v - 1);
        }
        void at(int x, int y, Light& light) const {
            light = {};
            for (std::size_t v = 0; v < 4; ++v)
                for (std::size_t u = 0; u < 4; ++u) {
                    float const w = weights_[static_cast<std::size_t>(y)][v] * weights_[static_cast<std::size_t>(x)][u];
                    for (std::size_t c = 0; c < 4; ++c) light[c] += w * light_[4 * v + u][c];
                }
            for (float& l : light) l = std::max(l, 0.0F);
        }

    private:
        std::array<std::array<float, 4>, side> const& weights_;
        std::array<Light, 16> light_;
    };
    Light beyond(int i, int j) const {
        auto const outside = [&](int a, int last) { return a < 0 ? 1 : a > last ? -1 : 0; };
        if (int const way = outside(i, nx_); way != 0) return straight(beyond(i + way, j), beyond(i + 2 * way, j));
        if (int const way = outside(j, ny_); way != 0) return straight(beyond(i, j + way), beyond(i, j + 2 * way));
        float const* const p = pixel(image_.pixels, side * i, side * j);
        return {p[0], p[1], p[2], p[3]};
    }
    static Light straight(Light const& near, Light const& far) {
        Light light;
        for (std::size_t c = 0; c < 4; ++c) light[c] = 2 * near[c] - far[c];
        return light;
    }

    /// All pixels of a block but its corner, and its middle where that is drawn.
    void finish(int i, int j, Counters& counters, Tally& tally) {
        int const x0 = side * i, y0 = side * j;
        int const x1 = std::min(x0 + side, image_.width), y1 = std::min(y0 + side, last_row_);
        std::int64_t const pixels = std::int64_t{x1 - x0} * (y1 - y0);
        if (i == nx_ || j == ny_) { // no block
            draw_around_corner(scenes_[0], x0, y0, x1, y1, image_.pixels, counters);
            tally.drawn += pixels;
            return;
        }
        Block const& block = blocks_[index(i, j)];
        float missed = 0;
        for (int v = std::max(0, j - 1); v <= std::min(ny_ - 1, j + 1); ++v)
            for (int u = std::max(0, i - 1); u <= std::min(nx_ - 1, i + 1); ++u)
                missed = std::max(missed, blocks_[index(u, v)].missed);
        if (!block.bends && missed <= fill_share * tolerance_) {
            Cubic const cubic(*this, i, j);
            each(x0, y0, x1, y1, [&](int x, int y) {
                Light light;
                cubic.at(x - x0, y - y0, light);
                std::copy_n(light.data(), 4, pixel(image_.pixels, x, y));
            });
            tally.drawn += 2, tally.filled += pixels - 2;
            return;
        }
        SceneView const& scene = scenes_[static_cast<std::size_t>(block.doublings)];
        draw_around_corner(scene, x0, y0, x1, y1, image_.pixels, counters);
        tally.drawn += pixels;
        if (block.doublings == 0) return;
        // Between the corners, in straight lines of levels.
        Levels3 const &a = level_[index(i, j)], &b = level_[index(i + 1, j)], &c = level_[index(i, j + 1)],
                      &d = level_[index(i + 1, j + 1)];
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x) {
                if (x == x0 && y == y0) continue;
                float const fx = static_cast<float>(x - x0) / side, fy = static_cast<float>(y - y0) / side;
                Levels3 expected;
                for (std::size_t k = 0; k < 3; ++k)
                    expected[k] = std::lerp(std::lerp(a[k], b[k], fx), std::lerp(c[k], d[k], fx), fy);
                if (apart(levels_of(pixel(image_.pixels, x, y)), expected) <= surprise * tolerance_) {
                    ++tally.longer;
                    continue;
                }
                draw_pixels(scenes_[0], {x, y, x + 1, y + 1}, image_.pixels, counters);
            }
    }

    /// body(x, y) for the pixels of a block that are not drawn where its middle is.
    template <class Body> static void each(int x0, int y0, int x1, int y1, Body const& body) {
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x) {
                bool const corner = x == x0 && y == y0, middle = x == x0 + side / 2 && y == y0 + side / 2;
                if (!corner && !middle) body(x, y);
            }
    }
    void draw_around_corner(SceneView const& scene, int x0, int y0, int x1, int y1, std::vector<float>& pixels,
                            Counters& counters) const {
        if (x0 + 1 < x1) draw_pixels(scene, {x0 + 1, y0, x1, y0 + 1}, pixels, counters);
        if (y0 + 1 < y1) draw_pixels(scene, {x0, y0 + 1, x1, y1}, pixels, counters);
    }

    // Shares of the tolerance, and multiples of it: chosen by what they make of the tests' scenes and of those of the
    // benchmark.
    static constexpr float step_share = 0.2F, fill_share = 0.12F, smooth = 1.5F, surprise = 2, rough = 60;

    Drawing const& drawing_;
    Image& image_;
    Crew crew_;
    Curve curve_;
    float tolerance_;
    int first_row_, last_row_; ///< of the part
    int nx_, ny_;              ///< blocks; of corners there is one more each way
    int first_, last_;         ///< rows of blocks of the part
    Range corner_rows_;        ///< those that have to do with it
    int top_ = first_row_;     ///< the row that the image begins with
    int most_ = 0;             ///< doublings
    std::array<float, 3> behind_;
    std::array<std::array<float, 4>, side> weights_;
    std::vector<Levels3> level_; ///< of corners
    std::vector<int> doublings_; ///< that a corner allows
    std::vector<float> bend_;
    std::vector<Block> blocks_;
    std::vector<float> coarse_; ///< corners with longer steps
    std::vector<SceneView> scenes_;
};

} // namespace

Quality draw_sparsely(Drawing const& drawing, double tolerance, Image& image, Counters& total, Savings& savings) {
    return Sparse(drawing, tolerance, image, total).draw(savings);
}

} // namespace vkt::render
