// Overlap-save correlation on a grid of squares that is fixed in the volume.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/fft_correlation.h"

#include "libvkt/operations/common/row_values.h"
#include "libvkt/operations/filter/fft_module.h"

#include <algorithm>
#include <cmath>
#include <exception>

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

/// sum += a b, without the checks for infinities of std::complex.
void add_products(Complex const* a, Complex const* b, Complex* sum, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i)
        sum[i] += Complex(a[i].real() * b[i].real() - a[i].imag() * b[i].imag(),
                          a[i].real() * b[i].imag() + a[i].imag() * b[i].real());
}

} // namespace

std::int64_t FftCorrelation::edge_for(Index3 radius) {
    std::int64_t const reach = 2 * std::max(radius.x, radius.y);
    return reach <= 20 ? 64 : reach <= 72 ? 128 : 256;
}

double FftCorrelation::cost(Index3 radius) {
    auto const edge = static_cast<double>(edge_for(radius));
    double const points =
        edge * edge / (edge - 2.0 * static_cast<double>(radius.x)) / (edge - 2.0 * static_cast<double>(radius.y));
    return points * (1000 + 130 * static_cast<double>(radius.z)); // measured, slabs of a few times the radius
}

double FftCorrelation::error(Index3 radius) {
    // Each of the three transforms is off by at most 20 roundings a stage of its largest possible sum, twiddle factors
    // included, products and their sums along z by one each; the largest element is at most the root of the sum of
    // squares, of two squares of voxels at once.
    auto const edge = static_cast<double>(edge_for(radius));
    return std::sqrt(2.0) * edge * (3 * 20 * 2 * std::log2(edge) + 2 * static_cast<double>(radius.z) + 8) * 0x1p-53;
}

std::size_t FftCorrelation::bytes(Index3 radius) {
    std::int64_t const edge = edge_for(radius);
    return index(edge * edge * (2 * radius.z + 3)) * sizeof(Complex);
}

FftCorrelation::FftCorrelation(DenseKernel const& kernel, Index3 dims)
    : kernel_(kernel), dims_(dims), edge_(edge_for(kernel.radius)) {
    Index3 const r = kernel.radius;
    std::size_t const area = index(edge_ * edge_);
    spectra_.assign(area * index(2 * r.z + 1), 0);
    for (Tap const& tap : kernel.taps)
        spectra_[area * index(tap.at.z + r.z) + index((tap.at.y + r.y) * edge_ + tap.at.x + r.x)] +=
            tap.weight / static_cast<double>(area);
    std::vector<Complex> scratch(area);
    for (std::size_t z = 0; z < spectra_.size(); z += area)
        fft().transform(index(edge_), false, &spectra_[z], scratch.data());
    for (Complex& value : spectra_) value = std::conj(value); // correlation
}

void FftCorrelation::run(ConstView in, AnyView out, Execution const& execution) const {
    Index3 const r = kernel_.radius, step{edge_ - 2 * r.x, edge_ - 2 * r.y, 1};
    std::int64_t const columns = (dims_.x + step.x - 1) / step.x, squares = columns * ((dims_.y + step.y - 1) / step.y);
    std::int64_t const depth = 2 * r.z + 1;
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

    auto const pair = [&](std::int64_t first) {
        std::vector<Complex> ring(area * index(depth + 2));
        std::vector<double> row(index(edge_));
        Complex* const sum = &ring[area * index(depth)];
        Complex* const scratch = sum + area;
        std::vector<bool> bad(index(depth));
        Box const boxes[2] = {square(first), square(first + 1)};
        if (boxes[0].empty() && boxes[1].empty()) return;
        for (std::int64_t z = out.box.lower.z - r.z; z < out.box.upper.z + r.z; ++z) {
            std::size_t const slot = index((z + r.z + depth * 1024) % depth);
            Complex* const values = &ring[area * slot];
            std::fill(values, values + area, Complex());
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
                        reinterpret_cast<double*>(values + y * edge_ + x)[part] = v;
                    }
                }
            }
            bad[slot] = !finite;
            if (finite) fft().transform(index(edge_), false, values, scratch);
            std::int64_t const centre = z - r.z;
            if (centre < out.box.lower.z) continue;
            bool direct = false;
            for (bool const b : bad) direct = direct || b;
            if (!direct) {
                std::fill(sum, sum + area, Complex());
                for (std::int64_t k = 0; k < depth; ++k)
                    add_products(&ring[area * index((centre + k + depth * 1024) % depth)], &spectra_[area * index(k)],
                                 sum, area);
                fft().transform(index(edge_), true, sum, scratch);
            }
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
        }
    };

    std::exception_ptr failure;
    int const threads =
        static_cast<int>(std::clamp<std::int64_t>((squares + 1) / 2, 1, std::max(1, execution.threads)));
#pragma omp parallel for num_threads(threads) schedule(dynamic) if (threads > 1)
    for (std::int64_t first = 0; first < squares; first += 2) {
        try {
            pair(first);
        } catch (...) {
#pragma omp critical
            failure = std::current_exception();
        }
    }
    if (failure) std::rethrow_exception(failure);
}

} // namespace vkt
