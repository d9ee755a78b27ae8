// A hierarchical volume made ready for rays: ranges, conversion, histogram, visibility.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tree.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/error.h"
#include "libvkt/render/survey.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <omp.h>
#include <utility>

namespace vkt::render {

namespace {

/// Weights of cells per level that add up to less than 2^62: their volume in finest cells, or a power of two of it.
std::int64_t weight_of(Index3 dims, int level, int shift) {
    Index3 const w = cell_width(dims, level);
    return static_cast<std::int64_t>(std::ldexp(volume_of(w), -shift));
}

float rounded_down(double v) {
    auto const f = static_cast<float>(v);
    return static_cast<double>(f) > v ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
float rounded_up(double v) { return -rounded_down(-v); }

Double3 least(Double3 a, Double3 b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
Double3 greatest(Double3 a, Double3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }

} // namespace

struct Tree::Survey {
    std::vector<Range> bricks;
    Range all;
    Narrowing narrow;

    Survey(Volume const& volume, Execution const& execution) {
        Header const& header = volume.header();
        if (volume.bricks().empty())
            throw Error(ErrorKind::data, "the volume has no bricks", "vkt read with a wider --roi has some");
        auto const count = static_cast<std::int64_t>(volume.bricks().size());
        bricks.resize(volume.bricks().size());
        std::byte const* const data = volume.buffer().read(Space::host);
        with_type(header.dtype, [&]<class T>(T) {
            auto const* const cells = reinterpret_cast<T const*>(data);
#pragma omp parallel for num_threads(execution.threads) schedule(static)
            for (std::int64_t i = 0; i < count; ++i) {
                auto const b = static_cast<std::size_t>(i);
                bricks[b] = range_of(cells + volume.brick_offset(b), volume.bricks()[b].cells());
            }
        });
        for (std::size_t b = 0; b < bricks.size(); ++b) {
            if (volume.bricks()[b].cells() > std::numeric_limits<std::int32_t>::max())
                throw Error(ErrorKind::resources, "a brick of 2^31 cells and more cannot be rendered",
                            "vkt resample makes a structured volume of it");
            all.add(bricks[b]);
        }
        if (all.empty())
            throw Error(ErrorKind::data, "the volume has no finite voxel", "vkt stats tells what it holds");
        with_type(header.dtype, [&]<class T>(T) {
            auto const* const cells = reinterpret_cast<T const*>(data);
            narrow = narrowing_of(header.dtype, all, header.voxels(),
                                  [&](std::int64_t i) { return static_cast<double>(cells[i]); });
        });
    }

    /// True if rays can sample the cells as they are.
    bool usable(DataType type) const {
        return type == DataType::uint8 || type == DataType::uint16 || type == DataType::int16 ||
               (type == DataType::float32 && all.infinite == 0 && narrow.rescaling.scale == 1);
    }
    Volume sampled(Volume const& volume, Execution const& execution) const {
        if (usable(volume.header().dtype)) return volume;
        Header header = volume.header();
        header.dtype = DataType::float32;
        Volume result(header, volume.bricks());
        auto* const out = reinterpret_cast<float*>(result.buffer().write(Space::host));
        std::byte const* const data = volume.buffer().read(Space::host);
        std::int64_t const n = volume.header().voxels();
        with_type(volume.header().dtype, [&]<class T>(T) {
            auto const* const cells = reinterpret_cast<T const*>(data);
#pragma omp parallel for num_threads(execution.threads) schedule(static)
            for (std::int64_t i = 0; i < n; ++i) out[i] = narrow(static_cast<double>(cells[i]));
        });
        return result;
    }
};

Tree::Tree(Volume const& volume, bool blocks, Execution const& execution)
    : Tree(volume, blocks, Survey(volume, execution), execution) {}

Tree::Tree(Volume const& volume, bool blocks, Survey const& survey, Execution const& execution)
    : Tree(volume, blocks, survey, join_bricks(survey.sampled(volume, execution), execution), execution) {}

Tree::Tree(Volume const& volume, bool blocks, Survey const& survey, JoinedBricks const& joined,
           Execution const& execution)
    : sampler_(joined.volume), rescaling_(survey.narrow.rescaling), region_(region_of(volume.header())) {
    Header const& header = volume.header();
    BrickTable const& bricks = volume.bricks();
    switch (sampler_.volume().header().dtype) {
    case DataType::uint8:
        type_ = LatticeType::uint8;
        break;
    case DataType::uint16:
        type_ = LatticeType::uint16;
        break;
    case DataType::int16:
        type_ = LatticeType::int16;
        break;
    default:
        type_ = LatticeType::float32;
        break;
    }

    std::int64_t cells = 0;
    for (Brick const& brick : bricks) {
        covered_ += volume_of(bounds_of(brick, header.dims).dims());
        cells += brick.cells();
    }
    int axes = 0;
    for (int a = 0; a < 3; ++a) axes += header.dims[a] > 1 ? 1 : 0;
    typical_width_ = axes > 0 ? std::pow(covered_ / static_cast<double>(cells), 1.0 / axes) : 1;

    BrickTable const& sampled = sampler_.volume().bricks();
    constexpr float infinity = std::numeric_limits<float>::infinity();
    lowest_.assign(sampled.size(), infinity);
    highest_.assign(sampled.size(), -infinity);
    missing_.resize(sampled.size());
    for (std::size_t b = 0; b < bricks.size(); ++b) {
        Range const& range = survey.bricks[b];
        auto const at = static_cast<std::size_t>(joined.into[b]);
        if (range.missing > 0) missing_[at] = 1;
        // Infinite cells were limited to the range of the whole volume.
        bool const some = range.least <= range.greatest, limited = range.infinite > 0;
        if (!some && !limited) continue;
        lowest_[at] = std::min(lowest_[at], survey.narrow(limited ? survey.all.least : range.least));
        highest_[at] = std::max(highest_[at], survey.narrow(limited ? survey.all.greatest : range.greatest));
    }
    boxes_.reserve(sampled.size());
    for (std::int32_t const id : sampler_.index().order()) {
        Brick const& brick = sampled[static_cast<std::size_t>(id)];
        Box const domain = domain_of(brick, header.dims);
        BrickBox box{{}, {}, id, brick.level};
        for (int a = 0; a < 3; ++a) {
            box.lower[a] = rounded_down(0.5 * static_cast<double>(domain.lower[a]));
            box.upper[a] = rounded_up(0.5 * static_cast<double>(domain.upper[a]));
        }
        boxes_.push_back(box);
    }

    int exponent = 0;
    std::frexp(covered_, &exponent);
    int const shift = std::max(0, exponent - 62);
    auto const count = static_cast<std::int64_t>(bricks.size());
    std::byte const* const data = volume.buffer().read(Space::host);
    Bins bins(survey.all);
    with_type(header.dtype, [&]<class T>(T) {
        auto const* const all = reinterpret_cast<T const*>(data);
        std::vector<Bins> parts(static_cast<std::size_t>(execution.threads), bins);
#pragma omp parallel num_threads(execution.threads)
        {
            Bins mine = std::move(parts[static_cast<std::size_t>(omp_get_thread_num())]);
#pragma omp for schedule(static) nowait
            for (std::int64_t i = 0; i < count; ++i) {
                auto const b = static_cast<std::size_t>(i);
                mine.count(all + volume.brick_offset(b), bricks[b].cells(),
                           weight_of(header.dims, bricks[b].level, shift));
            }
#pragma omp critical
            bins.add(mine);
        }
    });
    histogram_ = histogram_of(survey.all, bins, header.values);
    cells_ = make_tree_cells(sampler_, type_, region_, execution.threads);
    if (blocks) blocks_ = TreeBlocks(sampler_.volume().bricks(), header.dims, region_);
}

StoredBlocks Tree::blocks(CellVisibility const& visibility, TransferTable const& table, bool all,
                          std::size_t most_bytes, int threads) const {
    return blocks_.store(sampler_, type_, cells_, visibility, table, all, most_bytes, threads);
}

Tree::Visibility Tree::classify(TransferTable const& table) const {
    Visibility result;
    result.visible_before = table.visible_before();
    result.range.resize(lowest_.size());
    double const per_value = static_cast<double>(table.view().scale);
    BrickTable const& bricks = sampler_.volume().bricks();
    for (std::size_t b = 0; b < lowest_.size(); ++b) {
        BrickNodes& nodes = result.range[b];
        // Beyond missing data the value may jump between two samples, so that such bricks count as visible.
        nodes = {0, table.count() - 1};
        if (missing_[b] == 0) {
            // A weighted mean passes its ends by a few roundings, even that of equal values unless they are zero.
            double const largest = std::max(std::abs(lowest_[b]), std::abs(highest_[b]));
            double const slack = largest > 0 ? 1.0 / 64 + 1e-6 * largest * std::abs(per_value) : 0;
            auto const touched =
                table.nodes_of(lowest_[b], highest_[b], static_cast<float>(std::min(slack, 4.0 * table.count())));
            nodes = {touched.first, touched.last};
        }
        auto const at = [&](std::int32_t node) { return result.visible_before[static_cast<std::size_t>(node)]; };
        if (at(nodes.last + 1) == at(nodes.first)) continue;
        ++result.visible_count;
        Box const domain = domain_of(bricks[b], sampler_.volume().header().dims);
        auto const half = [](Index3 i) {
            return Double3{0.5 * static_cast<double>(i.x), 0.5 * static_cast<double>(i.y),
                           0.5 * static_cast<double>(i.z)};
        };
        Double3 const low = half(domain.lower), high = half(domain.upper);
        bool const first = result.visible_count == 1;
        result.lower = first ? low : least(result.lower, low);
        result.upper = first ? high : greatest(result.upper, high);
    }
    return result;
}

/// Where cells of different width meet, blocks are sampled at the finest ones' centres, of which the first that a wider
/// cell does not reach is half of one beyond its end.
PartRange Tree::range_of_part(Box const& part) const {
    return render::range_of_part(sampler_, type_, cells_, part, blocks_.empty() ? 0 : 0.5);
}

double Tree::value_at(Vec3 position) const {
    TreeSample const s = sampler_.sample(position);
    return s.weight > 0 ? static_cast<double>(s.value) : std::numeric_limits<double>::quiet_NaN();
}

TreeView Tree::view(Visibility const& visibility, StoredBlocks const& blocks) const {
    double extent = 0;
    for (int a = 0; a < 3; ++a) extent = std::max(extent, static_cast<double>(region_.upper[a]));
    double const slack = 1e-6 + 1e-9 * extent;
    BlocksView const marched = blocks_.view(blocks);
    double const more = marched.cells != nullptr ? blocks_.widest() : 0; // between cells one that lies outside counts
    Double3 const around{slack + more, slack + more, slack + more};
    return {sampler_.volume().buffer().read(Space::host),
            type_,
            sampler_.index().nodes().data(),
            sampler_.index().order().data(),
            sampler_.bricks().data(),
            boxes_.data(),
            visibility.range.data(),
            visibility.visible_before.data(),
            slack,
            visibility.lower - around,
            visibility.upper + around,
            cells_.origin,
            cells_.size,
            cells_.first.data(),
            cells_.bricks.data(),
            static_cast<std::int64_t>(sampler_.volume().header().bytes()),
            marched,
            2 * more};
}

} // namespace vkt::render
