// Non-local means: voxels with like surroundings, averaged.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/nlmeans.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/filter/local_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <optional>

namespace vkt {

/// The standard deviation of the noise: a number, or what the volume seems to have.
struct NoiseOption {
    bool automatic = false;
    double deviation = 0; ///< physical values
};

template <> struct ValueText<NoiseOption> : OneWord {
    static NoiseOption read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(NoiseOption const& noise);
};

namespace {

constexpr std::int64_t most_patch = 8, most_search = 16;

void check_radius(char const* option, Radius const& radius, std::int64_t most) {
    for (int axis = 0; axis < 3; ++axis)
        if (radius.voxels[axis] < 0 || radius.voxels[axis] > most)
            throw Error(ErrorKind::usage, text(option, " ", radius.voxels[axis], " is not in 0 to ", most));
}

} // namespace

NoiseOption ValueText<NoiseOption>::read(std::vector<std::string> const& w, std::string_view name) {
    if (w.front() == "auto") return {true, 0};
    return {false, ValueText<double>::read(w, name)};
}

std::vector<std::string> ValueText<NoiseOption>::write(NoiseOption const& noise) {
    return {noise.automatic ? std::string("auto") : to_text(noise.deviation)};
}

double NoiseCounts::deviation() const {
    std::uint64_t total = 0, below = 0;
    for (std::uint64_t const count : counts) total += count;
    if (total == 0) return 0;
    std::size_t bin = 0;
    while (2 * (below + counts[bin]) < total) below += counts[bin++];
    auto const edge = [](std::size_t i) {
        return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(i) << 16));
    };
    double const share =
        (static_cast<double>(total) / 2 - static_cast<double>(below)) / static_cast<double>(counts[bin]);
    double const median = edge(bin) == 0 ? 0 : edge(bin) + share * (edge(bin + 1) - edge(bin));
    return median / 0.674489750196081743; // the median of |x| for a standard normal x
}

std::size_t nlmeans_bytes(DataType type, Index3 patch, Index3 search) {
    Index3 const p = patch, around = patch + search;
    std::size_t const value = size_of(type) <= 2 || type == DataType::float32 ? 4 : 8;
    std::int64_t const x = 64, y = 16, z = 16, lanes = 16;
    std::int64_t const values = (x + 2 * around.x + lanes) * (y + 2 * around.y) * (z + 2 * around.z),
                       scratch = x + 2 * p.x + lanes + x * (y + 2 * p.y) + x * y * (2 * p.z + 1) + 3 * x * y * z;
    return static_cast<std::size_t>(values + scratch) * value;
}

namespace {

/// Every voxel becomes a mean of those of a search box around it, weighted by how much the patches around both are
/// alike (Buades, Coll and Morel 2005), all of them, patches by sums along the axes (Darbon et al. 2008), in float32;
/// of 32- and 64-bit types in float64, to which 64-bit integers are rounded. The type is kept.
class NlMeans : public LocalFilter, public Tunable {
public:
    std::string_view name() const override { return "filter nlmeans"; }
    Texts texts() const override {
        return {"Average voxels whose surroundings are alike.",
                "Non-local means: every voxel of a search box around weighs exp(-d / h^2), d being the mean squared "
                "difference of the patches around both voxels, less twice the variance of the noise if that is known. "
                "All weights are computed. The data type is kept. h is --strength, or else 0.8 of the noise."
                "\n\n"
                "Accuracy: Estimate: weights are computed to 24 digits, or 53 for wide types, which changes results by "
                "some units in the last of these digits of the range of the values around.",
                {{"As strong as the noise asks for", "vkt filter nlmeans volume.nrrd --noise auto -o calm.nrrd"},
                 {"Patches of 5 x 5 voxels slice by slice, a given strength",
                  "vkt filter nlmeans volume.nrrd --patch 2,2,0 --search 6,6,0 --strength 12 | vkt stats"}}};
    }

    void parameters(Parameters& parameters) override {
        parameters.option("patch", patch_, "R", "patches reach R voxels to either side: one number or X,Y,Z, 0 to 8");
        parameters.option("search", search_, "R",
                          "voxels up to R to either side are averaged: one number or X,Y,Z, 0 to 16");
        parameters.option("strength", strength_, "H",
                          "differences of about H are averaged (default: 0.8 of the noise)");
        parameters.option("noise", noise_, "S|auto", "standard deviation of the noise; auto estimates it");
        LocalFilter::parameters(parameters);
    }

    void check() const override {
        LocalFilter::check();
        check_radius("--patch", patch_, most_patch);
        check_radius("--search", search_, most_search);
        if (strength_ && !(std::isfinite(*strength_) && *strength_ > 0))
            throw Error(ErrorKind::usage, text("--strength ", *strength_, " is not a finite number above 0"));
        if (noise_ && !(std::isfinite(noise_->deviation) && noise_->deviation >= 0))
            throw Error(ErrorKind::usage, text("--noise ", noise_->deviation, " is not a finite number >= 0"));
        if (!strength_ && !noise_)
            throw Error(ErrorKind::usage, "how strongly to smooth is not said",
                        "say --strength H in values, or --noise S or --noise auto");
        if (!strength_ && !noise_->automatic && noise_->deviation == 0)
            throw Error(ErrorKind::usage, "--noise 0 needs --strength");
    }

    /// Smaller boxes and patches than those that are asked for.
    std::vector<Knob> knobs() const override {
        auto const smaller = [](char const* option, Radius const& asked, std::initializer_list<std::int64_t> radii) {
            Knob knob{option, {}, ValueText<Radius>::write(asked).front(), false};
            for (std::int64_t const most : radii) {
                Radius less = asked;
                for (int axis = 0; axis < 3; ++axis) less.voxels[axis] = std::min(asked.voxels[axis], most);
                if (!(less.voxels == asked.voxels)) knob.values.push_back(ValueText<Radius>::write(less).front());
            }
            return knob;
        };
        return {smaller("search", search_, {1, 2, 3, 5, 8}), smaller("patch", patch_, {0, 1, 2, 3})};
    }

    /// Differences across slices are not looked at, nor those across the rows of two pieces.
    void scan(ConstView slab, Execution const& execution) override { count_noise(slab, counts_, execution); }
    std::int64_t scan_step(Index3) const override { return 2; }
    void scan_end() override { set_noise(counts_.deviation()); }

    std::size_t fit(Index3, Execution const& execution) override {
        if (reach_ == Index3{}) return 0;
        return nlmeans_bytes(input_.dtype, rule_.patch, rule_.search) *
               static_cast<std::size_t>(std::max(1, execution.threads));
    }

    std::vector<Remark> remarks() const override {
        std::vector<Remark> result = LocalFilter::remarks();
        if (copies_)
            result.push_back({text("no noise was found: the volume stays as it is; say --strength or --noise"), false});
        return result;
    }

    bool reports() const override { return true; }
    bool runs_on_gpu() const override { return true; }

    /// Noise and strength, in physical values.
    Report report() const override {
        double const slope = std::abs(input_.values.slope);
        Report result;
        result.add("noise", rule_.noise * slope);
        result.add("strength", rule_.strength * slope);
        return result;
    }

protected:
    void describe(Header const& in, Index3 /*cell_width*/, Plan& plan) const override {
        require_border_voxel(in);
        if (search_.voxels == Index3{}) {
            plan.shift = Index3{};
            plan.method = "copy";
            plan.cost = 0;
            return;
        }
        plan.passing = ErrorPassing::averaged(1, values_read(in, plan));
        plan.passing.gain = {HUGE_VAL};
        plan.passing.because = "its weights follow the values";
        plan.scans = estimates();
        if (estimates()) plan.state_bytes = (std::size_t{1} << 16) * 8;
        Index3 const s = search_.edges(), p = patch_.edges();
        plan.method = text("non-local means, ", s.x, "x", s.y, "x", s.z, " patches of ", p.x, "x", p.y, "x", p.z,
                           estimates() ? ", noise from a pass before" : "");
        plan.cost = static_cast<double>(s.x * s.y * s.z) * static_cast<double>(18 + p.x + p.y + p.z);
        plan.slab_hint = std::max<std::int64_t>(16, (2 * (patch_.voxels.z + search_.voxels.z) + 15) / 16 * 16);
        bool const narrow = size_of(in.dtype) <= 2 || in.dtype == DataType::float32;
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.range = static_cast<double>(s.x + s.y + s.z + p.x + p.y + p.z + 16) * (narrow ? 0x1p-24 : 0x1p-53);
        plan.error.magnitude = storing_error(in.dtype) + (narrow ? 0x1p-24 : 0x1p-53);
        plan.error.absolute = std::abs(in.values.slope) * storing_floor(in.dtype);
    }

    void prepare(Header const& in, Index3 /*cell_width*/) override {
        input_ = in;
        counts_ = {};
        rule_ = {};
        rule_.patch = patch_.voxels;
        rule_.search = search_.voxels;
        copies_ = false;
        reach_ = {};
        if (search_.voxels == Index3{}) return;
        reach_ = patch_.voxels + search_.voxels;
        if (!estimates()) set_noise((noise_ ? noise_->deviation : 0) / std::abs(in.values.slope));
    }

    void filter(ConstView in, AnyView out, Execution const& execution) override {
        if (copies_) return outside(in.part(out.box), out, execution);
        nlmeans_box(in, out, rule_, losses_, execution);
    }

private:
    bool estimates() const { return noise_ && noise_->automatic; }
    void set_noise(double stored) {
        rule_.noise = stored;
        rule_.strength = strength_ ? *strength_ / std::abs(input_.values.slope) : 0.8 * stored;
        copies_ = !(rule_.strength > 0);
    }

    Radius patch_{{1, 1, 1}}, search_{{5, 5, 5}};
    std::optional<double> strength_;
    std::optional<NoiseOption> noise_;
    Header input_;
    NlMeansRule rule_;
    NoiseCounts counts_;
    bool copies_ = false;
};

} // namespace

VKT_OPERATION(NlMeans, "filter nlmeans")

} // namespace vkt
