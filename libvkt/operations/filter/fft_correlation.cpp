// Overlap-save correlation on a grid of squares that is fixed in the volume.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/fft_correlation.h"

#include "libvkt/core/first_failure.h"
#include "libvkt/operations/common/row_values.h"
#include "libvkt/operations/filter/fft_module.h"
#include "libvkt/operations/filter/kernels/spectra.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vkt {

namespace {

using Complex = std::complex<double>;

constexpr double largest = 1e280; ///< sums of transforms of these stay finite

FftFunctions const& fft() {
    static auto const* const functions =
        static_cast<FftFunctions const*>(module_functions("kissfft", "filter kernel --method fft"));
    return *functions;
}

std::size_t index(std::int64_t i) { return static_cast<std::size_t>(i); }

/// What a thread works with.
struct Workspace {
    std::vector<double> ring, row; ///< the transforms of slices, see SpectraLayout; a row of voxels
    std::vector<Complex> sums, values, scratch;
    std::vector<bool> bad; ///< slots of slices that are computed by definition
};

/// Slices whose sums along z are made at once, so that transforms are read once for many of them.
std::int64_t batch_for(std::int64_t edge) { return edge > 128 ? 8 : 16; }

} // namespace

FftSquares::FftSquares(Index3 radius, Index3 dims) {
    // KISS FFT takes half the time a point for lengths that end with a factor of 5.
    constexpr std::array<std::int64_t, 8> edges{40, 60, 80, 100, 120, 160, 200, 240};
    auto const squares_along = [](std::int64_t n, std::int64_t step) { return (n + step - 1) / step; };
    cost = std::numeric_limits<double>::infinity();
    for (std::int64_t const e : edges) {
        std::int64_t const x = e - 2 * radius.x, y = e - 2 * radius.y;
        if (std::min(x, y) <= 0) continue;
        std::int64_t const pairs = (squares_along(dims.x, x) * squares_along(dims.y, y) + 1) / 2;
        // Measured at 256^3: both transforms, sums along z, and the rest.
        double const point = 190 * std::log2(static_cast<double>(e)) + 50 * static_cast<double>(2 * radius.z + 1) + 375;
        double const all = point * static_cast<double>(pairs * e * e) / static_cast<double>(dims.x * dims.y);
        if (all < cost) cost = all, edge = e;
    }
}

double FftSquares::error(Index3 radius) const {
    // Each of the three transforms is off by at most 20 roundings a stage of its largest possible sum, twiddle factors
    // included, products and their sums along z by one each; the largest element is at most the root of the sum of
    // squares, of two squares of voxels at once.
    auto const e = static_cast<double>(edge);
    return std::sqrt(2.0) * e * (3 * 20 * 2 * std::log2(e) + 2 * static_cast<double>(radius.z) + 8) * 0x1p-53;
}

std::size_t FftSquares::bytes(Index3 radius) const {
    std::int64_t const batch = batch_for(edge);
    return index(edge * edge * (2 * radius.z + batch + batch + 2)) * sizeof(Complex);
}

FftCorrelation::FftCorrelation(DenseKernel const& kernel, Index3 dims)
    : kernel_(kernel), dims_(dims), edge_(FftSquares(kernel.radius, dims).edge) {
    Index3 const r = kernel.radius;
    std::size_t const area = index(edge_ * edge_);
    SpectraLayout const layout{edge_ * edge_, 2 * r.z + 1};
    spectra_.resize(index(layout.doubles()));
    std::vector<Complex> slice(area), scratch(area);
    for (std::int64_t z = -r.z; z <= r.z; ++z) {
        std::fill(slice.begin(), slice.end(), Complex());
        for (Tap const& tap : kernel.taps)
            if (tap.at.z == z)
                slice[index((tap.at.y + r.y) * edge_ + tap.at.x + r.x)] += tap.weight / static_cast<double>(area);
        fft().transform(index(edge_), false, slice.data(), scratch.data());
        for (Complex& value : slice) value = std::conj(value); // correlation
        store_spectrum(slice.data(), layout, z + r.z, spectra_.data(), Execution());
    }
}

void FftCorrelation::run(ConstView in, AnyView out, Execution const& execution) const {
    Index3 const r = kernel_.radius, step{edge_ - 2 * r.x, edge_ - 2 * r.y, 1};
    std::int64_t const columns = (dims_.x + step.x - 1) / step.x, squares = columns * ((dims_.y + step.y - 1) / step.y);
    std::int64_t const depth = 2 * r.z + 1, batch = batch_for(edge_);
    SpectraLayout const layout{edge_ * edge_, depth + batch - 1};
    std::size_t const area = index(edge_ * edge_);
    auto const to = out.as<double>();
    auto const square = [&](std::int64_t number) {
        Index3 const lower{number % columns * step.x, number / columns * step.y, out.box.lower.z};
        Box box{lower, {lower.x + step.x, lower.y + step.y, out.box.upper.z}};
        return number < squares ? intersect(box, out.box) : Box{};
    };
    Execution one = execution;
    one.threads = 1;
    one.monitor = nullptr;

    // Slices [begin, end) of two squares.
    auto const pair = [&](std::int64_t first, std::int64_t begin, std::int64_t end, Workspace& workspace) {
        std::vector<double>&ring = workspace.ring, &row = workspace.row;
        std::vector<Complex>&sums = workspace.sums, &values = workspace.values, &scratch = workspace.scratch;
        std::vector<bool>& bad = workspace.bad;
        Box const boxes[2] = {square(first), square(first + 1)};
        if (boxes[0].empty() && boxes[1].empty()) return;
        std::int64_t const lowest = begin - r.z;
        ring.resize(index(layout.doubles())), row.resize(index(edge_));
        sums.resize(area * index(batch)), values.resize(area), scratch.resize(area);
        bad.resize(index(layout.slots));
        auto const slot_of = [&](std::int64_t z) { return (z - lowest) % layout.slots; };

        auto const take = [&](std::int64_t z) {
            std::fill(values.begin(), values.end(), Complex());
            bool finite = true;
            for (int part = 0; part < 2 && first + part < squares; ++part) {
                std::int64_t const number = first + part, x0 = number % columns * step.x - r.x,
                                   y0 = number / columns * step.y - r.y;
                std::int64_t const width = std::min(edge_, dims_.x + r.x - x0),
                                   height = std::min(edge_, dims_.y + r.y - y0);
                for (std::int64_t y = 0; y < height; ++y) {
                    read_row(in.part({{x0, y0 + y, z}, {x0 + width, y0 + y + 1, z + 1}}), y0 + y, z, row.data());
                    for (std::int64_t x = 0; x < width; ++x) {
                        double const v = row[index(x)];
                        finite = finite && std::abs(v) <= largest;
                        reinterpret_cast<double*>(&values[index(y * edge_ + x)])[part] = v;
                    }
                }
            }
            bad[index(slot_of(z))] = !finite;
            if (finite)
                fft().transform(index(edge_), false, values.data(), scratch.data());
            else
                std::fill(values.begin(), values.end(), Complex());
            store_spectrum(values.data(), layout, slot_of(z), ring.data(), execution);
        };
        auto const give = [&](std::int64_t centre, Complex* sum) {
            bool direct = false;
            for (std::int64_t z = centre - r.z; z <= centre + r.z; ++z) direct = direct || bad[index(slot_of(z))];
            if (!direct) fft().transform(index(edge_), true, sum, scratch.data());
            for (int part = 0; part < 2; ++part) {
                Box box = boxes[part];
                if (box.empty()) continue;
                box.lower.z = centre;
                box.upper.z = centre + 1;
                std::int64_t const x0 = (first + part) % columns * step.x, y0 = (first + part) / columns * step.y;
                if (direct) {
                    Losses none;
                    correlate_dense(in, out.part(box), kernel_, none, one);
                    continue;
                }
                for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                    for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                        to(x, y, centre) =
                            reinterpret_cast<double const*>(sum + (y - y0) * edge_ + x - x0)[part] + kernel_.offset;
            }
        };
        std::int64_t taken = lowest;
        for (std::int64_t z = begin; z < end; z += batch) {
            std::int64_t const count = std::min(batch, end - z);
            while (taken < z + count + r.z) take(taken++);
            sum_spectra(
                {layout, ring.data(), {layout.area, depth}, spectra_.data(), slot_of(z - r.z), count, sums.data()},
                execution);
            for (std::int64_t o = 0; o < count; ++o) give(z + o, &sums[area * index(o)]);
        }
    };

    // Where there are fewer pairs than threads, each is cut into parts along z that are not much smaller than what they
    // need beside them.
    std::int64_t const pairs = (squares + 1) / 2, slices = out.box.dims().z;
    std::int64_t const wanted = (std::max(1, execution.threads) + pairs - 1) / pairs;
    std::int64_t const parts = std::clamp<std::int64_t>(slices / depth, 1, wanted);
    int const threads = static_cast<int>(std::clamp<std::int64_t>(pairs * parts, 1, std::max(1, execution.threads)));
    FirstFailure failure;
#pragma omp parallel num_threads(threads) if (threads > 1)
    {
        Workspace workspace;
#pragma omp for schedule(dynamic)
        for (std::int64_t item = 0; item < pairs * parts; ++item)
            failure.catch_from([&] {
                std::int64_t const part = item % parts, z = out.box.lower.z;
                pair(item / parts * 2, z + slices * part / parts, z + slices * (part + 1) / parts, workspace);
            });
    }
    failure.rethrow();
}

} // namespace vkt
