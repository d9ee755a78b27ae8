// The 256 cases of a cell, derived: polygons around its faces, cut into triangles that keep off them.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/surface.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace vkt {
namespace {

struct Edge {
    int axis, lower; ///< lower: the corner at its beginning
};

constexpr int edge_count = 12;

Edge edge_of(int number) {
    int const axis = number / 4, k = number % 4;
    int const u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    return {axis, (k & 1) << u | (k >> 1) << v};
}

int number_of_edge(int a, int b) {
    int const lower = std::min(a, b), difference = a ^ b, axis = difference == 1 ? 0 : difference == 2 ? 1 : 2;
    int const u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    return 4 * axis + (lower >> u & 1) + 2 * (lower >> v & 1);
}

/// Corners of face 2 * axis + side, counterclockwise seen from outside of the cell.
std::array<int, 4> face_of(int number) {
    int const axis = number / 2, side = number % 2, u = (axis + 1) % 3, v = (axis + 2) % 3, first = side << axis;
    std::array<int, 4> corners{first, first | 1 << u, first | 1 << u | 1 << v, first | 1 << v};
    if (side == 0) std::reverse(corners.begin(), corners.end());
    return corners;
}

bool share_a_face(int a, int b) {
    Edge const p = edge_of(a), q = edge_of(b);
    for (int axis = 0; axis < 3; ++axis)
        if (axis != p.axis && axis != q.axis && (p.lower >> axis & 1) == (q.lower >> axis & 1)) return true;
    return false;
}

/// Squared distance between the middles of two edges, times 4.
int distance(int a, int b) {
    Edge const p = edge_of(a), q = edge_of(b);
    int sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
        int const x = axis == p.axis ? 1 : 2 * (p.lower >> axis & 1),
                  y = axis == q.axis ? 1 : 2 * (q.lower >> axis & 1);
        sum += (x - y) * (x - y);
    }
    return sum;
}

using Triangles = std::vector<std::array<int, 3>>;

/// The part i…j of a polygon in triangles whose inner edges have the least sum of squares and lie in no face; empty
/// and a cost that is the largest if there is none.
std::pair<int, Triangles> cut(std::vector<int> const& polygon, std::size_t i, std::size_t j) {
    constexpr int impossible = std::numeric_limits<int>::max();
    if (j - i < 2) return {0, {}};
    auto const cost_of = [&](std::size_t a, std::size_t b) {
        if (b - a == 1 || (a == 0 && b + 1 == polygon.size())) return 0;
        return share_a_face(polygon[a], polygon[b]) ? impossible : distance(polygon[a], polygon[b]);
    };
    std::pair<int, Triangles> best{impossible, {}};
    for (std::size_t k = i + 1; k < j; ++k) {
        int const left = cost_of(i, k), right = cost_of(k, j);
        if (left == impossible || right == impossible) continue;
        auto [left_cost, triangles] = cut(polygon, i, k);
        auto const rest = cut(polygon, k, j);
        if (left_cost == impossible || rest.first == impossible) continue;
        int const cost = left + right + left_cost + rest.first;
        if (cost >= best.first) continue;
        triangles.insert(triangles.end(), rest.second.begin(), rest.second.end());
        triangles.push_back({polygon[i], polygon[k], polygon[j]});
        best = {cost, std::move(triangles)};
    }
    return best;
}

/// Where the surface goes on from each crossed edge: around every run of inside corners of every face.
std::array<int, edge_count> successors(int inside) {
    std::array<int, edge_count> next{};
    next.fill(-1);
    for (int number = 0; number < 6; ++number) {
        std::array<int, 4> const face = face_of(number);
        auto const corner = [&](int i) { return face[static_cast<std::size_t>(i % 4)]; };
        auto const is_in = [&](int i) { return (inside >> corner(i) & 1) != 0; };
        for (int i = 0; i < 4; ++i) {
            if (is_in(i) || !is_in(i + 1)) continue;
            int last = i + 1;
            while (is_in(last + 1)) ++last;
            int const enters = number_of_edge(corner(i), corner(i + 1));
            int const leaves = number_of_edge(corner(last), corner(last + 1));
            next[static_cast<std::size_t>(enters)] = leaves;
        }
    }
    return next;
}

SurfaceCases derive() {
    SurfaceCases cases;
    for (int inside = 0; inside < 256; ++inside) {
        auto const which = static_cast<std::size_t>(inside);
        auto next = successors(inside);
        std::size_t n = 0;
        for (int first = 0; first < edge_count; ++first) {
            std::vector<int> polygon;
            for (int edge = first; next[static_cast<std::size_t>(edge)] >= 0;) {
                polygon.push_back(edge);
                int const following = next[static_cast<std::size_t>(edge)];
                next[static_cast<std::size_t>(edge)] = -1;
                edge = following;
            }
            if (polygon.empty()) continue;
            for (auto const& triangle : cut(polygon, 0, polygon.size() - 1).second) {
                for (int const edge : triangle) cases.edges[which][n++] = static_cast<std::uint8_t>(edge);
                ++cases.count[which];
            }
        }
    }
    return cases;
}

} // namespace

SurfaceCases const& surface_cases() {
    static SurfaceCases const cases = derive();
    return cases;
}

} // namespace vkt
