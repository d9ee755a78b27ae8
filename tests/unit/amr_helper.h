// Helpers of the AMR tests: sample data, small trees, positions, brute-force references.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/make_amr.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/tree.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <unistd.h>
#include <vector>

namespace amr_test {

using namespace vkt;

/// Folder of the AMR sample data; empty if there is none.
inline std::string data_folder() {
    char const* const root = std::getenv("VKT_DATA");
    std::string const folder = root == nullptr ? "" : std::string(root) + "/amr";
    return std::filesystem::exists(folder) ? folder : "";
}

#define REQUIRE_DATA(folder)                                                                                           \
    std::string const folder = amr_test::data_folder();                                                                \
    if (folder.empty()) GTEST_SKIP() << "VKT_DATA does not name the sample data"

inline Execution execution(int threads = 2) {
    Execution result = default_execution();
    result.threads = threads;
    return result;
}

inline std::vector<float> read_raw(std::string const& path) {
    std::ifstream file(path, std::ios::binary);
    std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    std::vector<float> values(bytes.size() / sizeof(float));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
    return values;
}

template <class T> T const* cells_of(Volume const& volume) {
    return reinterpret_cast<T const*>(volume.buffer().read(Space::host));
}

template <class T> std::vector<T> values_of(Volume const& volume) {
    T const* const cells = cells_of<T>(volume);
    return {cells, cells + volume.header().voxels()};
}

/// A file that goes away with the test.
class TemporaryFile {
public:
    explicit TemporaryFile(std::string const& name)
        : path_((std::filesystem::temp_directory_path() / ("vkt-amr-" + std::to_string(getpid()) + "-" + name))
                    .string()) {}
    ~TemporaryFile() { std::filesystem::remove_all(path_); }
    std::string const& path() const { return path_; }

private:
    std::string path_;
};

/// A hierarchical float volume of given bricks; cells are the function of their centre in finest cells.
inline Volume make_tree(Index3 logical, std::vector<Brick> bricks, std::function<double(Vec3)> const& field) {
    Header header;
    header.kind = Kind::hierarchical;
    header.dims = logical;
    header.dtype = DataType::float32;
    Volume volume(header, std::move(bricks));
    auto* cell = reinterpret_cast<float*>(volume.buffer().write(Space::host));
    for (Brick const& brick : volume.bricks()) {
        Index3 const w = cell_width(logical, brick.level);
        for (std::int64_t z = 0; z < brick.dims.z; ++z)
            for (std::int64_t y = 0; y < brick.dims.y; ++y)
                for (std::int64_t x = 0; x < brick.dims.x; ++x) {
                    Index3 const i{x, y, z};
                    Vec3 p;
                    for (int a = 0; a < 3; ++a)
                        p[a] = static_cast<double>(brick.lower[a]) +
                               (static_cast<double>(i[a]) + 0.5) * static_cast<double>(w[a]);
                    *cell++ = static_cast<float>(field(p));
                }
    }
    return volume;
}

/// A tree of non-cubic blocks on three levels, with the linear field unless told otherwise.
inline AmrRecipe small_recipe(AmrField field = AmrField::disk) {
    AmrRecipe recipe;
    recipe.roots = {3, 2, 1};
    recipe.block = {8, 4, 6};
    recipe.finest = 3;
    recipe.blocks = 118;
    recipe.field = field;
    return recipe;
}

inline SampleGrid whole_grid(Volume const& volume, Index3 dims) {
    GridRequest request;
    request.dims = dims;
    return plan_grid(volume.header(), request);
}

/// The same tree in the same place of the world with other names for its axes: axis a was axis[a].
inline Volume permuted(Volume const& volume, std::array<int, 3> axis) {
    auto const turned = [&](auto v) { return decltype(v){v[axis[0]], v[axis[1]], v[axis[2]]}; };
    Header header = volume.header();
    header.dims = turned(header.dims);
    header.geometry.spacing = turned(header.geometry.spacing);
    for (std::size_t a = 0; a < 3; ++a)
        header.geometry.direction[a] = volume.header().geometry.direction[static_cast<std::size_t>(axis[a])];
    std::vector<Brick> bricks = volume.bricks().list();
    for (Brick& brick : bricks) brick.lower = turned(brick.lower), brick.dims = turned(brick.dims);
    Volume result(header, bricks);
    for (std::size_t b = 0; b < bricks.size(); ++b) {
        View<float const> const from = volume.brick_view(b).as<float>();
        View<float> const to = result.mutable_brick_view(b).as<float>();
        Index3 const n = bricks[b].dims;
        Index3 was;
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x) {
                    was[axis[0]] = x, was[axis[1]] = y, was[axis[2]] = z;
                    to.data[x + y * to.row + z * to.slice] = from.data[was.x + was.y * from.row + was.z * from.slice];
                }
    }
    return result;
}

inline std::vector<std::array<int, 3>> permutations() {
    return {{0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
}

/// Basis reconstruction by its definition: a sum over all cells of the volume, in double.
inline std::pair<double, double> brute_force(Volume const& volume, Vec3 p) {
    float const* cell = cells_of<float>(volume);
    double sum = 0, weight = 0;
    for (Brick const& brick : volume.bricks()) {
        Index3 const w = cell_width(volume.header().dims, brick.level);
        for (std::int64_t z = 0; z < brick.dims.z; ++z)
            for (std::int64_t y = 0; y < brick.dims.y; ++y)
                for (std::int64_t x = 0; x < brick.dims.x; ++x, ++cell) {
                    Index3 const i{x, y, z};
                    double hat = 1;
                    for (int a = 0; a < 3; ++a) {
                        auto const width = static_cast<double>(w[a]);
                        double const centre =
                            static_cast<double>(brick.lower[a]) + (static_cast<double>(i[a]) + 0.5) * width;
                        hat *= std::max(0.0, 1 - std::abs(p[a] - centre) / width);
                    }
                    if (hat == 0) continue;
                    sum += hat * static_cast<double>(*cell);
                    weight += hat;
                }
    }
    return {sum, weight};
}

} // namespace amr_test
