// Making volumes of DICOM's slices.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/gdcm/stacks.h"

#include "libvkt/core/frame.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

namespace vkt::dicom {
namespace {

/// Relative to the distance of slices: what rounding in decimal strings may leave.
constexpr double gap_tolerance = 0.01, slant_tolerance = 0.002;

/// As text for messages, to a tenth of a micrometre.
std::string millimetres(double distance) { return text(std::round(distance * 1e4) / 1e4, " mm"); }

/// Images that can be slices of one volume, but for the stacks that they are of.
bool alike(Slice const& a, Slice const& b) {
    return a.series == b.series && a.columns == b.columns && a.rows == b.rows && a.samples == b.samples &&
           a.bits == b.bits && a.is_signed == b.is_signed && dot(a.across, b.across) > 1 - 1e-4 &&
           dot(a.down, b.down) > 1 - 1e-4 && std::abs(a.spacing_across - b.spacing_across) <= 1e-4 * a.spacing_across &&
           std::abs(a.spacing_down - b.spacing_down) <= 1e-4 * a.spacing_down;
}

/// Where slices of one orientation lie, each place once, in order: along the normal, across and down.
std::vector<std::array<double, 3>> places_of(std::vector<Slice> const& slices) {
    Slice const& first = slices.front();
    Vec3 const normal = cross(first.across, first.down);
    std::vector<std::array<double, 3>> places;
    places.reserve(slices.size());
    for (Slice const& s : slices)
        places.push_back({dot(s.position, normal), dot(s.position, first.across), dot(s.position, first.down)});
    std::sort(places.begin(), places.end());
    auto const same = [](auto const& a, auto const& b) { return std::abs(a[0] - b[0]) <= 1e-4; };
    places.erase(std::unique(places.begin(), places.end(), same), places.end());
    return places;
}

bool same_places(std::vector<Slice> const& a, std::vector<Slice> const& b) {
    auto const one = places_of(a), other = places_of(b);
    return std::equal(one.begin(), one.end(), other.begin(), other.end(), [](auto const& p, auto const& q) {
        return std::abs(p[0] - q[0]) <= 1e-3 && std::abs(p[1] - q[1]) <= 1e-3 && std::abs(p[2] - q[2]) <= 1e-3;
    });
}

/// Stacks in the same places are volumes of one series, in the order of their numbers; where every stack is one place
/// they are the slices of a volume; others stay by themselves.
std::vector<std::vector<Slice>> joined_stacks(std::vector<std::vector<Slice>> stacks) {
    if (stacks.size() == 1) return stacks;
    auto const number = [](std::vector<Slice> const& stack) { return number_in(stack.front().stack).value_or(0); };
    std::stable_sort(stacks.begin(), stacks.end(), [&](auto const& a, auto const& b) { return number(a) < number(b); });
    std::vector<std::vector<Slice>> result;
    bool const single =
        std::all_of(stacks.begin(), stacks.end(), [](auto const& stack) { return places_of(stack).size() == 1; });
    if (single && !same_places(stacks.front(), stacks.back())) {
        for (std::size_t i = 1; i < stacks.size(); ++i)
            stacks[0].insert(stacks[0].end(), stacks[i].begin(), stacks[i].end());
        result.push_back(std::move(stacks[0]));
        return result;
    }
    for (std::size_t i = 0; i < stacks.size(); ++i) {
        for (Slice& s : stacks[i]) {
            s.order.insert(s.order.begin(), static_cast<double>(i));
            ++s.counted;
            s.told[s.modality == "SEG" ? "segment" : "stack"] = s.stack;
        }
        auto const found = std::find_if(result.begin(), result.end(),
                                        [&](auto const& group) { return same_places(group, stacks[i]); });
        if (found == result.end())
            result.push_back(std::move(stacks[i]));
        else
            found->insert(found->end(), stacks[i].begin(), stacks[i].end());
    }
    return result;
}

/// Whether what stands in the same row at every place is of the same volume: where one place lacks a frame of the first
/// volume and another one of the second, they would be mixed.
void check_membership(Input const& input, std::vector<Slice> const& slices, std::size_t volumes) {
    if (volumes < 2) return;
    // What differs between all of them is a number of the frame and no dimension.
    std::size_t const counted = slices.front().counted;
    std::vector<bool> running(counted);
    for (std::size_t d = 0; d < counted; ++d) {
        std::set<double> values;
        for (Slice const& s : slices)
            if (d < s.order.size()) values.insert(s.order[d]);
        running[d] = values.size() == slices.size();
    }
    for (std::size_t i = volumes; i < slices.size(); ++i) {
        Slice const &a = slices[i % volumes], &b = slices[i];
        bool same = a.counted == b.counted && a.told.contains("b value") == b.told.contains("b value") &&
                    (!a.told.contains("b value") || a.told.at("b value") == b.told.at("b value"));
        for (std::size_t d = 0; same && d < counted; ++d) same = running[d] || a.order[d] == b.order[d];
        if (!same)
            input.fail(text("its frames do not make whole volumes: at one place there is none like ", input.shown(a),
                            ", and at another none like ", input.shown(b)),
                       text("in the order that they have at each place all the same: ", input.forced()));
    }
}

/// Where the slices of the first volume say that they lie.
void place(Input const& input, std::vector<Slice> const& slices, bool force_uniform, Header& header) {
    Index3 const dims = header.dims;
    Slice const &first = slices.front(), &last = slices[static_cast<std::size_t>(dims.z - 1)];
    Vec3 const normal = cross(first.across, first.down);
    Geometry& g = header.geometry;
    g.origin = first.position;
    g.direction = {first.across, first.down, normal};
    g.spacing = {first.spacing_across, first.spacing_down, first.spacing_slices.value_or(1)};
    header.attributes["space"] = std::string(lps_frame);
    header.attributes["space units"] = "\"mm\" \"mm\" \"mm\"";
    if (dims.z > 1) {
        Vec3 const step = (last.position - first.position) * (1 / static_cast<double>(dims.z - 1));
        double mean = dot(step, normal);
        // Where they are as far apart as the file says, but for the rounding of their places.
        if (double const said = first.spacing_slices.value_or(0); std::abs(mean - said) <= 1e-6 * mean) mean = said;
        g.spacing.z = mean;
        Vec3 const aside = step - normal * mean;
        if (length(aside) > slant_tolerance * mean) {
            if (!force_uniform)
                input.fail(text("its slices lie on a slant: each is ", millimetres(length(aside)),
                                " aside of the one before it, ", millimetres(mean), " further (a tilted gantry)"),
                           text("as a sheared lattice, with every voxel in its place: ", input.forced()));
            set_axis(g, 2, step, "the distance of slices");
        }
        for (std::int64_t z = 1; z < dims.z; ++z) {
            Slice const &a = slices[static_cast<std::size_t>(z - 1)], &b = slices[static_cast<std::size_t>(z)];
            double const here = b.along - a.along;
            if (std::abs(here - mean) <= gap_tolerance * mean || force_uniform) continue;
            // Most distances say what is usual.
            std::vector<double> distances;
            for (std::int64_t i = 1; i < dims.z; ++i)
                distances.push_back(slices[static_cast<std::size_t>(i)].along -
                                    slices[static_cast<std::size_t>(i - 1)].along);
            std::nth_element(distances.begin(), distances.begin() + std::ssize(distances) / 2, distances.end());
            double const usual = distances[distances.size() / 2];
            for (std::int64_t i = 1; i < dims.z; ++i) {
                Slice const &c = slices[static_cast<std::size_t>(i - 1)], &d = slices[static_cast<std::size_t>(i)];
                if (std::abs(d.along - c.along - usual) > gap_tolerance * usual)
                    input.fail(text("its slices lie at unequal distances: ", millimetres(d.along - c.along), " from ",
                                    input.shown(c), " to ", input.shown(d), ", ", millimetres(usual), " elsewhere"),
                               text("as if all were equal, at their mean: ", input.forced()));
            }
        }
    }
    for (auto& direction : g.direction) direction = direction + Vec3{}; // no negative zeros
}

} // namespace

std::string stack_text(std::vector<Slice> const& slices) {
    std::string const& stack = slices.front().stack;
    bool const one = std::all_of(slices.begin(), slices.end(), [&](Slice const& s) { return s.stack == stack; });
    return one && !stack.empty() ? text(slices.front().modality == "SEG" ? ", segment " : ", stack ", stack) : "";
}

std::vector<std::vector<Slice>> groups(std::vector<Slice> const& all) {
    // Those that are alike, and of those, each stack.
    std::vector<std::vector<std::vector<Slice>>> kinds;
    for (Slice const& slice : all) {
        auto kind = std::find_if(kinds.begin(), kinds.end(),
                                 [&](auto const& stacks) { return alike(stacks.front().front(), slice); });
        if (kind == kinds.end()) kind = kinds.emplace(kinds.end());
        auto const stack = std::find_if(kind->begin(), kind->end(),
                                        [&](auto const& group) { return group.front().stack == slice.stack; });
        if (stack == kind->end())
            kind->push_back({slice});
        else
            stack->push_back(slice);
    }
    std::vector<std::vector<Slice>> result;
    for (auto& stacks : kinds)
        for (auto& group : joined_stacks(std::move(stacks))) result.push_back(std::move(group));
    return result;
}

std::vector<Slice> arrange(Input const& input, std::vector<Slice> slices, bool force_uniform, ParsedGrids& grids) {
    Slice const first = slices.front();
    Vec3 const normal = cross(first.across, first.down);
    bool const placed = std::all_of(slices.begin(), slices.end(), [](Slice const& s) { return s.placed; });
    if (!placed && slices.size() > 1 && !force_uniform)
        input.fail("its images do not say where they lie (Image Position (Patient))",
                   text("in the order of their numbers all the same: ", input.forced()));
    for (Slice& s : slices) s.along = placed ? dot(s.position, normal) : static_cast<double>(s.instance);
    std::stable_sort(slices.begin(), slices.end(), [](Slice const& a, Slice const& b) {
        if (std::abs(a.along - b.along) > 1e-4) return a.along < b.along;
        return std::tie(a.order, a.time, a.instance, a.frame) < std::tie(b.order, b.time, b.instance, b.frame);
    });
    // How often each place occurs.
    std::vector<std::size_t> runs{1};
    for (std::size_t i = 1; i < slices.size(); ++i)
        if (std::abs(slices[i].along - slices[i - 1].along) <= 1e-4)
            ++runs.back();
        else
            runs.push_back(1);
    for (std::size_t i = 0, k = 0; i < runs.size(); k += runs[i++])
        if (runs[i] != runs[0])
            input.fail(text("its images lie in the same places unequally often: ", static_cast<std::int64_t>(runs[0]),
                            " times at ", input.shown(slices.front()), ", ", static_cast<std::int64_t>(runs[i]),
                            " times at ", input.shown(slices[k])),
                       input.listed   ? "name those of one volume only"
                       : input.folder ? "put the images of one volume into a folder of their own"
                                      : "some of its frames are missing: copy it again from where it was made");
    std::size_t const volumes = runs[0], n = runs.size();
    if (!force_uniform) check_membership(input, slices, volumes);
    std::vector<Slice> sorted;
    for (std::size_t v = 0; v < volumes; ++v)
        for (std::size_t z = 0; z < n; ++z) sorted.push_back(slices[z * volumes + v]);
    std::int64_t const samples = first.samples;
    grids.volumes = static_cast<std::int64_t>(volumes) * samples;
    static char const* const rgb[] = {"red", "green", "blue"};
    if (grids.volumes > 1)
        for (std::size_t v = 0; v < volumes; ++v)
            for (std::int64_t s = 0; s < samples; ++s) {
                std::map<std::string, std::string> said;
                if (volumes > 1) {
                    said["sequence position"] = to_text(static_cast<std::int64_t>(v));
                    said["sequence step"] = "1";
                }
                for (auto const& [what, value] : sorted[v * n].told)
                    if (auto const& other = sorted[v > 0 ? 0 : (volumes - 1) * n].told; // what is the same is no news
                        volumes > 1 && (!other.contains(what) || other.at(what) != value))
                        said[what] = value;
                if (samples > 1) said["channel"] = s < 3 ? rgb[s] : to_text(s);
                grids.attributes.push_back(std::move(said));
            }
    grids.header.dims = {first.columns, first.rows, static_cast<std::int64_t>(n)};
    if (placed)
        place(input, sorted, force_uniform, grids.header);
    else
        grids.header.geometry.spacing = {first.spacing_across, first.spacing_down, first.spacing_slices.value_or(1)};
    return sorted;
}

} // namespace vkt::dicom
