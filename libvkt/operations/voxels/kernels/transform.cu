// Expressions on GPUs: a thread a voxel runs all operations, one after the other.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/transform.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/elementwise.h"

#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

constexpr int most_slots = 96, most_inputs = 8;

struct Step {
    Op op;
    std::uint8_t operands;
    std::uint16_t to, in[3];
};

/// A voxel of an input, beside the one that is computed.
struct Neighbour {
    std::uint16_t slot;
    std::uint8_t volume;
    int x, y, z;
};

/// Volumes and places as kernels get them.
struct Machine {
    Step const* steps;
    ProgramNumber const* numbers;
    Neighbour const* neighbours;
    int step_count, number_count, neighbour_count, result;
    ProgramPlace place;
    ValueMap map[most_inputs], stored;
    driver::DeviceRows in[most_inputs]; ///< at the first voxel of the output
    bool mapped[most_inputs], wide[most_inputs], stores_mapped, stores_wide, counts_undefined;
    driver::DeviceRows out;
    Index3 lower; ///< of the output
    unsigned long long* inexact;
};

__device__ __forceinline__ double position_of(ProgramPlace const& place, Op op, double x, double y, double z) {
    auto const &column = place.column[0], &row = place.column[1], &slice = place.column[2];
    switch (op) {
    case Op::x:
        return place.first.x + place.step.x * x;
    case Op::y:
        return place.first.y + place.step.y * y;
    case Op::z:
        return place.first.z + place.step.z * z;
    case Op::wx:
        return ((place.origin.x + column.x * x) + row.x * y) + slice.x * z;
    case Op::wy:
        return ((place.origin.y + column.y * x) + row.y * y) + slice.y * z;
    default:
        return ((place.origin.z + column.z * x) + row.z * y) + slice.z * z;
    }
}

template <class C> __device__ __forceinline__ bool is_finite(C v) {
    return std::fabs(v) <= std::numeric_limits<C>::max();
}

template <class C> struct Run {
    Machine m;

    __device__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z, driver::LossCounts& counts) const {
        C slot[most_slots];
        for (int i = 0; i < m.number_count; ++i) slot[m.numbers[i].slot] = static_cast<C>(m.numbers[i].value);
        bool known = true, exact = true;
        for (int i = 0; i < m.neighbour_count; ++i) {
            Neighbour const n = m.neighbours[i];
            C const value = load(n, x, y, z);
            slot[n.slot] = value;
            known = known && is_finite(value);
            exact = exact && (!m.wide[n.volume] || !(std::fabs(value) >= C(0x1p53)));
        }
        auto const px = static_cast<double>(m.lower.x + x), py = static_cast<double>(m.lower.y + y),
                   pz = static_cast<double>(m.lower.z + z);
        for (int i = 0; i < m.step_count; ++i) {
            Step const step = m.steps[i];
            C value{};
            if (step.op == Op::number) // a voxel, a position or a number as it is
                value = slot[step.in[0]];
            else if (step.operands == 0)
                value = static_cast<C>(position_of(m.place, step.op, px, py, pz));
            else if (step.operands == 1)
                with_one<C>(step.op, [&](auto const f) { value = static_cast<C>(f(slot[step.in[0]])); });
            else if (step.operands == 2)
                with_two<C>(step.op,
                            [&](auto const f) { value = static_cast<C>(f(slot[step.in[0]], slot[step.in[1]])); });
            else
                with_three<C>(step.op, [&](auto const f) {
                    value = static_cast<C>(f(slot[step.in[0]], slot[step.in[1]], slot[step.in[2]]));
                });
            slot[step.to] = value;
        }
        C result = slot[m.result];
        if (m.counts_undefined && known && !is_finite(result)) ++counts.undefined;
        if constexpr (sizeof(C) == 8) {
            exact = exact && (!m.stores_wide || !(std::fabs(result) >= 0x1p53));
            if (!exact) atomicAdd(m.inexact, 1ULL);
        }
        if (m.stores_mapped) result = (result - static_cast<C>(m.stored.intercept)) / static_cast<C>(m.stored.slope);
        driver::store_value(m.out.type, m.out.at(x, y, z), result, counts);
    }

private:
    __device__ __forceinline__ C load(Neighbour const& n, std::int64_t x, std::int64_t y, std::int64_t z) const {
        driver::DeviceRows const& rows = m.in[n.volume];
        C const v = driver::load_value<C>(rows.type, rows.at(x + n.x, y + n.y, z + n.z));
        if (!m.mapped[n.volume]) return v;
        auto const slope = static_cast<C>(m.map[n.volume].slope), intercept = static_cast<C>(m.map[n.volume].intercept);
        C const value = slope * v + intercept;
        // The product may be beyond C where the sum is not.
        return value - value == 0 ? value : C(2) * (C(0.5) * slope * v + C(0.5) * intercept);
    }
};

std::vector<Step> steps_of(Program const& program) {
    std::vector<Step> steps;
    for (auto const* const part : {&program.along_x, &program.per_row, &program.per_voxel})
        for (Instruction const& one : *part)
            steps.push_back(
                {one.op, static_cast<std::uint8_t>(operands_of(one.op)), one.to, {one.in[0], one.in[1], one.in[2]}});
    return steps;
}

std::vector<Neighbour> neighbours_of(Program const& program) {
    std::vector<Neighbour> neighbours;
    for (ProgramVoxel const& voxel : program.voxels) {
        ProgramRow const& row = program.rows[voxel.row];
        neighbours.push_back({voxel.slot, static_cast<std::uint8_t>(row.volume),
                              static_cast<int>(row.from + voxel.aside), static_cast<int>(row.y),
                              static_cast<int>(row.z)});
    }
    return neighbours;
}

bool is_wide(DataType type) { return is_integer(type) && size_of(type) == 8; }

} // namespace

void transform_voxels(TransformTask const& task, std::span<ConstView const> in, AnyView out, TransformLosses& losses,
                      Execution const&) {
    if (out.box.empty()) return;
    Program const& program = *task.program;
    if (program.slots > most_slots || in.size() > most_inputs)
        throw Error(ErrorKind::resources, "the expression is too long for a GPU", "use --device cpu");
    std::vector<Step> const code = steps_of(program);
    driver::DeviceList const steps(code);
    driver::DeviceList const numbers(program.numbers);
    driver::DeviceList const neighbours(neighbours_of(program));
    driver::DeviceList const inexact(std::vector<unsigned long long>{0});
    Machine m{};
    m.steps = steps.get();
    m.numbers = numbers.get();
    m.neighbours = neighbours.get();
    m.step_count = static_cast<int>(code.size());
    m.number_count = static_cast<int>(program.numbers.size());
    m.neighbour_count = static_cast<int>(program.voxels.size());
    m.result = program.result;
    m.place = task.place;
    m.stored = task.result;
    m.stores_mapped = !(task.result == ValueMap{});
    m.stores_wide = is_wide(out.type);
    m.counts_undefined = task.counts_undefined;
    for (std::size_t i = 0; i < in.size(); ++i) {
        m.map[i] = task.maps[i];
        m.mapped[i] = !(task.maps[i] == ValueMap{});
        m.wide[i] = is_wide(in[i].type);
        m.in[i] = driver::device_rows(in[i], out.box);
    }
    m.out = driver::device_rows(ConstView(out), out.box);
    m.lower = out.box.lower;
    m.inexact = const_cast<unsigned long long*>(inexact.get());
    driver::DeviceLosses const counts;
    if (task.in_float)
        driver::for_each_voxel(out.dims(), Run<float>{m}, counts.get(), "transform");
    else
        driver::for_each_voxel(out.dims(), Run<double>{m}, counts.get(), "transform");
    counts.add_to(losses.losses);
    unsigned long long found = 0;
    copy_to_host(&found, inexact.get(), sizeof found);
    losses.inexact += static_cast<std::int64_t>(found);
}

} // namespace vkt::VKT_BACKEND
