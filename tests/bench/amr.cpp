// Hierarchical volumes inside one process: files for other programs, sampling rates, error of the reconstructions.
// SPDX-License-Identifier: MIT
//
//   vkt_amr_bench flash FILE [BLOCKS LEVELS]               writes a FLASH file (default: the tree of a SILCC snapshot)
//   vkt_amr_bench rate FILE METHOD THREADS X Y Z [RUNS]    reads one, prints samples per second on an X x Y x Z grid
//   vkt_amr_bench accuracy THREADS                         prints a CSV table
#include "libvkt/amr/make_amr.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/error.h"
#include "libvkt/formats/flash.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

namespace {

using namespace vkt;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

Execution on(int threads) {
    Execution execution = default_execution();
    execution.threads = threads;
    return execution;
}

Reconstruction method_named(std::string const& name) {
    for (auto const& [method, text] : EnumNames<Reconstruction>::all())
        if (name == text) return method;
    throw Error(ErrorKind::usage, "unknown method " + name);
}

/// Seconds of one reconstruction into memory that is there already: the median of some runs.
double seconds_of(Reconstructor const& reconstructor, Volume& result, Execution const& execution, int runs) {
    reconstructor.run(result.mutable_view(), execution);
    std::vector<double> seconds;
    for (int i = 0; i < runs; ++i) {
        double const start = now();
        reconstructor.run(result.mutable_view(), execution);
        seconds.push_back(now() - start);
    }
    std::sort(seconds.begin(), seconds.end());
    return seconds[seconds.size() / 2];
}

void write(std::string const& path, std::int64_t blocks, int levels) {
    AmrRecipe recipe = silcc_like();
    if (blocks > 0) {
        recipe = {};
        recipe.finest = levels, recipe.blocks = blocks;
    }
    FlashWriteOptions options;
    options.for_others = true;
    for (int a = 0; a < 3; ++a) options.domain_upper[a] = static_cast<double>(recipe.roots[a]); // cubic cells
    write_flash(make_amr(recipe, default_execution()), path, "dens", options);
}

void rate(std::string const& path, Reconstruction method, int threads, Index3 dims, int runs) {
    AmrReadOptions options;
    options.variable = "dens";
    Volume const volume = read_flash(path, options, on(threads));
    GridRequest request;
    request.dims = dims;
    Reconstructor const reconstructor(volume, plan_grid(volume.header(), request), method);
    Volume result(reconstructor.header());
    double const seconds = seconds_of(reconstructor, result, on(threads), runs);
    std::printf("%.6g\n", static_cast<double>(dims.x * dims.y * dims.z) / seconds);
}

/// Finest cells no farther from a brick of another level than one of its cells.
std::vector<bool> near_boundary(Volume const& volume) {
    Index3 const n = volume.header().dims;
    std::vector<int> level(static_cast<std::size_t>(n.x * n.y * n.z));
    auto const each = [&](Box const& box, auto&& visit) {
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                    visit(static_cast<std::size_t>((z * n.y + y) * n.x + x));
    };
    for (Brick const& b : volume.bricks()) each(bounds_of(b, n), [&](std::size_t i) { level[i] = b.level; });
    std::vector<bool> near(level.size());
    for (Brick const& b : volume.bricks()) {
        Box box = bounds_of(b, n);
        Index3 const w = cell_width(n, b.level);
        box = intersect({box.lower - w, box.upper + w}, box_of(n));
        each(box, [&](std::size_t i) {
            if (level[i] != b.level) near[i] = true;
        });
    }
    return near;
}

/// A plane wave per axis, multiplied: two periods along each axis, 64 finest cells long. Its mean over a box is exact.
double wave_mean(Vec3 low, Vec3 high) {
    constexpr double per_cell = 2 * std::numbers::pi / 64;
    double mean = 1;
    for (int a = 0; a < 3; ++a) {
        double const from = low[a] * per_cell + a, to = high[a] * per_cell + a;
        mean *= to > from ? (std::cos(from) - std::cos(to)) / (to - from) : std::sin(from);
    }
    return mean;
}

/// A tree of four levels whose cells hold the wave's averages.
Volume wave_tree(Execution const& execution) {
    AmrRecipe recipe;
    recipe.roots = {2, 2, 2};
    recipe.finest = 4, recipe.blocks = 1500;
    Volume volume = make_amr(recipe, execution);
    auto* cell = reinterpret_cast<float*>(volume.buffer().write(Space::host));
    for (Brick const& b : volume.bricks()) {
        Index3 const w = cell_width(volume.header().dims, b.level);
        for (std::int64_t i = 0; i < b.cells(); ++i) {
            Index3 const at{i % b.dims.x, i / b.dims.x % b.dims.y, i / (b.dims.x * b.dims.y)};
            Vec3 low, high;
            for (int a = 0; a < 3; ++a) {
                low[a] = static_cast<double>(b.lower[a] + at[a] * w[a]);
                high[a] = low[a] + static_cast<double>(w[a]);
            }
            *cell++ = static_cast<float>(wave_mean(low, high));
        }
    }
    return volume;
}

struct Error2 {
    double squares = 0, worst = 0;
    std::int64_t count = 0;
    void add(double e) {
        squares += e * e;
        worst = std::max(worst, std::abs(e));
        ++count;
    }
    double rms() const { return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0; }
};

/// Cells hold exact averages. A voxel no larger than a finest cell is compared with the field at its centre, a larger
/// one with the field's mean over it. Errors are shares of the field's standard deviation.
void accuracy(int threads) {
    Volume const volume = wave_tree(on(threads));
    Index3 const n = volume.header().dims;
    std::vector<bool> const boundary = near_boundary(volume);
    std::printf("method,samples_per_finest_cell,compared_with,where,rms_error,max_error,seconds\n");
    struct Size {
        Index3 times, divided;
    };
    for (Size const& size : {Size{{1, 1, 1}, {4, 4, 4}}, Size{{1, 1, 1}, {2, 2, 2}}, Size{{1, 1, 1}, {1, 1, 1}},
                             Size{{2, 2, 1}, {1, 1, 1}}, Size{{4, 2, 2}, {1, 1, 1}}}) {
        Index3 dims;
        double per_cell = 1;
        for (int a = 0; a < 3; ++a) {
            dims[a] = n[a] * size.times[a] / size.divided[a];
            per_cell *= static_cast<double>(dims[a]) / static_cast<double>(n[a]);
        }
        bool const means = per_cell < 1;
        GridRequest request;
        request.dims = dims;
        SampleGrid const grid = plan_grid(volume.header(), request);
        std::vector<float> truth(static_cast<std::size_t>(dims.x * dims.y * dims.z));
        double sum = 0, squares = 0;
        for (std::size_t i = 0; i < truth.size(); ++i) {
            auto const k = static_cast<std::int64_t>(i);
            Index3 const at{k % dims.x, k / dims.x % dims.y, k / (dims.x * dims.y)};
            Vec3 low, middle, high;
            for (int a = 0; a < 3; ++a) {
                low[a] = grid.lower[a] + static_cast<double>(at[a]) * grid.step[a];
                middle[a] = low[a] + 0.5 * grid.step[a], high[a] = low[a] + grid.step[a];
            }
            double const value = means ? wave_mean(low, high) : wave_mean(middle, middle);
            truth[i] = static_cast<float>(value);
            sum += value, squares += value * value;
        }
        auto const count = static_cast<double>(truth.size());
        double const deviation = std::sqrt(squares / count - sum / count * (sum / count));
        for (Reconstruction const method :
             {Reconstruction::basis, Reconstruction::nearest, Reconstruction::average, Reconstruction::automatic}) {
            Reconstructor const reconstructor(volume, grid, method);
            Volume result(reconstructor.header());
            double const seconds = seconds_of(reconstructor, result, on(threads), 3);
            auto const* const values = reinterpret_cast<float const*>(result.buffer().read(Space::host));
            Error2 all, inside, edge;
            for (std::size_t i = 0; i < truth.size(); ++i) {
                auto const k = static_cast<std::int64_t>(i);
                Index3 const at{k % dims.x, k / dims.x % dims.y, k / (dims.x * dims.y)};
                Index3 cell;
                for (int a = 0; a < 3; ++a)
                    cell[a] = static_cast<std::int64_t>((static_cast<double>(at[a]) + 0.5) * grid.step[a]);
                double const e = (static_cast<double>(values[i]) - static_cast<double>(truth[i])) / deviation;
                all.add(e);
                (boundary[static_cast<std::size_t>((cell.z * n.y + cell.y) * n.x + cell.x)] ? edge : inside).add(e);
            }
            struct Row {
                char const* where;
                Error2 const& error;
            };
            for (Row const& row : {Row{"all", all}, Row{"inside levels", inside}, Row{"level boundaries", edge}})
                std::printf("%s,%g,%s,%s,%.3e,%.3e,%.4f\n", enum_name(method).c_str(), per_cell,
                            means ? "mean" : "point", row.where, row.error.rms(), row.error.worst, seconds);
        }
    }
}

} // namespace

int main(int argc, char** argv) try {
    std::vector<std::string> const words(argv + 1, argv + argc);
    auto const number = [&](std::size_t i, std::int64_t otherwise) {
        return i < words.size() ? std::stoll(words[i]) : otherwise;
    };
    std::string const mode = words.empty() ? "" : words[0];
    if (mode == "flash" && words.size() >= 2)
        write(words[1], number(2, 0), static_cast<int>(number(3, 4)));
    else if (mode == "rate" && words.size() >= 7)
        rate(words[1], method_named(words[2]), static_cast<int>(number(3, 1)),
             {number(4, 1), number(5, 1), number(6, 1)}, static_cast<int>(number(7, 3)));
    else if (mode == "accuracy")
        accuracy(static_cast<int>(number(1, 1)));
    else
        return std::fputs("vkt_amr_bench flash|rate|accuracy …: see the head of its source\n", stderr), 2;
    return 0;
} catch (std::exception const& error) {
    std::fprintf(stderr, "vkt_amr_bench: %s\n", error.what());
    return 1;
}
