// What all readers of hierarchical files share.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/tree_file.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

namespace vkt {

std::optional<Box> wanted_box(AmrReadOptions const& options, Header const& header) {
    if (!options.roi.empty() && !options.world_roi.empty())
        throw Error(ErrorKind::usage, "--roi and --roi-world exclude each other");
    if (options.roi.empty() && options.world_roi.empty()) return std::nullopt;
    Box const box =
        options.roi.empty() ? resolve_in_tree(options.world_roi, header) : resolve_in_tree(options.roi, header);
    require_in_region(box, header);
    return box;
}

std::vector<std::size_t> bricks_within(std::optional<Box> const& region, BrickTable const& bricks, Index3 dims) {
    auto const point = [](Index3 p) {
        return Vec3{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
    };
    std::vector<std::size_t> kept;
    kept.reserve(bricks.size());
    for (std::size_t i = 0; i < bricks.size(); ++i)
        if (!region || domain_meets(bricks[i], dims, point(region->lower), point(region->upper))) kept.push_back(i);
    return kept;
}

std::size_t choose_variable(std::vector<AmrVariable> const& variables, std::string const& wanted,
                            std::string const& file) {
    std::vector<std::string> const names = collect(variables, [](AmrVariable const& v) { return v.name; });
    if (names.empty()) throw Error(ErrorKind::data, text(file, ": holds no cell variables"));
    if (wanted.empty()) {
        if (names.size() == 1) return 0;
        throw Error(
            ErrorKind::usage, text(file, ": holds several variables: ", join(names, ", ")),
            text("choose one: vkt read ", shell_quoted(file), " --variable ", shell_quoted(names.front()), " | ..."));
    }
    for (std::size_t i = 0; i < names.size(); ++i)
        if (names[i] == wanted) return i;
    std::string const near = nearest_name(wanted, names);
    throw Error(ErrorKind::usage, text(file, ": has no variable '", wanted, "'; it holds ", join(names, ", ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

} // namespace vkt
