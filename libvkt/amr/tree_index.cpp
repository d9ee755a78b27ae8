// The bounding-volume hierarchy over brick domains.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/tree.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt {

namespace {

constexpr std::int32_t leaf_size = 4;
constexpr float infinity = std::numeric_limits<float>::infinity();

float rounded_down(double v) {
    auto const f = static_cast<float>(v);
    return static_cast<double>(f) > v ? std::nextafter(f, -infinity) : f;
}

float rounded_up(double v) {
    auto const f = static_cast<float>(v);
    return static_cast<double>(f) < v ? std::nextafter(f, infinity) : f;
}

} // namespace

BrickIndex::BrickIndex(Index3 logical_dims, BrickTable const& bricks) {
    if (bricks.size() > std::size_t{1} << 30)
        throw Error(ErrorKind::resources, "more than 2^30 bricks cannot be indexed");
    if (bricks.empty()) return;
    std::vector<float> boxes(6 * bricks.size()); // lower corner, upper corner
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        Box const domain = domain_of(bricks[i], logical_dims);
        for (int a = 0; a < 3; ++a) {
            boxes[6 * i + static_cast<std::size_t>(a)] = rounded_down(0.5 * static_cast<double>(domain.lower[a]));
            boxes[6 * i + 3 + static_cast<std::size_t>(a)] = rounded_up(0.5 * static_cast<double>(domain.upper[a]));
        }
    }
    order_.resize(bricks.size());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::int32_t>(i);
    nodes_.reserve(2 * bricks.size() / static_cast<std::size_t>(leaf_size) + 2);
    nodes_.emplace_back();
    split(0, 0, static_cast<std::int32_t>(order_.size()), boxes);
}

void BrickIndex::split(std::int32_t node, std::int32_t begin, std::int32_t end, std::vector<float> const& boxes) {
    IndexNode box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}, begin, end - begin};
    float centre_low[3] = {infinity, infinity, infinity}, centre_high[3] = {-infinity, -infinity, -infinity};
    for (std::int32_t k = begin; k < end; ++k) {
        float const* const b = boxes.data() + 6 * static_cast<std::size_t>(order_[static_cast<std::size_t>(k)]);
        for (int a = 0; a < 3; ++a) {
            box.lower[a] = std::min(box.lower[a], b[a]);
            box.upper[a] = std::max(box.upper[a], b[3 + a]);
            centre_low[a] = std::min(centre_low[a], b[a] + b[3 + a]);
            centre_high[a] = std::max(centre_high[a], b[a] + b[3 + a]);
        }
    }
    if (box.count > leaf_size) {
        int axis = 0;
        for (int a = 1; a < 3; ++a)
            if (centre_high[a] - centre_low[a] > centre_high[axis] - centre_low[axis]) axis = a;
        std::int32_t const middle = begin + (end - begin) / 2;
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](std::int32_t i, std::int32_t j) {
                             float const* const a = boxes.data() + 6 * static_cast<std::size_t>(i);
                             float const* const b = boxes.data() + 6 * static_cast<std::size_t>(j);
                             float const ca = a[axis] + a[3 + axis], cb = b[axis] + b[3 + axis];
                             return ca != cb ? ca < cb : i < j;
                         });
        box.first = static_cast<std::int32_t>(nodes_.size());
        box.count = 0;
        nodes_.resize(nodes_.size() + 2);
        split(box.first, begin, middle, boxes);
        split(box.first + 1, middle, end, boxes);
    }
    nodes_[static_cast<std::size_t>(node)] = box;
}

void BrickIndex::query(Vec3 lower, Vec3 upper, std::vector<std::int32_t>& ids) const {
    ids.clear();
    if (nodes_.empty()) return;
    std::int32_t stack[128];
    int depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
        IndexNode const& node = nodes_[static_cast<std::size_t>(stack[--depth])];
        bool meets = true;
        for (int a = 0; a < 3; ++a)
            meets =
                meets && static_cast<double>(node.lower[a]) < upper[a] && static_cast<double>(node.upper[a]) > lower[a];
        if (!meets) continue;
        if (node.count == 0) {
            stack[depth++] = node.first;
            stack[depth++] = node.first + 1;
        } else {
            // The boxes of single bricks are not kept: the node's box is near enough, callers test exactly.
            for (std::int32_t k = 0; k < node.count; ++k)
                ids.push_back(order_[static_cast<std::size_t>(node.first) + static_cast<std::size_t>(k)]);
        }
    }
    std::sort(ids.begin(), ids.end());
}

} // namespace vkt
