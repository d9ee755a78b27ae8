// Volumes of labels as categories: the labels that are there, with names and colours.
// SPDX-License-Identifier: MIT
#include "libvkt/render/categories.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/labels.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace vkt::render {

namespace {

constexpr std::size_t most_labels = std::size_t{1} << 20;
constexpr double furthest_label = 1 << 24; // floats tell whole numbers apart up to there

/// The different values of a lattice, but no NaN; one more than most_labels may be if there are more.
template <class T> std::set<float> values_in(LatticeView const& lattice, Index3 dims, int threads) {
    std::set<float> all;
#pragma omp parallel num_threads(threads)
    {
        std::set<float> mine;
#pragma omp for schedule(dynamic, 1) nowait
        for (std::int64_t z = 0; z < dims.z; ++z)
            for (std::int64_t y = 0; y < dims.y; ++y) {
                T const* row = static_cast<T const*>(lattice.data) + lattice_padding +
                               (y + lattice_padding) * lattice.row + (z + lattice_padding) * lattice.slice;
                if (mine.size() > most_labels) continue;
                for (std::int64_t x = 0; x < dims.x; ++x) {
                    auto const value = static_cast<float>(row[x]);
                    if ((x == 0 || row[x] != row[x - 1]) && !std::isnan(value)) mine.insert(value);
                }
            }
#pragma omp critical
        if (all.size() <= most_labels) all.merge(mine);
    }
    return all;
}

std::set<float> values_in(Lattice const& lattice, int threads) {
    return with_lattice_type(lattice.view.type,
                             [&]<class T>(T) { return values_in<T>(lattice.view, lattice.dims, threads); });
}

} // namespace

bool draws_labels(RenderSettings const& s, Header const& header) {
    bool const surfaces = s.algorithm == Algorithm::implicit_iso,
               marched = s.algorithm == Algorithm::ray_marching && !s.exact;
    bool const own = s.transfer || s.preset || !s.lut.empty() || !s.colormap.empty() || s.opacity != "auto" ||
                     s.domain != "auto" || !s.isos.empty() || !s.iso_colors.empty() || !s.iso_opacities.empty();
    if (s.labels == LabelMode::never || own || !(surfaces || marched)) return false;
    return s.labels == LabelMode::always || holds_labels(header);
}

Categories categories_of(Lattice const& lattice, Header const& header, int threads) {
    Categories categories;
    Rescaling const& r = lattice.rescaling;
    categories.nothing = static_cast<float>(r.of(0));
    std::set<float> const values = values_in(lattice, threads);
    if (values.size() > most_labels + 1) {
        categories.why_not = text("more than ", static_cast<std::int64_t>(most_labels), " different values");
        return categories;
    }
    auto const texts = label_texts(header.attributes);
    std::vector<ShownLabel> shown;
    for (float const value : values) {
        if (value == categories.nothing) continue;
        double const label = static_cast<double>(value) / r.scale + r.offset;
        if (label != std::floor(label) || std::abs(label) > furthest_label) {
            categories.why_not = text("the value ", label, ", and labels are whole numbers up to 2^24");
            return categories;
        }
        auto const number = static_cast<std::int64_t>(label);
        auto const stated = texts.find(number);
        bool const known = stated != texts.end();
        auto const [red, green, blue] = known && stated->second.color ? *stated->second.color : label_color(number);
        auto const light = [](double v) { return static_cast<float>(srgb_to_linear(v)); };
        categories.views.push_back({value, light(red), light(green), light(blue)});
        shown.push_back({number, known ? stated->second.name : std::string(), {red, green, blue}});
    }
    categories.shown = std::make_shared<std::vector<ShownLabel> const>(std::move(shown));
    return categories;
}

} // namespace vkt::render
