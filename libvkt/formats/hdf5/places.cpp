// Where the voxels and the volumes of a dataset lie: ITK's images, scales of dimensions, and what vkt wrote.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/coordinates.h"
#include "libvkt/formats/hdf5/attributes.h"
#include "libvkt/formats/hdf5/chosen.h"
#include "libvkt/formats/hdf5/itk.h"
#include "libvkt/formats/hdf5/types.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vkt::hdf5 {
namespace {

constexpr hsize_t longest_scale = hsize_t{1} << 24;
constexpr std::int64_t most_numbered = std::int64_t{1} << 20;

} // namespace

/// An image of ITK's: x first in its lists, a row of Directions for each axis of the voxels, and ITK's world.
bool ChosenDataset::read_itk(ParsedGrids& grids) {
    Header& header = grids.header;
    std::string const& path = header.attributes["variable"];
    if (!path.ends_with(itk_voxels)) return false;
    std::string const group = path.substr(0, path.size() - itk_voxels.size());
    auto const dims = all_.values(group + "/Dimension"), spacing = all_.values(group + "/Spacing"),
               origin = all_.values(group + "/Origin"), directions = all_.values(group + "/Directions");
    std::size_t const rank = dims.size();
    if (rank < 1 || spacing.size() != rank || origin.size() != rank || directions.size() != rank * rank) return false;
    if (shape_.size() == rank + 1)
        fail(text("'", path, "' has ", static_cast<std::int64_t>(shape_.back()),
                  " numbers in each voxel; a volume has one"),
             "take one of them apart with ITK");
    if (shape_.size() != rank) return false;
    // One voxel across counts as an axis here, which choose() may have left out of larger datasets only.
    for (std::size_t a = 0; a < std::min<std::size_t>(rank, 3); ++a) {
        auto const axis = static_cast<int>(a);
        if (spacing[a] > 0 && std::isfinite(spacing[a])) header.geometry.spacing[axis] = spacing[a];
        if (std::isfinite(origin[a])) header.geometry.origin[axis] = origin[a];
        for (std::size_t b = 0; b < std::min<std::size_t>(rank, 3); ++b)
            header.geometry.direction[a][static_cast<int>(b)] = directions[a * rank + b];
    }
    check(header.geometry);
    header.attributes["space"] = "left-posterior-superior";
    for (std::int64_t i = 0; rank == 4 && leading_.size() == 1 && i < grids.volumes; ++i)
        leading_places_[0].push_back({{"sequence position", to_text(origin[3] + spacing[3] * static_cast<double>(i))},
                                      {"sequence step", to_text(spacing[3])}});
    return true;
}

/// Names of the dimensions where some of them are directions in space; else empty.
std::vector<std::string> ChosenDataset::labels() const {
    std::vector<std::string> result = texts(*data_, "DIMENSION_LABELS");
    if (result.size() != shape_.size() || std::all_of(result.begin(), result.end(), enumerates)) result.clear();
    return result;
}

/// The dataset that says where the samples along a dimension lie; false if there is none.
Handle ChosenDataset::scale_of(int dimension) const {
    Handle none(-1, H5Dclose);
    if (H5Aexists(*data_, "DIMENSION_LIST") <= 0) return none;
    Handle const attribute(H5Aopen(*data_, "DIMENSION_LIST", H5P_DEFAULT), H5Aclose);
    if (!attribute) return none;
    Handle const type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    if (H5Tget_class(type) != H5T_VLEN || H5Sget_simple_extent_npoints(space) != static_cast<hssize_t>(shape_.size()))
        return none;
    std::vector<hvl_t> lists(shape_.size());
    if (H5Aread(attribute, type, lists.data()) < 0) return none;
    hvl_t const& list = lists[static_cast<std::size_t>(dimension)];
    Handle scale(list.len < 1 ? -1 : H5Rdereference2(*data_, H5P_DEFAULT, H5R_OBJECT, list.p), H5Dclose);
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, lists.data());
    return scale;
}

/// By the name of the dimension, its axis (CF conventions), or a unit such as "hours since 2000-01-01".
bool ChosenDataset::of_time(int dimension) const {
    Handle const scale = scale_of(dimension);
    if (!scale) return false;
    std::array<char, 256> path{};
    H5Iget_name(scale, path.data(), path.size());
    std::string const name = path.data();
    return enumerates(name.substr(name.rfind('/') + 1)) || words(scale, "axis") == "T" ||
           words(scale, "units").find(" since ") != std::string::npos;
}

/// Coordinates of the samples along each dimension, where they have even steps.
void ChosenDataset::read_scales(ParsedGrids& grids) {
    Header& header = grids.header;
    std::array<std::string, 3> units;
    for (int k = 0; k < static_cast<int>(shape_.size()); ++k) {
        auto const axis = std::find(axis_.begin(), axis_.end(), k) - axis_.begin();
        auto const lead = std::find(leading_.begin(), leading_.end(), k) - leading_.begin();
        if (axis == std::ssize(axis_) && lead == std::ssize(leading_)) continue;
        Handle const scale = scale_of(k);
        if (!scale) continue;
        Handle const scale_space(H5Dget_space(scale), H5Sclose), scale_type(H5Dget_type(scale), H5Tclose);
        hsize_t n = 0;
        if (H5Sget_simple_extent_ndims(scale_space) != 1 || H5Sget_simple_extent_dims(scale_space, &n, nullptr) != 1 ||
            n != shape_[static_cast<std::size_t>(k)] || n > longest_scale || !type_of(scale_type))
            continue;
        if (words(scale, "NAME").starts_with("This is a netCDF dimension but not a netCDF variable")) continue;
        std::vector<double> at(n);
        if (H5Dread(scale, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, at.data()) < 0) continue;
        if (axis == std::ssize(axis_)) {
            leading_places_[static_cast<std::size_t>(lead)] = sequence_places(at, words(scale, "units"));
            continue;
        }
        units[static_cast<std::size_t>(axis)] = words(scale, "units");
        place_axis(header, static_cast<int>(axis), at);
    }
    if (!units[0].empty() && units[0].find('"') == std::string::npos && units[0] == units[1] && units[0] == units[2])
        header.attributes["space units"] = text("\"", units[0], "\" \"", units[0], "\" \"", units[0], "\"");
}

/// Times and channels as vkt writes them, of the dimensions that are named so.
void ChosenDataset::read_series(Header& header) {
    std::vector<std::string> const names = labels();
    auto const stated = [&](char const* name) {
        auto const found = header.attributes.find(name);
        return found == header.attributes.end() ? std::nullopt : number_in(found->second);
    };
    for (std::size_t i = 0; i < leading_.size() && !names.empty(); ++i) {
        auto const k = static_cast<std::size_t>(leading_[i]);
        auto const n = static_cast<std::size_t>(shape_[k]);
        auto& places = leading_places_[i];
        auto const channels = texts(*data_, channel_attribute);
        if (names[k] == "c" && channels.size() == n) {
            places.clear();
            for (std::string const& channel : channels) places.push_back({{"channel", in_utf8(channel)}});
        }
        if (names[k] != "t") continue;
        auto const at = numbers(*data_, position_attribute, longest_list);
        auto const first = stated("sequence position"), step = stated("sequence step");
        if (at.size() == n) places = sequence_places(at, in_utf8(words(*data_, units_attribute)));
        for (std::size_t t = 0; at.empty() && first && step && n <= longest_scale && t < n; ++t)
            places.push_back({{"sequence position", to_text(*first + static_cast<double>(t) * *step)}});
        // What the header says is not rounded.
        for (auto& said : places)
            for (char const* const name : {"sequence step", "sequence units"})
                if (header.attributes.contains(name)) said.erase(name);
    }
}

/// What is said of each volume.
void ChosenDataset::say_places(ParsedGrids& grids) const {
    bool const any =
        std::any_of(leading_places_.begin(), leading_places_.end(), [](auto const& p) { return !p.empty(); });
    // Of several of which nobody says what they are, all but the last number channels, as the fifth of NIfTI does.
    std::vector<bool> numbers(leading_.size());
    if (leading_.size() > 1 && labels().empty())
        for (std::size_t i = 0; i < leading_.size(); ++i) numbers[i] = leading_places_[i].empty();
    if (!any && !numbers.empty()) numbers.back() = false;
    bool const numbered = std::find(numbers.begin(), numbers.end(), true) != numbers.end();
    if ((numbered || parts_ > 1) && grids.volumes > most_numbered)
        fail(text("dataset '", path_, "' is of ", grids.volumes, " volumes, more than are numbered"),
             "take a part of it with h5py");
    for (std::int64_t v = 0; (any || numbered) && v < grids.volumes / parts_; ++v) {
        auto& said = grids.attributes.emplace_back();
        auto rest = static_cast<std::size_t>(v);
        std::int64_t channel = 0, step = 1;
        for (std::size_t i = leading_.size(); i-- > 0;) {
            auto const n = static_cast<std::size_t>(shape_[static_cast<std::size_t>(leading_[i])]);
            if (!leading_places_[i].empty())
                said.insert(leading_places_[i][rest % n].begin(), leading_places_[i][rest % n].end());
            if (numbers[i]) {
                channel += step * static_cast<std::int64_t>(rest % n);
                step *= static_cast<std::int64_t>(n);
            }
            rest /= n;
        }
        if (numbered) said["channel"] = to_text(channel);
    }
}

/// The parts of complex numbers are channels, of each volume or of each channel.
void ChosenDataset::say_parts(ParsedGrids& grids) const {
    if (parts_ == 1) return;
    std::vector<std::map<std::string, std::string>> all;
    for (std::int64_t v = 0; v < grids.volumes; ++v) {
        auto said = grids.attributes.empty() ? std::map<std::string, std::string>{}
                                             : grids.attributes[static_cast<std::size_t>(v / parts_)];
        auto const found = said.find("channel");
        if (found != said.end() && !integer_in(found->second))
            found->second += v % parts_ == 0 ? " real" : " imaginary";
        else
            said["channel"] = to_text((found == said.end() ? 0 : *integer_in(found->second)) * parts_ + v % parts_);
        all.push_back(std::move(said));
    }
    grids.attributes = std::move(all);
}

void ChosenDataset::read_about(ParsedGrids& grids) {
    Header& header = grids.header;
    hid_t const data = *data_;
    if (!read_itk(grids)) read_scales(grids);
    if (auto const size = numbers(data, "element_size_um"); size.size() == 3 && axis_[2] >= 0) { // z, y, x
        for (int a = 0; a < 3; ++a)
            if (double const s = size[static_cast<std::size_t>(2 - a)]; s > 0 && std::isfinite(s))
                header.geometry.spacing[a] = s;
        header.attributes["space units"] = "\"um\" \"um\" \"um\"";
    }
    if (auto const spacing = numbers(data, "spacing"), origin = numbers(data, "origin");
        spacing.size() == 3 && origin.size() == 3 && axis_[2] >= 0)
        for (int a = 0; a < 3; ++a) {
            auto const k = static_cast<std::size_t>(2 - a);
            if (spacing[k] > 0 && std::isfinite(spacing[k])) header.geometry.spacing[a] = spacing[k];
            if (std::isfinite(origin[k])) header.geometry.origin[a] = origin[k];
        }
    double const slope = number(data, "scale_factor").value_or(1), offset = number(data, "add_offset").value_or(0);
    if (slope != 0) header.values = {slope, offset};
    header.units = words(data, "units");
    if (std::string const name = words(data, "long_name"); !name.empty()) header.attributes["long_name"] = name;
    for (char const* const name : {"_FillValue", "missing_value"})
        if (auto fill = number(data, name)) {
            bool const turned = *fill < 0 && is_integer(header.dtype) && !is_signed(header.dtype); // as _Unsigned says
            if (turned) *fill += std::ldexp(1.0, static_cast<int>(8 * size_of(header.dtype)));
            header.attributes[name] = to_text(*fill);
        }
    header = in_utf8(std::move(header));
    use_ours(header, words(data, header_attribute));
    read_series(header);
    say_places(grids);
    say_parts(grids);
}

/// What vkt wrote has all of the header, and counts as long as spacing and origin are still those written with it.
void ChosenDataset::use_ours(Header& header, std::string const& json) const {
    if (json.empty()) return;
    try {
        Header ours = header_from_json(json);
        check(ours);
        auto const same = [&](char const* name, Vec3 v) {
            return numbers(*data_, name) == std::vector<double>{v.z, v.y, v.x};
        };
        if (ours.kind != Kind::structured || !(ours.dims == header.dims) || ours.dtype != header.dtype ||
            ours.values != header.values || !same("spacing", ours.geometry.spacing) ||
            !same("origin", ours.geometry.origin))
            return;
        ours.attributes["variable"] = header.attributes["variable"];
        ours.dry_run = ours.timing = false;
        header = std::move(ours);
    } catch (Error const&) { // a damaged one is none
    }
}

} // namespace vkt::hdf5
