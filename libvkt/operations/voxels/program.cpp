// Instructions, in which buffers they work, and intervals.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/program.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt {
namespace {

/// On what a value depends, as bits.
enum Dependence : unsigned { on_x = 1, on_row = 2, on_voxel = 4 };

unsigned dependence(Node const& node, std::vector<unsigned> const& of) {
    if (node.op == Op::voxel || is_world(node.op)) return on_voxel;
    if (node.op == Op::x) return on_x;
    if (node.op == Op::y || node.op == Op::z) return on_row;
    unsigned result = 0;
    for (int const in : node.in)
        if (in >= 0) result |= of[static_cast<std::size_t>(in)];
    return result == (on_x | on_row) ? result | on_voxel : result;
}

/// The rows that the voxels of a program lie in, each once.
void place_voxels(std::vector<Node> const& nodes, std::vector<int> const& slot, Program& program) {
    auto const row_of = [&](Node const& node) {
        return std::find_if(program.rows.begin(), program.rows.end(), [&](ProgramRow const& row) {
            return row.volume == node.volume && row.y == node.offset.y && row.z == node.offset.z;
        });
    };
    for (Node const& node : nodes) {
        if (node.op != Op::voxel) continue;
        auto const row = row_of(node);
        if (row == program.rows.end()) {
            program.rows.push_back({node.volume, node.offset.x, node.offset.x, node.offset.y, node.offset.z});
        } else {
            row->from = std::min(row->from, node.offset.x);
            row->until = std::max(row->until, node.offset.x);
        }
    }
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (nodes[i].op != Op::voxel) continue;
        auto const row = row_of(nodes[i]);
        program.voxels.push_back({static_cast<std::uint16_t>(slot[i]),
                                  static_cast<std::uint16_t>(row - program.rows.begin()),
                                  nodes[i].offset.x - row->from});
    }
}

} // namespace

std::size_t Program::workspace(std::size_t size_of_value) const {
    std::size_t const pointers = (static_cast<std::size_t>(slots) + rows.size()) * sizeof(void*);
    // Rows hold a piece and what is needed beside it.
    auto const piece = static_cast<std::size_t>(program_piece);
    std::size_t const values = static_cast<std::size_t>(buffers) * piece + rows.size() * 2 * piece;
    return (pointers + 63) / 64 * 64 + (values * size_of_value + 63) / 64 * 64;
}

Program compile(Expression const& expression) {
    std::vector<Node> const& nodes = expression.nodes();
    std::size_t const n = nodes.size();
    std::vector<unsigned> depends(n);
    std::vector<std::size_t> last(n); // the node that takes it last
    std::vector<char> wide_use(n);    // something that depends on more takes it
    for (std::size_t i = 0; i < n; ++i) {
        depends[i] = dependence(nodes[i], depends);
        for (int const in : nodes[i].in) {
            if (in < 0) continue;
            auto const of = static_cast<std::size_t>(in);
            last[of] = i;
            if (depends[of] != depends[i]) wide_use[of] = 1;
        }
    }
    last[n - 1] = n;
    wide_use[n - 1] = 1;

    Program program;
    program.positions = expression.any([](Node const& node) { return is_position(node.op) || is_world(node.op); });
    std::vector<int> slot(n, -1), free;
    auto const computed = [&](std::size_t i) { return nodes[i].op != Op::voxel && (depends[i] & on_voxel) != 0; };
    // What is made once for many pieces keeps its slot.
    for (std::size_t i = 0; i < n; ++i)
        if (nodes[i].op != Op::voxel && !computed(i)) slot[i] = program.buffers++;
    for (std::size_t i = 0; i < n; ++i) {
        if (!computed(i)) continue;
        for (int const in : nodes[i].in) { // what is not needed any more may be overwritten by the result
            if (in < 0) continue;
            auto const of = static_cast<std::size_t>(in);
            if (!computed(of) || last[of] != i) continue;
            if (std::find(free.begin(), free.end(), slot[of]) == free.end()) free.push_back(slot[of]);
        }
        if (i == n - 1) continue; // goes to the output
        if (free.empty()) free.push_back(program.buffers++);
        slot[i] = free.back();
        free.pop_back();
    }
    program.slots = program.buffers;
    for (std::size_t i = 0; i < n; ++i)
        if (nodes[i].op == Op::voxel) slot[i] = program.slots++;
    program.result = program.slots++;
    place_voxels(nodes, slot, program);

    for (std::size_t i = 0; i < n; ++i) {
        Node const& node = nodes[i];
        if (node.op == Op::number) program.numbers.push_back({static_cast<std::uint16_t>(slot[i]), node.number});
        if (node.op == Op::number || node.op == Op::voxel) continue;
        Instruction one;
        one.op = node.op;
        one.to = static_cast<std::uint16_t>(i == n - 1 && computed(i) ? program.result : slot[i]);
        for (std::size_t k = 0; k < 3; ++k)
            if (node.in[k] >= 0) one.in[k] = static_cast<std::uint16_t>(slot[static_cast<std::size_t>(node.in[k])]);
        one.spread = depends[i] == on_row && wide_use[i] != 0;
        auto& stage = computed(i) ? program.per_voxel : depends[i] == on_x ? program.along_x : program.per_row;
        stage.push_back(one);
    }
    if (!computed(n - 1)) { // Op::number: as it is
        Instruction one;
        one.op = Op::number;
        one.to = static_cast<std::uint16_t>(program.result);
        one.in[0] = static_cast<std::uint16_t>(slot[n - 1]);
        program.per_voxel.push_back(one);
    }
    return program;
}

bool Values::bounded() const { return std::isfinite(low) && std::isfinite(high); }

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

Values hull(std::initializer_list<double> ends, bool whole) {
    Values result{whole, infinite, -infinite};
    for (double const end : ends) {
        if (std::isnan(end)) return {whole, -infinite, infinite};
        result.low = std::min(result.low, end);
        result.high = std::max(result.high, end);
    }
    return result;
}

Values values_of(Node const& node, Values const& a, Values const& b, Values const& c) {
    bool const whole = a.whole && b.whole;
    switch (node.op) {
    case Op::neg:
        return {a.whole, -a.high, -a.low};
    case Op::abs:
        return {a.whole, a.low > 0 ? a.low : a.high < 0 ? -a.high : 0, std::max(-a.low, a.high)};
    case Op::floor:
    case Op::ceil:
    case Op::round:
    case Op::trunc:
        return {true, std::floor(a.low), std::ceil(a.high)};
    case Op::sign:
        return {true, -1, 1};
    case Op::sin:
    case Op::cos:
        return {false, -1, 1};
    case Op::add:
        return hull({a.low + b.low, a.high + b.high}, whole);
    case Op::sub:
        return hull({a.low - b.high, a.high - b.low}, whole);
    case Op::mul:
        return hull({a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high}, whole);
    case Op::div:
        if (b.low == b.high && b.low != 0) return hull({a.low / b.low, a.high / b.low}, false);
        break;
    case Op::min:
        return {whole, std::min(a.low, b.low), std::min(a.high, b.high)};
    case Op::max:
        return {whole, std::max(a.low, b.low), std::max(a.high, b.high)};
    case Op::fmod:
    case Op::mod:
        if (b.low > 0) return {whole, node.op == Op::mod || a.low >= 0 ? 0 : -b.high, b.high};
        return {whole, -infinite, infinite};
    case Op::select:
        return {b.whole && c.whole, std::min(b.low, c.low), std::max(b.high, c.high)};
    case Op::clamp:
        return {whole && c.whole, std::min(std::max(a.low, b.low), c.low), std::min(std::max(a.high, b.high), c.high)};
    default:
        if (is_predicate(node.op)) return {true, 0, 1};
    }
    return {false, -infinite, infinite};
}

} // namespace

std::vector<Values> values_of(Expression const& expression, std::span<Values const> volumes,
                              std::span<Values const> positions) {
    std::vector<Values> result;
    auto const at = [&](int i) { return i < 0 ? Values{} : result[static_cast<std::size_t>(i)]; };
    for (Node const& node : expression.nodes()) {
        if (node.op == Op::number)
            result.push_back(
                {std::floor(node.number) == node.number && std::isfinite(node.number), node.number, node.number});
        else if (node.op == Op::voxel)
            result.push_back(volumes[static_cast<std::size_t>(node.volume)]);
        else if (is_position(node.op))
            result.push_back(positions[static_cast<std::size_t>(node.op) - static_cast<std::size_t>(Op::x)]);
        else if (is_world(node.op))
            result.push_back({false, -infinite, infinite});
        else
            result.push_back(values_of(node, at(node.in[0]), at(node.in[1]), at(node.in[2])));
        // A number that is none has no bounds.
        if (std::isnan(result.back().low) || std::isnan(result.back().high))
            result.back() = {false, -infinite, infinite};
    }
    return result;
}

} // namespace vkt
