// Crop, flip and merging of hierarchical volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/edit.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <array>
#include <memory>
#include <unordered_map>
#include <utility>

namespace vkt {

namespace {

Vec3 as_point(Index3 p) { return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)}; }

void require_tree(Header const& header) {
    if (header.kind != Kind::hierarchical) throw Error(ErrorKind::failure, "not a hierarchical volume");
}

/// Where the cells of a brick go in the merged volume.
struct Placement {
    std::size_t brick; ///< of the merged volume
    Index3 at;         ///< first cell in it
};

struct Merging {
    std::vector<Brick> bricks;
    std::vector<Placement> placement; ///< of every original brick
};

struct PositionHash {
    std::size_t operator()(std::array<std::int64_t, 7> const& key) const {
        std::uint64_t hash = 0x9e3779b97f4a7c15ULL;
        for (std::int64_t const v : key)
            hash = (hash ^ static_cast<std::uint64_t>(v)) * 0xff51afd7ed558ccdULL ^ hash >> 29;
        return hash;
    }
};

/// One round: groups of equal siblings become one brick at the place of the first. False if there was no group.
bool merge_round(Merging& merging, Index3 logical, std::int64_t largest) {
    struct Group {
        std::vector<std::size_t> members;
    };
    std::unordered_map<std::array<std::int64_t, 7>, Group, PositionHash> groups;
    int siblings = 1;
    for (int a = 0; a < 3; ++a) siblings *= logical[a] == 1 ? 1 : 2;
    auto const factor = [&](int a) { return std::int64_t{logical[a] == 1 ? 1 : 2}; };
    auto const key_of = [&](Brick const& brick) {
        std::array<std::int64_t, 7> key{brick.level, brick.dims.x, brick.dims.y, brick.dims.z, 0, 0, 0};
        Index3 const w = cell_width(logical, brick.level);
        for (int a = 0; a < 3; ++a) {
            std::int64_t const extent = brick.dims[a] * w[a];
            if (brick.lower[a] % extent != 0 || brick.dims[a] * factor(a) > largest)
                return std::array<std::int64_t, 7>{-1};
            key[4 + static_cast<std::size_t>(a)] = brick.lower[a] / extent / factor(a);
        }
        return key;
    };
    for (std::size_t b = 0; b < merging.bricks.size(); ++b) {
        auto const key = key_of(merging.bricks[b]);
        if (key[0] >= 0) groups[key].members.push_back(b);
    }
    std::vector<std::size_t> target(merging.bricks.size());
    std::vector<Index3> shift(merging.bricks.size());
    std::vector<Brick> result;
    std::vector<std::int64_t> leader(merging.bricks.size(), -1);
    bool any = false;
    for (std::size_t b = 0; b < merging.bricks.size(); ++b) {
        Brick const& brick = merging.bricks[b];
        auto const key = key_of(brick);
        auto const group = key[0] >= 0 ? groups.find(key) : groups.end();
        bool const whole =
            group != groups.end() && static_cast<int>(group->second.members.size()) == siblings && siblings > 1;
        std::size_t const first = whole ? group->second.members.front() : b;
        if (first == b) {
            leader[b] = static_cast<std::int64_t>(result.size());
            Brick merged = brick;
            if (whole)
                for (int a = 0; a < 3; ++a) {
                    merged.lower[a] = key[4 + static_cast<std::size_t>(a)] * factor(a) * brick.dims[a] *
                                      cell_width(logical, brick.level)[a];
                    merged.dims[a] = brick.dims[a] * factor(a);
                }
            result.push_back(merged);
            any = any || whole;
        }
        target[b] = static_cast<std::size_t>(leader[first]);
        Index3 const w = cell_width(logical, brick.level);
        for (int a = 0; a < 3; ++a) shift[b][a] = (brick.lower[a] - result[target[b]].lower[a]) / w[a];
    }
    for (Placement& place : merging.placement) {
        place.at = place.at + shift[place.brick];
        place.brick = target[place.brick];
    }
    merging.bricks = std::move(result);
    return any;
}

} // namespace

Box resolve_cells(Roi const& roi, Index3 dims) {
    if (roi.has_steps())
        throw Error(ErrorKind::usage,
                    text("--roi '", roi.text,
                         "': the volume is hierarchical, its cells are of several sizes, and "
                         "there is no every n-th one"),
                    "make it a grid first: vkt resample IN --cells 50M | vkt crop --roi ::2,::2,::2");
    return roi.resolve(dims);
}

BrickSequence crop_tree(BrickSequence bricks, Box const& region, Space space) {
    Header header = bricks.header();
    require_tree(header);
    require_in_region(region, header);
    std::vector<Brick> kept;
    std::vector<std::size_t> places;
    for (std::size_t b = 0; b < bricks.bricks().size(); ++b) {
        Brick const& brick = bricks.bricks()[b];
        if (!domain_meets(brick, header.dims, as_point(region.lower), as_point(region.upper))) continue;
        kept.push_back(brick);
        places.push_back(b);
    }
    if (kept.empty())
        throw Error(ErrorKind::usage, text("region ", region, " meets no brick of the hierarchical volume"));
    header.attributes["roi"] = to_text(region);
    std::size_t const size = size_of(header.dtype), group = bricks.group_bytes();
    BrickOrder const order = bricks.order();
    auto const source = std::make_shared<BrickSequence>(std::move(bricks));
    BrickSequence result(
        std::move(header), std::move(kept),
        [source, places = std::move(places), size, space](std::size_t first, std::size_t count, std::byte* to) {
            for (std::size_t end = first + count, n = 0; first < end; first += n) { // neighbours together
                n = 1;
                while (first + n < end && places[first + n] == places[first] + n) ++n;
                source->read(places[first], n, to, space);
                for (std::size_t i = 0; i < n; ++i)
                    to += static_cast<std::size_t>(source->bricks()[places[first] + i].cells()) * size;
            }
        },
        order, space);
    result.set_group_bytes(group);
    return result;
}

BrickSequence moved_tree(BrickSequence input, Header header, std::vector<Brick> bricks, MoveCells move,
                         Execution const& execution) {
    std::size_t const group = input.group_bytes();
    BrickOrder const order = input.order();
    auto const source = std::make_shared<BrickSequence>(std::move(input));
    BrickSequence result(
        std::move(header), std::move(bricks),
        [source, move = std::move(move), execution](std::size_t first, std::size_t count, std::byte* to) {
            bool const on_gpu = execution.device == Device::gpu;
            select_gpu(execution);
            DataType const type = source->header().dtype;
            std::byte const* const from = source->cells(first, count, execution.space());
            std::vector<std::size_t> offsets;
            std::size_t offset = 0;
            for (std::size_t b = first; b < first + count; ++b)
                offsets.push_back(std::exchange(offset, offset + static_cast<std::size_t>(source->bricks()[b].cells()) *
                                                                     size_of(type)));
            auto const move_brick = [&](std::size_t i, Execution const& on) {
                Box const box = box_of(source->bricks()[first + i].dims);
                move(dense_view(from + offsets[i], type, box, on.space()), to + offsets[i], on);
            };
            if (on_gpu) {
                for (std::size_t i = 0; i < count; ++i) move_brick(i, execution);
                return;
            }
            Execution alone = execution;
            alone.threads = 1;
#pragma omp parallel for num_threads(execution.threads) schedule(static)
            for (std::size_t i = 0; i < count; ++i) move_brick(i, alone);
        },
        order, execution.space());
    result.set_group_bytes(group);
    return result;
}

BrickSequence flip_tree(BrickSequence input, Axis axis, MoveCells mirror, Execution const& execution) {
    Header header = input.header();
    require_tree(header);
    auto const a = static_cast<int>(axis);
    Index3 const logical = header.dims;
    std::vector<Brick> bricks = input.bricks().list();
    for (Brick& brick : bricks) brick.lower[a] = logical[a] - bounds_of(brick, logical).upper[a];
    header.geometry = flipped(header.geometry, axis, logical[a]);
    if (header.attributes.contains("roi")) {
        Box region = region_of(header);
        std::int64_t const lower = region.lower[a];
        region.lower[a] = logical[a] - region.upper[a];
        region.upper[a] = logical[a] - lower;
        header.attributes["roi"] = to_text(region);
    }
    return moved_tree(std::move(input), std::move(header), std::move(bricks), std::move(mirror), execution);
}

Volume merge_siblings(Volume const& volume, std::int64_t largest, Execution const& execution) {
    require_tree(volume.header());
    Merging merging{volume.bricks().list(), {}};
    for (std::size_t b = 0; b < merging.bricks.size(); ++b) merging.placement.push_back({b, {0, 0, 0}});
    while (merge_round(merging, volume.header().dims, largest)) {
    }
    Volume result(volume.header(), std::move(merging.bricks));
    std::byte const* const from = volume.buffer().read(Space::host);
    std::byte* const to = result.buffer().write(Space::host);
    DataType const dtype = volume.header().dtype;
    std::size_t const bytes = size_of(dtype);
    auto const count = static_cast<std::int64_t>(merging.placement.size());
#pragma omp parallel for num_threads(execution.threads) schedule(static)
    for (std::int64_t i = 0; i < count; ++i) {
        auto const b = static_cast<std::size_t>(i);
        Placement const& place = merging.placement[b];
        Index3 const n = volume.bricks()[b].dims;
        ConstView const source =
            dense_view(from + static_cast<std::size_t>(volume.brick_offset(b)) * bytes, dtype, box_of(n));
        AnyView const whole = dense_view(to + static_cast<std::size_t>(result.brick_offset(place.brick)) * bytes, dtype,
                                         box_of(result.bricks()[place.brick].dims));
        copy(source, whole.part({place.at, place.at + n}));
    }
    return result;
}

} // namespace vkt
