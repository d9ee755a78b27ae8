// What data are, where their header or their values leave no doubt.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/render/presets.h"

namespace vkt::render {

namespace {

/// Share of the finite values between two, and how many of them there are per unit.
struct Share {
    double share = 0, density = 0;
};
Share between(Histogram const& h, double lower, double upper) {
    double count = 0, total = 0;
    for (std::size_t i = 0; i < h.bins.size(); ++i) {
        double const value = h.center(i), n = static_cast<double>(h.bins[i]);
        total += n;
        if (value >= lower && value < upper) count += n;
    }
    double const share = total > 0 ? count / total : 0;
    return {share, share / (upper - lower)};
}

/// Whether integers are distributed as the HU of CT are: from the air on, a lot of that, a lot of soft tissue, and far
/// less of either in between.
bool looks_like_hounsfield(Histogram const& h) {
    constexpr double air = -1000, padding = -1024; // that scanners write where they see nothing
    bool const from_air = h.least >= padding - 26 && h.least <= air + 50, to_bone = h.greatest >= 300;
    // More than scanners tell apart, metal included.
    if (!from_air || !to_bone || h.greatest > 32767) return false;
    // Bins have to tell air from lungs.
    if ((h.greatest - h.least) / static_cast<double>(h.bins.size()) > 10) return false;
    Share const nothing = between(h, h.least, -900), valley = between(h, -600, -300), tissue = between(h, -150, 150);
    return nothing.share > 0.02 && tissue.share > 0.02 && 3 * valley.density < nothing.density &&
           3 * valley.density < tissue.density;
}

} // namespace

std::optional<Recognised> recognise(Header const& header, Histogram const& histogram) {
    bool const said = header.units == hounsfield;
    // What the preset hides is not to be all that there is.
    constexpr double least_seen = 0.001;
    if (said && between(histogram, 40, 1e30).share >= least_seen)
        return Recognised{DataKind::ct, "CT, as the header says HU"};
    if (header.units.empty() && is_integer(header.dtype) && looks_like_hounsfield(histogram))
        return Recognised{DataKind::ct, text("CT in HU: integers from ", histogram.least,
                                             " on, of which air and soft tissue are peaks")};
    return std::nullopt;
}

} // namespace vkt::render
