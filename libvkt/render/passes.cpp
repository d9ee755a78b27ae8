// Pictures drawn in passes: who is drawn next, error estimates in display levels, when to stop.
// SPDX-License-Identifier: MIT
#include "libvkt/render/passes.h"

#include "libvkt/render/crew.h"
#include "libvkt/render/levels.h"
#include "libvkt/render/room.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace vkt::render {

namespace {

constexpr int pilot_paths = 16;
constexpr double uncertain = 1.25; ///< by which factor the estimate of a single tile may be off

struct PathTile {
    Tile tile;
    int wanted, done;

    std::int64_t pixels() const { return std::int64_t{tile.x1 - tile.x0} * (tile.y1 - tile.y0); }
};

std::vector<PathTile> tiles_of(int width, int height, int wanted, int side = tile_side) {
    std::vector<PathTile> tiles;
    for (int y = 0; y < height; y += side)
        for (int x = 0; x < width; x += side)
            tiles.push_back({{x, y, std::min(x + side, width), std::min(y + side, height)}, wanted, 0});
    return tiles;
}

template <class Body> void each_pixel(Tile const& tile, std::int64_t width, Body const& body) {
    for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x) body(static_cast<std::size_t>(y * width + x));
}

/// Mean over a tile of the variance of one path, in squared levels: of the channel where it is largest.
double path_variance(PathTile const& t, std::int64_t width, std::vector<double> const& light,
                     std::vector<double> const& squares, Levels const& levels) {
    double sum = 0;
    double const n = t.done;
    each_pixel(t.tile, width, [&](std::size_t i) {
        double most = 0;
        for (std::size_t c = 0; c < 4; ++c) {
            double const mean = levels.shown(&light[4 * i], c) / n;
            double const variance = std::max(0.0, squares[4 * i + c] / n - mean * mean) * n / (n - 1);
            double const slope = levels.slope(mean, c);
            most = std::max(most, variance * slope * slope);
        }
        sum += most;
    });
    return sum / static_cast<double>(t.pixels());
}

/// Squared standard error of a tile in squared levels, from the difference of its two halves.
double half_difference(PathTile const& t, std::int64_t width, std::vector<double> const& light,
                       std::vector<double> const& odd, Levels const& levels) {
    double sum = 0;
    double const n = t.done, odd_count = t.done / 2, even_count = n - odd_count; // NOLINT(bugprone-integer-division)
    each_pixel(t.tile, width, [&](std::size_t i) {
        double most = 0;
        for (std::size_t c = 0; c < 4; ++c) {
            double const all = levels.shown(&light[4 * i], c), one = levels.shown(&odd[4 * i], c);
            double const apart = (all - one) / even_count - one / odd_count;
            double const slope = levels.slope(all / n, c);
            most = std::max(most, apart * apart * slope * slope * even_count * odd_count / (n * n));
        }
        sum += most;
    });
    return sum / static_cast<double>(t.pixels());
}

/// `noise` is what was asked for, 0 if nothing was.
Quality quality_of(std::vector<PathTile> const& tiles, std::int64_t width, std::vector<double> const& light,
                   std::vector<double> const& odd, Levels const& levels, double noise) {
    Quality q;
    double pixels = 0, known = 0, paths = 0, undrawn = 0, sum = 0;
    for (PathTile const& t : tiles) {
        auto const n = static_cast<double>(t.pixels());
        pixels += n;
        paths += n * t.done;
        if (t.done == 0) undrawn += n;
        if (t.done < 2) continue;
        double const squared = half_difference(t, width, light, odd, levels);
        known += n;
        sum += n * squared;
        q.worst = std::max(q.worst, std::sqrt(squared));
        if (noise > 0 && std::sqrt(squared) > uncertain * noise) ++q.above;
    }
    if (known > 0) q.error = std::sqrt(sum / known);
    q.rays = paths / pixels;
    q.undrawn = undrawn / pixels;
    return q;
}

/// Of a picture that was stopped before.
Quality nothing_drawn() {
    Quality q;
    q.rays = 0, q.undrawn = 1, q.stopped = true;
    return q;
}

class Paths {
public:
    Paths(Drawing const& drawing, Image& image, Counters& total)
        : drawing_(drawing), image_(image), crew_(drawing, total), levels_(drawing.background),
          tiles_(tiles_of(image.width, image.height, drawing.scene.samples)) {}

    Quality draw() {
        SceneView scene = drawing_.scene;
        std::size_t const numbers = image_.pixels.size(), squares = drawing_.variance != nullptr ? numbers : 0;
        Watch const& watch = drawing_.watch;
        if (!make_room(light_, numbers, watch) || !make_room(odd_, numbers, watch) ||
            !make_room(squares_, squares, watch))
            return nothing_drawn();
        scene.sums = {light_.data(), odd_.data(), squares_.empty() ? nullptr : squares_.data(), {}};
        for (std::size_t c = 0; c < 3; ++c)
            scene.sums.behind[c] = static_cast<float>(levels_.behind(c) * drawing_.background.alpha);
        // The first pass is one path everywhere, so that whatever ends it finds a picture.
        advance(scene, tiles_, 1, image_.pixels.data(), true, 0, 0);
        if (drawing_.goal.noise > 0) plan();
        draw_wanted(scene, 1);
        while (drawing_.goal.noise > 0 && !crew_.over()) {
            int const from = want_more();
            if (from == 0) break;
            draw_wanted(scene, from);
        }
        if (drawing_.variance != nullptr) tell_variance(scene, *drawing_.variance);
        return quality();
    }

private:
    /// What is wanted of all tiles, of which each has so many paths or all of its own.
    void draw_wanted(SceneView const& scene, int target) {
        int most = 1;
        double work = 0, finished = 0;
        for (PathTile const& t : tiles_) {
            most = std::max(most, t.wanted);
            work += t.wanted * static_cast<double>(t.pixels());
            finished += target > 1 ? t.done * static_cast<double>(t.pixels()) : 0;
        }
        while (target < most && !crew_.over()) {
            target = std::min({2 * target, target + 64, most});
            double pass = 0;
            for (PathTile const& t : tiles_)
                pass += std::max(0, std::min(target, t.wanted) - t.done) * static_cast<double>(t.pixels());
            advance(scene, tiles_, target, image_.pixels.data(), false, finished / work, pass / work);
            finished += pass;
            if ((target & (target - 1)) == 0) crew_.set_error(quality().error);
        }
    }

    /// Where few paths are bright the pilot finds too little noise: tiles that are still above are drawn on. Returns
    /// the least number of paths that one of them has; 0 if there is none. A tile is judged by all of its pixels, so
    /// that what any one of them got hardly decides.
    int want_more() {
        int least = 0;
        for (PathTile& t : tiles_) {
            if (t.done < 2 || t.done < t.wanted || t.wanted >= drawing_.scene.samples) continue;
            double const noise = drawing_.goal.noise,
                         squared = half_difference(t, image_.width, light_, odd_, levels_) / (noise * noise);
            if (!(squared > uncertain * uncertain)) continue;
            least = least == 0 ? t.done : std::min(least, t.done);
            double const wanted = std::ceil(t.done * std::clamp(squared, 1.25, 4.0));
            t.wanted = static_cast<int>(std::min<double>(wanted, drawing_.scene.samples));
        }
        return least;
    }

    /// Paths of all tiles up to a number.
    void advance(SceneView const& scene, std::vector<PathTile>& tiles, int target, float* pixels, bool whole,
                 double share, double width) {
        crew_.work(static_cast<std::int64_t>(tiles.size()), whole, share, width,
                   [&](std::int64_t i, Counters& counters) {
                       PathTile& t = tiles[static_cast<std::size_t>(i)];
                       int const end = std::min(target, t.wanted);
                       if (end <= t.done) return;
                       SceneView part = scene;
                       part.first_sample = scene.first_sample + t.done;
                       part.samples = end - t.done;
                       part.before = t.done;
                       drawing_.draw(part, t.tile, pixels, counters);
                       t.done = end;
                   });
    }

    void tell_variance(SceneView const& scene, std::vector<float>& variance) const {
        std::size_t const count = light_.size() / 4;
        variance.assign(3 * count, 0);
        for (PathTile const& t : tiles_) {
            double const n = t.done;
            if (t.done < 2) continue;
            each_pixel(t.tile, image_.width, [&](std::size_t i) {
                for (std::size_t c = 0; c < 3; ++c) {
                    double const mean =
                        (light_[4 * i + c] + light_[4 * i + 3] * static_cast<double>(scene.sums.behind[c])) / n;
                    double const spread = std::max(0.0, squares_[4 * i + c] / n - mean * mean);
                    variance[c * count + i] = static_cast<float>(spread / (n - 1));
                }
            });
        }
    }

    void plan() {
        std::vector<double> light(light_.size()), squares(light_.size());
        std::vector<float> pixels(image_.pixels.size());
        std::vector<PathTile> pilots = tiles_of(image_.width, image_.height, drawing_.scene.samples);
        SceneView scene = drawing_.scene;
        scene.seed ^= 0x9e3779b97f4a7c15U; // other paths than those of the picture
        scene.sums = {light.data(), nullptr, squares.data(), {}};
        for (std::size_t c = 0; c < 3; ++c) scene.sums.behind[c] = static_cast<float>(levels_.behind(c));
        int const cap = drawing_.scene.samples;
        advance(scene, pilots, std::min(pilot_paths, cap), pixels.data(), false, 0, 0);
        // What the estimate itself is uncertain by.
        constexpr double margin = 1.15;
        double const allowed = drawing_.goal.noise * drawing_.goal.noise;
        for (std::size_t i = 0; i < tiles_.size(); ++i) {
            PathTile const& t = pilots[i];
            double const needed =
                t.done > 1 ? margin * path_variance(t, image_.width, light, squares, levels_) / allowed : cap;
            tiles_[i].wanted =
                static_cast<int>(std::clamp(std::ceil(needed), std::min<double>(pilot_paths, cap), 1.0 * cap));
        }
    }

    Quality quality() const {
        Quality q = quality_of(tiles_, image_.width, light_, odd_, levels_, drawing_.goal.noise);
        q.stopped = crew_.stopped(), q.late = crew_.late();
        return q;
    }

    Drawing const& drawing_;
    Image& image_;
    Crew crew_;
    Levels levels_;
    std::vector<PathTile> tiles_;
    std::vector<double> light_, odd_, squares_;
};

class Adaptive {
public:
    Adaptive(Drawing const& drawing, Image& image, Counters& total)
        : drawing_(drawing), image_(image), crew_(drawing, total), levels_(drawing.background),
          count_(image.pixels.size() / 4) {}

    Quality draw(bool stepped) {
        double const allowed = drawing_.goal.tolerance;
        std::vector<std::int32_t> all;
        std::vector<float> next;
        Watch const& watch = drawing_.watch;
        bool const room = make_room(all, count_, watch, [&](std::size_t from, std::size_t to) {
            for (std::size_t i = from; i < to; ++i) all[i] = static_cast<std::int32_t>(i);
        });
        if (!room || !make_room(next, image_.pixels.size(), watch) || !make_room(halvings_, count_, watch) ||
            !make_room(step_error_, count_, watch) || !make_room(edge_error_, count_, watch) ||
            !make_room(rays_, count_, watch) || !make_room(squares_, image_.pixels.size(), watch))
            return nothing_drawn();
        pass(all, 1, true, image_.pixels.data(), 0, 0.1);
        for (std::size_t i = 0; i < count_; ++i) drawn_ += rays_[i] > 0 ? 1 : 0;
        if (stepped && !crew_.over()) choose_steps(allowed / 3, next);
        double const left = stepped ? allowed * 2 / 3 : allowed;
        double share = 0.2;
        std::vector<std::int32_t> pixels = std::move(all);
        for (int rays = 4; rays <= most_rays && !pixels.empty() && !crew_.over(); rays *= 4) {
            pass(pixels, rays, false, next.data(), share, (1 - share) / 3);
            share += (1 - share) / 3;
            for (std::int32_t const p : pixels) {
                auto const i = static_cast<std::size_t>(p);
                if (rays_[i] < rays) continue; // the time was up
                edge_error_[i] = change_error(i, next.data());
                std::copy_n(&next[4 * i], 4, &image_.pixels[4 * i]);
            }
            for (std::int32_t const p : pixels) {
                auto const i = static_cast<std::size_t>(p);
                if (rays_[i] == rays) edge_error_[i] = std::max(edge_error_[i], spread_error(i, rays));
            }
            crew_.set_error(quality().error);
            pixels =
                around([&](std::size_t i) { return rays_[i] == rays && static_cast<double>(edge_error_[i]) > left; });
        }
        return quality();
    }

private:
    static constexpr int most_halvings = 7;

    /// Draws these pixels with so many rays and their own steps.
    void pass(std::vector<std::int32_t> const& pixels, int rays, bool whole, float* into, double share, double width) {
        constexpr std::int64_t piece = 64;
        auto const n = static_cast<std::int64_t>(pixels.size());
        crew_.work((n + piece - 1) / piece, whole, share, width, [&](std::int64_t k, Counters& counters) {
            SceneView scene = drawing_.scene;
            scene.rays = rays;
            if (rays > 1) scene.sums.squares = squares_.data();
            for (std::size_t c = 0; c < 3; ++c) scene.sums.behind[c] = static_cast<float>(levels_.behind(c));
            for (std::int64_t j = k * piece; j < std::min(n, (k + 1) * piece); ++j) {
                auto const i = static_cast<std::size_t>(pixels[static_cast<std::size_t>(j)]);
                int const x = static_cast<int>(i) % image_.width, y = static_cast<int>(i) / image_.width;
                scene.step = std::ldexp(drawing_.scene.step, -halvings_[i]);
                std::fill_n(&squares_[4 * i], 4, 0.0);
                drawing_.draw(scene, {x, y, x + 1, y + 1}, into, counters);
                rays_[i] = static_cast<std::int16_t>(rays);
            }
        });
    }

    /// `next`: room for a picture.
    void choose_steps(double allowed, std::vector<float>& next) {
        std::vector<std::int32_t> pixels = around([](std::size_t) { return true; });
        std::vector<std::uint8_t> coarser(count_);
        for (int h = 1; h <= most_halvings && !pixels.empty() && !crew_.over(); ++h) {
            if (std::ldexp(drawing_.scene.step, -h) < 0x1p-8F) break;
            for (std::int32_t const p : pixels) halvings_[static_cast<std::size_t>(p)] = static_cast<std::uint8_t>(h);
            for (std::int32_t const p : pixels) rays_[static_cast<std::size_t>(p)] = 0;
            pass(pixels, 1, false, next.data(), 0.1, 0.1);
            for (std::int32_t const p : pixels) {
                auto const i = static_cast<std::size_t>(p);
                coarser[i] = 0;
                if (rays_[i] == 0) { // the time was up
                    rays_[i] = 1;
                    --halvings_[i];
                    continue;
                }
                double const change = levels_.apart(&image_.pixels[4 * i], &next[4 * i]);
                coarser[i] = 2 * change <= allowed ? 1 : 0;
                step_error_[i] = static_cast<float>(coarser[i] != 0 ? 2 * change : change / 2);
                std::copy_n(&next[4 * i], 4, &image_.pixels[4 * i]);
            }
            std::vector<std::int32_t> const further = around(
                [&](std::size_t i) { return halvings_[i] == h && static_cast<double>(step_error_[i]) > allowed; });
            pixels.clear();
            for (std::int32_t const p : further)
                if (halvings_[static_cast<std::size_t>(p)] == h) pixels.push_back(p);
        }
        for (std::size_t i = 0; i < count_; ++i)
            if (coarser[i] != 0 && halvings_[i] > 0) --halvings_[i];
    }

    /// From the mean of a quarter as many rays.
    float change_error(std::size_t i, float const* now) const {
        return static_cast<float>(levels_.apart(&image_.pixels[4 * i], now + 4 * i) / std::pow(4, 0.75));
    }

    /// From the spread of the rays, or from that of a neighbour's: its edge may pass this pixel between the rays. On a
    /// display little light is much in the dark.
    float spread_error(std::size_t i, int rays) const {
        auto const x = static_cast<int>(i) % image_.width, y = static_cast<int>(i) / image_.width;
        double error = 0;
        for (std::size_t c = 0; c < 4; ++c) {
            double near = 0;
            for (int v = std::max(0, y - 1); v <= std::min(image_.height - 1, y + 1); ++v)
                for (int u = std::max(0, x - 1); u <= std::min(image_.width - 1, x + 1); ++u)
                    near = std::max(near, spread(static_cast<std::size_t>(v) * static_cast<std::size_t>(image_.width) +
                                                     static_cast<std::size_t>(u),
                                                 c));
            double const mean = levels_.shown(&image_.pixels[4 * i], c), level = levels_.level(mean, c),
                         light = std::max(0.5 * spread(i, c), 0.25 * near) * std::pow(rays, -0.75);
            error = std::max({error, levels_.level(mean + light, c) - level, level - levels_.level(mean - light, c)});
        }
        return static_cast<float>(error);
    }

    /// Standard deviation of a pixel's rays in linear light.
    double spread(std::size_t i, std::size_t c) const {
        double const mean = levels_.shown(&image_.pixels[4 * i], c),
                     variance = squares_[4 * i + c] / std::max<int>(rays_[i], 1) - mean * mean;
        return variance > 1e-12 ? std::sqrt(variance) : 0; // floats of equal rays differ from their mean
    }

    /// Pixels that are chosen, and their neighbours.
    template <class Chosen> std::vector<std::int32_t> around(Chosen const& chosen) const {
        int const width = image_.width, height = image_.height;
        std::vector<std::uint8_t> marked(count_);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                if (!chosen(static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(x)))
                    continue;
                for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v)
                    for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u)
                        marked[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) +
                               static_cast<std::size_t>(u)] = 1;
            }
        std::vector<std::int32_t> pixels;
        for (std::size_t i = 0; i < count_; ++i)
            if (marked[i] != 0) pixels.push_back(static_cast<std::int32_t>(i));
        return pixels;
    }

    Quality quality() const {
        Quality q;
        q.stopped = crew_.stopped(), q.late = crew_.late();
        double sum = 0, rays = 0;
        std::int64_t known = 0;
        int finest = 0;
        for (std::size_t i = 0; i < count_; ++i) {
            rays += rays_[i];
            finest = std::max<int>(finest, halvings_[i]);
            if (rays_[i] < 4) continue;
            double const error = static_cast<double>(step_error_[i]) + static_cast<double>(edge_error_[i]);
            ++known;
            sum += error * error;
            q.worst = std::max(q.worst, error);
            if (drawing_.goal.tolerance > 0 && error > drawing_.goal.tolerance) ++q.above;
        }
        if (known > 0) q.error = std::sqrt(sum / static_cast<double>(known));
        q.rays = rays / static_cast<double>(count_);
        q.undrawn = 1 - static_cast<double>(drawn_) / static_cast<double>(count_);
        q.finest = std::ldexp(static_cast<double>(drawing_.scene.step), -finest);
        return q;
    }

    Drawing const& drawing_;
    Image& image_;
    Crew crew_;
    Levels levels_;
    std::size_t count_, drawn_ = 0;
    std::vector<std::uint8_t> halvings_;
    std::vector<float> step_error_, edge_error_;
    std::vector<std::int16_t> rays_; ///< of the present light of a pixel
    std::vector<double> squares_;
};

} // namespace

Quality draw_once(Drawing const& drawing, Image& image, Counters& total) {
    // Many paths make a tile long; a small one hears sooner that it is to stop.
    bool const paths = drawing.scene.samples > 1024;
    std::vector<PathTile> tiles = tiles_of(image.width, image.height, 1, paths ? tile_side / 8 : tile_side);
    Crew crew(drawing, total);
    std::int64_t drawn = 0;
    crew.work(static_cast<std::int64_t>(tiles.size()), true, 0, 1, [&](std::int64_t i, Counters& counters) {
        PathTile& t = tiles[static_cast<std::size_t>(i)];
        drawing.draw(drawing.scene, t.tile, image.pixels.data(), counters);
        t.done = 1;
    });
    for (PathTile const& t : tiles) drawn += t.done * t.pixels();
    Quality q;
    q.stopped = crew.stopped();
    q.undrawn = 1 - static_cast<double>(drawn) / (static_cast<double>(image.width) * image.height);
    return q;
}

Quality quality_of_paths(Drawing const& drawing, int width, int paths, std::vector<double> const& light,
                         std::vector<double> const& odd) {
    std::vector<PathTile> tiles = tiles_of(width, static_cast<int>(light.size() / 4) / width, paths);
    for (PathTile& t : tiles) t.done = paths;
    return quality_of(tiles, width, light, odd, Levels(drawing.background), 0);
}

Quality draw_paths(Drawing const& drawing, Image& image, Counters& total) {
    return Paths(drawing, image, total).draw();
}

Quality draw_adaptively(Drawing const& drawing, bool stepped, Image& image, Counters& total) {
    return Adaptive(drawing, image, total).draw(stepped);
}

} // namespace vkt::render
