// The pointwise driver against the device's own copy: every pair of types at N^3, also where every voxel is clipped.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/types.h"
#include "libvkt/kernel/kernel.h"

#include <cstdio>
#include <cstdlib>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

template <class C> struct Doubled {
    C offset;
    VKT_HD C operator()(C v) const { return v + v + offset; }
};

struct Shifted {
    Int128 by;
    VKT_HD Int128 operator()(Int128 v) const { return v + by; }
};

struct Total {
    double sum = 0, least = 0, most = 0;
    VKT_HD void add(double v) { merge({v, v, v}); }
    VKT_HD void merge(Total const& other) {
        sum += other.sum;
        least = other.least < least ? other.least : least;
        most = other.most > most ? other.most : most;
    }
};

template <class F> double best_ms(F const& f) {
    cudaEvent_t begin, end;
    cudaEventCreate(&begin);
    cudaEventCreate(&end);
    double best = 1e9;
    for (int i = 0; i < 6; ++i) {
        cudaEventRecord(begin);
        f();
        cudaEventRecord(end);
        cudaEventSynchronize(end);
        if (cudaError_t const status = cudaGetLastError();
            status != cudaSuccess) { // this program has a runtime of its own
            std::printf("%s\n", cudaGetErrorString(status));
            std::exit(1);
        }
        float ms = 0;
        cudaEventElapsedTime(&ms, begin, end);
        if (i > 0 && ms < best) best = ms;
    }
    return best;
}

int run(std::int64_t n) {
    std::int64_t const voxels = n * n * n;
    std::byte *const a = device_allocate(static_cast<std::size_t>(voxels) * 8), *const b = device_allocate(
                                                                                    static_cast<std::size_t>(voxels) *
                                                                                    8);
    device_clear(a, static_cast<std::size_t>(voxels) * 8);
    double const copy = best_ms([&] { copy_on_device(b, a, static_cast<std::size_t>(voxels) * 4); });
    double const bandwidth = 8.0 * static_cast<double>(voxels) / copy * 1e-6;
    std::printf("copy %.0f GB/s\n", bandwidth);
    int missed = 0;
    std::vector<DataType> const types{DataType::uint8,   DataType::int8,    DataType::uint16, DataType::int16,
                                      DataType::uint32,  DataType::int32,   DataType::uint64, DataType::int64,
                                      DataType::float16, DataType::float32, DataType::float64};
    for (DataType const in : types)
        for (DataType const out : types)
            for (bool const clipped : {false, true}) {
                if (clipped && !is_integer(out)) continue;
                ConstView const from =
                    dense_view(static_cast<std::byte const*>(a), in, box_of({n, n, n}), Space::device);
                AnyView const to = dense_view(b, out, box_of({n, n, n}), Space::device);
                Execution const execution;
                Losses losses;
                double const ms = best_ms([&] {
                    if (in == DataType::uint64 || in == DataType::int64)
                        map<Int128>(execution, to, losses, Shifted{clipped ? Int128{1} << 70 : Int128{1}}, from);
                    else if (size_of(in) == 8 || size_of(out) == 8 || is_integer(in) && size_of(in) == 4 ||
                             is_integer(out) && size_of(out) == 4)
                        map<double>(execution, to, losses, Doubled<double>{clipped ? 1e30 : 1.0}, from);
                    else
                        map<float>(execution, to, losses, Doubled<float>{clipped ? 1e9F : 1.0F}, from);
                });
                double const share = static_cast<double>(voxels) * static_cast<double>(size_of(in) + size_of(out)) /
                                     ms * 1e-6 / bandwidth;
                missed += share < 0.85;
                std::printf("map %s -> %s%s: %.2f of copy%s\n", std::string(name_of(in)).c_str(),
                            std::string(name_of(out)).c_str(), clipped ? " all clipped" : "", share,
                            share < 0.85 ? "  below 0.85" : "");
            }
    for (DataType const in : types) {
        ConstView const from = dense_view(static_cast<std::byte const*>(a), in, box_of({n, n, n}), Space::device);
        double sum = 0;
        double const ms = best_ms([&] { sum += reduce<double>(Execution{}, from, Total{}).sum; });
        double const share = static_cast<double>(voxels) * static_cast<double>(size_of(in)) / ms * 1e-6 / bandwidth;
        missed += share < 0.85;
        std::printf("reduce %s: %.2f of copy%s\n", std::string(name_of(in)).c_str(), share,
                    share < 0.85 ? "  below 0.85" : "");
    }
    std::printf("%d below 0.85\n", missed);
    device_free(a);
    device_free(b);
    return 0;
}

} // namespace
} // namespace vkt::VKT_BACKEND

int main(int argc, char** argv) { return vkt::VKT_BACKEND::run(argc > 1 ? std::atoll(argv[1]) : 1024); }
