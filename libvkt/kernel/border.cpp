// Border fill and region copies in host memory; device memory goes to the CUDA side.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/border.h"

#include "libvkt/core/error.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/numeric.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace vkt {

#ifdef VKT_CUDA
void fill_border_on_device(AnyView window, Box const& inside, Index3 dims, Boundary boundary, double border_value);
void copy_region_on_device(ConstView from, AnyView to);
void copy_every_on_device(ConstView from, Index3 step, AnyView to);
#endif

namespace {

/// One row from x0 to x1 of constant voxels.
void fill_row(std::byte* row, std::int64_t count, VoxelBytes const& voxel, std::size_t size) {
    for (std::int64_t i = 0; i < count; ++i) std::memcpy(row + static_cast<std::size_t>(i) * size, voxel.data(), size);
}

struct HostFill {
    AnyView window;
    Box inside;
    Index3 dims;
    Boundary boundary;
    VoxelBytes voxel;
    std::size_t size;

    /// Voxels of a row that follow one another, and where they come from: forwards, backwards, all from one, or the
    /// border.
    struct Run {
        std::int64_t to, from, count;
        int step; ///< 1, -1 or 0
        bool border;
    };
    /// Of the voxels beside `inside`, from the window's first on.
    std::vector<Run> runs() const {
        std::vector<Run> result;
        auto const add = [&](std::int64_t x) {
            std::int64_t const from = fold(x, dims.x, boundary) - window.box.lower.x, to = x - window.box.lower.x;
            bool const border = fold(x, dims.x, boundary) < 0;
            if (!result.empty()) {
                Run& last = result.back();
                std::int64_t const step = border ? 0 : from - (last.from + (last.count - 1) * last.step);
                bool const goes_on = last.to + last.count == to && last.border == border && std::abs(step) <= 1 &&
                                     (last.count == 1 || step == last.step);
                if (goes_on) {
                    last.step = static_cast<int>(step);
                    ++last.count;
                    return;
                }
            }
            result.push_back({to, from, 1, 0, border});
        };
        for (std::int64_t x = window.box.lower.x; x < inside.lower.x; ++x) add(x);
        for (std::int64_t x = inside.upper.x; x < window.box.upper.x; ++x) add(x);
        return result;
    }
    template <class U> static void fill_run(U* row, U border, Run const& run) {
        U* const to = row + run.to;
        U const* const from = row + run.from;
        if (run.border || run.step == 0)
            std::fill_n(to, run.count, run.border ? border : *from);
        else if (run.step == 1)
            std::memcpy(to, from, static_cast<std::size_t>(run.count) * sizeof(U));
        else
            baseline::driver::copy_reversed(to, from, run.count, false);
    }

    void row(std::int64_t y, std::int64_t z) const {
        Box const& w = window.box;
        std::int64_t const from = fold(y, dims.y, boundary);
        if (from < 0)
            fill_row(window.at(w.lower.x, y, z), w.dims().x, voxel, size);
        else
            std::memcpy(window.at(w.lower.x, y, z), window.at(w.lower.x, from, z),
                        static_cast<std::size_t>(w.dims().x) * size);
    }

    void slice(std::int64_t z) const {
        Box const& w = window.box;
        std::int64_t const from = inside.empty() ? -1 : fold(z, dims.z, boundary);
        for (std::int64_t y = w.lower.y; y < w.upper.y; ++y) {
            if (from < 0)
                fill_row(window.at(w.lower.x, y, z), w.dims().x, voxel, size);
            else
                std::memcpy(window.at(w.lower.x, y, z), window.at(w.lower.x, y, from),
                            static_cast<std::size_t>(w.dims().x) * size);
        }
    }

    /// Rows of a slice from others of it; then slices from others.
    void run(Execution const& execution) const {
        Box const& w = window.box;
        if (!inside.empty()) {
            std::vector<Run> const beside = runs();
            in_slices(execution, inside.lower.z, inside.upper.z, [&](std::int64_t z) {
                baseline::for_each_size(size, [&]<class U>(U border) {
                    std::memcpy(&border, voxel.data(), sizeof border);
                    for (std::int64_t y = inside.lower.y; y < inside.upper.y; ++y) {
                        // Nobody foresees which lines the ends of the next rows are in.
                        constexpr std::int64_t ahead = 8;
                        for (Run const& run : beside) {
                            std::byte const* const later = window.at(w.lower.x, y + ahead, z);
                            __builtin_prefetch(later + run.to * static_cast<std::int64_t>(size), 1);
                            __builtin_prefetch(later + run.from * static_cast<std::int64_t>(size));
                        }
                        for (Run const& run : beside)
                            fill_run(reinterpret_cast<U*>(window.at(w.lower.x, y, z)), border, run);
                    }
                });
                for (std::int64_t y = w.lower.y; y < inside.lower.y; ++y) row(y, z);
                for (std::int64_t y = inside.upper.y; y < w.upper.y; ++y) row(y, z);
            });
        }
        in_slices(execution, w.lower.z, w.upper.z, [&](std::int64_t z) {
            if (inside.empty() || z < inside.lower.z || z >= inside.upper.z) slice(z);
        });
    }

    template <class F>
    void in_slices(Execution const& execution, std::int64_t first, std::int64_t last, F const& f) const {
        int const threads = baseline::threads_for(execution, window.box.voxels());
        baseline::for_each_item(threads, last - first, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t z = first + begin; z < first + end; ++z) f(z);
        });
    }
};

template <class T> void gather(std::byte const* from, std::int64_t step, std::byte* to, std::int64_t n) {
    for (std::int64_t i = 0; i < n; ++i)
        std::memcpy(to + static_cast<std::size_t>(i) * sizeof(T), from + static_cast<std::size_t>(i * step) * sizeof(T),
                    sizeof(T));
}

} // namespace

void fill_border(AnyView window, Box const& inside, Index3 volume_dims, Boundary boundary, double border_value,
                 Execution const& execution) {
#ifdef VKT_CUDA
    if (window.space == Space::device)
        return fill_border_on_device(window, inside, volume_dims, boundary, border_value);
#endif
    HostFill const fill{
        window, inside, volume_dims, boundary, baseline::voxel_bytes(window.type, border_value), size_of(window.type)};
    fill.run(execution);
}

void copy_region(ConstView from, AnyView to, Execution const& execution) {
    if (from.space == Space::host && to.space == Space::host) {
        bool const alike = from.type == to.type && from.dims() == to.dims();
        if (!alike || baseline::threads_for(execution, to.box.voxels()) == 1) return copy(from, to);
        return baseline::copy_box(execution, from, to);
    }
#ifdef VKT_CUDA
    copy_region_on_device(from, to);
#else
    throw Error(ErrorKind::resources, "device memory in a build without CUDA");
#endif
}

void copy_every(ConstView from, Index3 step, AnyView to) {
    if (from.space == Space::device || to.space == Space::device) {
#ifdef VKT_CUDA
        return copy_every_on_device(from, step, to);
#else
        throw Error(ErrorKind::resources, "device memory in a build without CUDA");
#endif
    }
    std::size_t const size = size_of(to.type);
    auto const copy_row = [&](std::int64_t y, std::int64_t z) {
        std::int64_t const n = to.dims().x;
        std::byte const* const source =
            from.data + static_cast<std::size_t>(y * step.y * from.row + z * step.z * from.slice) * size;
        std::byte* const target = to.data + static_cast<std::size_t>(y * to.row + z * to.slice) * size;
        if (step.x == 1) return static_cast<void>(std::memcpy(target, source, static_cast<std::size_t>(n) * size));
        if (size == 1) return gather<std::uint8_t>(source, step.x, target, n);
        if (size == 2) return gather<std::uint16_t>(source, step.x, target, n);
        if (size == 4) return gather<std::uint32_t>(source, step.x, target, n);
        gather<std::uint64_t>(source, step.x, target, n);
    };
    for (std::int64_t z = 0; z < to.dims().z; ++z)
        for (std::int64_t y = 0; y < to.dims().y; ++y) copy_row(y, z);
}

} // namespace vkt
