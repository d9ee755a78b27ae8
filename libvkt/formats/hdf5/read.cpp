// Reading datasets with HDF5: plain ones, MATLAB's (7.3) and NetCDF-4's.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/hdf5/chosen.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/tree_file.h"

#include <hdf5.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace vkt::hdf5 {
namespace {

class File : public GridsParser {
public:
    explicit File(std::string path) : all_(std::move(path)) {}

    ParsedGrids open(GridsChoice const& choice) override;
    void read(std::int64_t volume, Box const& box, std::byte* to) override { chosen_->read(volume, box, to); }

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const { all_.fail(what, hint); }
    Dataset const& choose(std::string const& variable, ParsedGrids& grids);

    Datasets all_;
    std::optional<ChosenDataset> chosen_;
};

Dataset const& File::choose(std::string const& variable, ParsedGrids& grids) {
    std::vector<AmrVariable> all;
    std::vector<std::size_t> index;
    // Lists of numbers count only where there is nothing else, or one is asked for.
    auto const image = [](Dataset const& d) {
        return !d.scale && std::count_if(d.shape.begin(), d.shape.end(), [](hsize_t n) { return n > 1; }) >= 2;
    };
    std::string const wanted = variable.empty() || variable.starts_with('/') ? variable : text("/", variable);
    if (!wanted.empty() &&
        std::none_of(all_.all().begin(), all_.all().end(), [&](Dataset const& d) { return d.path == wanted; }))
        all_.find_linked(wanted);
    bool const any = variable.empty() && std::any_of(all_.all().begin(), all_.all().end(), image);
    for (std::size_t i = 0; i < all_.all().size(); ++i) {
        if (any && !image(all_.all()[i])) continue;
        all.emplace_back();
        all.back().name = all_.all()[i].path;
        all.back().dtype = all_.all()[i].type;
        index.push_back(i);
    }
    if (all.empty()) fail("holds no dataset of numbers");
    std::size_t chosen = 0;
    if (wanted.empty() && all.size() > 1)
        for (std::size_t i : index) {
            Dataset const& d = all_.all()[i];
            std::string shape;
            for (std::size_t k = d.shape.size(); k-- > 0;)
                shape += text(shape.empty() ? "" : " x ", static_cast<std::int64_t>(d.shape[k]));
            grids.choices.emplace_back(d.path, text(d.complex ? "complex " : "", d.type, ", ", shape));
        }
    else
        chosen = choose_variable(all, wanted, all_.path());
    return all_.all()[index[chosen]];
}

ParsedGrids File::open(GridsChoice const& choice) {
    std::string const& variable = choice.variable;
    ParsedGrids grids;
    if (H5Lexists(all_.file(), "refine level", H5P_DEFAULT) > 0 &&
        H5Lexists(all_.file(), "node type", H5P_DEFAULT) > 0 && variable.empty())
        throw Error(ErrorKind::usage, text("'", all_.path(), "' is a FLASH file"), "read it as one: --format flash");
    if (variable.empty() && H5Lexists(all_.file(), "sim info", H5P_DEFAULT) > 0 &&
        H5Lexists(all_.file(), "particle names", H5P_DEFAULT) > 0)
        fail("is a FLASH file of particles, which are no volume", "plot files and checkpoints hold cells");
    if (variable.empty() && H5Lexists(all_.file(), "minc-2.0", H5P_DEFAULT) > 0)
        fail("is a MINC file, which is not read", "with FreeSurfer or MINC's tools: mri_convert in.mnc out.nii.gz");
    all_.find(grids.not_read);
    Dataset const& one = choose(variable, grids);
    grids.header.dtype = one.type;
    grids.header.attributes["variable"] = one.path;
    ChosenDataset& chosen = chosen_.emplace(all_, one);
    chosen.find_axes(grids);
    if (!choice.trust_paths) all_.check_elsewhere(chosen.data(), grids.not_read);
    chosen.read_about(grids);
    chosen.find_places(grids);
    return grids;
}

} // namespace

std::unique_ptr<GridsParser> open(std::string const& path) { return std::make_unique<File>(path); }

} // namespace vkt::hdf5
