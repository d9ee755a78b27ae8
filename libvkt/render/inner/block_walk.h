// A ray through the blocks of a brick tree: the leaves on its way, and its points in them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/tree.h"

#include <bit>
#include <limits>

namespace vkt::render {

/// Where a ray is in a leaf.
struct LeafPart {
    BlockLeaf const* leaf;
    double enter, leave;
};

/// A ray among the leaves. Where it enters and leaves one depends on nothing but both of them.
struct LeafWalk {
    BlocksView const& blocks;
    double origin[3], direction[3];
    double per[3], entering[3], leaving[3]; ///< lengths along the ray per finest cell; what is added on entry and exit
    double low[3], high[3];                 ///< 1 where the lower, or the upper, face is met last
    double hair; ///< more than what rounding does to positions; parts of less than two are passed over

    VKT_HD LeafWalk(TreeView const& tree, Ray const& ray)
        : blocks(tree.blocks), origin{ray.entry.x, ray.entry.y, ray.entry.z}, direction{ray.direction.x,
                                                                                        ray.direction.y,
                                                                                        ray.direction.z},
          hair(tree.slack) {
        constexpr double never = std::numeric_limits<double>::infinity();
        for (int a = 0; a < 3; ++a) {
            bool const moves = direction[a] != 0;
            per[a] = moves ? 1 / direction[a] : 0;
            entering[a] = moves ? -origin[a] * per[a] : -never;
            leaving[a] = moves ? -origin[a] * per[a] : never;
            low[a] = direction[a] > 0 ? 0 : 1;
            high[a] = 1 - low[a];
        }
    }

    VKT_HD LeafPart at(double t) const {
        double const p[3] = {origin[0] + direction[0] * t, origin[1] + direction[1] * t, origin[2] + direction[2] * t};
        BlockLeaf const& leaf = blocks.at(p);
        auto const edge = static_cast<double>(leaf.edge);
        double first[3], last[3];
        for (int a = 0; a < 3; ++a) {
            auto const lower = static_cast<double>(leaf.lower[a]);
            first[a] = (lower + low[a] * edge) * per[a] + entering[a];
            last[a] = (lower + high[a] * edge) * per[a] + leaving[a];
        }
        double const enter = first[0] > first[1] ? first[0] : first[1], leave = last[0] < last[1] ? last[0] : last[1];
        return {&leaf, enter > first[2] ? enter : first[2], leave < last[2] ? leave : last[2]};
    }
    VKT_HD bool counts(LeafPart const& part) const { return part.leave - part.enter > 2 * hair; }
    /// A place behind a part that was found at t, further on in any case.
    VKT_HD double behind(LeafPart const& part, double t) const { return part.leave > t + hair ? part.leave : t + hair; }
    /// The one in which the ray goes on at t, and the one that it comes from.
    VKT_HD LeafPart after(double t, double length) const {
        LeafPart part = at(t + hair);
        while (!counts(part) && t < length) {
            t = behind(part, t);
            part = at(t + hair);
        }
        return part;
    }
    VKT_HD LeafPart before(double t) const {
        LeafPart part = at(t - hair);
        while (!counts(part) && t > 0) {
            t = part.enter < t - hair ? part.enter : t - hair;
            part = at(t - hair);
        }
        return part;
    }
};

/// 2^n.
VKT_HD double power_of_two(int n) { return std::bit_cast<double>(static_cast<std::int64_t>(1023 + n) << 52); }

/// The points of a ray in a leaf: the multiples of the step times the width of its cells, or, where there is none,
/// where the ray enters.
struct LeafPoints {
    double spacing = 0, enter = 0; ///< enter: where the only one is
    std::int64_t first = 0;        ///< multiple
    int count = 0;                 ///< of multiples

    explicit VKT_HD LeafPoints(double only) : enter(only) {}
    VKT_HD LeafPoints(LeafPart const& part, double step, double per_step, double length, double hair) {
        spacing = step * power_of_two(part.leaf->level);
        double const per_spacing = per_step * power_of_two(-part.leaf->level);
        enter = part.enter > hair ? part.enter : 0; // the ray begins there
        double const leave = part.leave < length ? part.leave : length;
        first = static_cast<std::int64_t>(enter * per_spacing);
        while (static_cast<double>(first) * spacing < enter) ++first;
        auto last = static_cast<std::int64_t>(leave * per_spacing) + 1;
        while (last >= first && !(static_cast<double>(last) * spacing < leave)) --last;
        count = last < first ? 0 : static_cast<int>(last - first + 1);
    }
    VKT_HD double at(int i) const { return count == 0 ? enter : static_cast<double>(first + i) * spacing; }
    VKT_HD int last() const { return count == 0 ? 0 : count - 1; }
};

/// From lengths along a ray to the lattice of a leaf's block.
struct LeafFrame {
    double enter;
    float base[3], way[3]; ///< way: per finest cell
    float upper[3];        ///< within which there are central differences
    float per_finest;
    std::int32_t block;

    LeafFrame() = default;
    VKT_HD LeafFrame(LeafWalk const& walk, LeafPart const& part) {
        BlockLeaf const& leaf = *part.leaf;
        double const per = power_of_two(-leaf.level);
        enter = part.enter > 0 ? part.enter : 0;
        block = leaf.block;
        per_finest = static_cast<float>(per);
        for (int a = 0; a < 3; ++a) {
            double const scale = walk.blocks.thin[a] ? 1 : per;
            double const from = walk.origin[a] + walk.direction[a] * enter - static_cast<double>(leaf.lower[a]);
            way[a] = static_cast<float>(walk.direction[a] * scale);
            base[a] = static_cast<float>(from * scale + (block_halo - 0.5));
            upper[a] = static_cast<float>(leaf.thickness[a]) + (block_halo - 1e-3F);
        }
    }
};

} // namespace vkt::render
