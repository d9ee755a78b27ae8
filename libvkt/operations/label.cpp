// Label: components that are too small or too many are named 0, the others in order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/label.h"

#include "libvkt/core/text.h"
#include "libvkt/operations/connectivity.h"
#include "libvkt/operations/kernels/fill.h"
#include "libvkt/operations/kernels/paint.h"
#include "libvkt/operations/remarks.h"
#include "libvkt/operations/zero.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace vkt {

VKT_OPERATION(Label, "label")

Texts Label::texts() const {
    return {
        "Number connected components.",
        "Voxels that are neither zero nor NaN and touch each other get one number; components are numbered 1, 2, … "
        "by their first voxel in x-fastest order, all else is 0. --report tells their sizes, bounding boxes and "
        "centroids."
        "\n\n"
        "Accuracy: Exact: labels depend on the voxels alone; centroids in the report are correct to double precision.",
        {{"The largest object, as a mask", "vkt label volume.nrrd --keep-largest 1 --dtype uint8 -o object.nrrd"},
         {"What there is, specks aside",
          "vkt label volume.nrrd --connectivity 26 --min-size 10 --report objects.json -o labels.nrrd"}}};
}

void Label::parameters(Parameters& parameters) {
    connectivity_option(parameters, connectivity);
    parameters.flag("by-value", by_value, "voxels of different values do not belong together");
    parameters.option("keep-largest", keep_largest, "N",
                      "label only the N largest components; of equal ones the first");
    parameters.option("min-size", min_size, "VOXELS", "label only components of at least so many voxels");
    parameters.option("dtype", dtype, "TYPE", "unsigned integer type of the labels");
    parameters.option("roi", roi, "REGION", "label only the voxels of this region, as if there were no others");
}

void Label::check() const {
    check_connectivity(connectivity);
    if (keep_largest && *keep_largest < 1)
        throw Error(ErrorKind::usage, text("--keep-largest: ", *keep_largest, " is less than 1"));
    if (min_size < 1) throw Error(ErrorKind::usage, text("--min-size: ", min_size, " is less than 1"));
    if (!is_integer(dtype) || is_signed(dtype))
        throw Error(ErrorKind::usage, text("--dtype: labels cannot be ", dtype), "say uint8, uint16, uint32 or uint64");
}

Plan Label::plan(std::span<Header const> inputs) {
    input_ = inputs[0];
    nan_ = 0;
    labelled_.clear();
    Plan plan;
    plan.output = input_;
    plan.output.dtype = dtype;
    plan.output.values = {};
    plan.output.units.clear();
    plan.output.attributes.erase("background");
    plan.scans = true;
    plan.passing = ErrorPassing::jumps();
    plan.method = text("runs and union-find, ", connectivity, "-connected");
    plan.cost = 2;
    if (input_.kind == Kind::hierarchical) return plan; // refused by the engine
    Components::Rules rules;
    rules.connectivity = connectivity;
    rules.by_value = by_value;
    rules.zero = stored_zero(input_);
    region_ = roi.resolve(input_.dims);
    components_.begin(region_.dims(), rules);
    plan.state_bytes = Components::table_bytes(region_.dims());
    return plan;
}

Box Label::footprint(Box const& output, int) const {
    return {{0, output.lower.y, output.lower.z}, {input_.dims.x, output.upper.y, output.upper.z}};
}

ConstView Label::in_region(ConstView rows) const {
    Box const inside = intersect(rows.box, region_);
    return inside.empty() ? ConstView{} : rows.part(inside).moved_to(inside.lower - region_.lower);
}

void Label::scan(ConstView whole_rows, Execution const& execution) {
    ConstView const slab = in_region(whole_rows);
    if (slab.box.empty()) return;
    threads_ = execution.threads;
    components_.add(slab, execution);
    if (is_integer(slab.type)) return;
    Index3 const n = slab.dims();
    std::vector<std::uint64_t> bits(static_cast<std::size_t>(bit_words(n.x) * n.y * n.z));
    pack_bits(slab, BitRule::number, {}, bits.data(), execution);
    nan_ += slab.box.voxels();
    for (std::uint64_t const word : bits) nan_ -= std::popcount(word);
}

void Label::choose() {
    LargeVector<Components::Component> const& all = components_.found();
    for (std::size_t i = 0; i < all.size(); ++i)
        if (all[i].size >= static_cast<std::uint64_t>(min_size)) labelled_.push_back(static_cast<std::uint32_t>(i));
    if (keep_largest && static_cast<std::uint64_t>(*keep_largest) < labelled_.size()) {
        auto const end = labelled_.begin() + static_cast<std::ptrdiff_t>(*keep_largest);
        std::nth_element(labelled_.begin(), end, labelled_.end(), [&](std::uint32_t a, std::uint32_t b) {
            return all[a].size != all[b].size ? all[a].size > all[b].size : a < b;
        });
        labelled_.erase(end, labelled_.end());
        std::sort(labelled_.begin(), labelled_.end());
    }
}

void Label::scan_end() {
    components_.end();
    choose();
    if (static_cast<double>(labelled_.size()) > highest_of(dtype))
        throw Error(ErrorKind::failure, text(labelled_.size(), " components are more than ", dtype, " can number"),
                    "take a larger --dtype, or fewer components by --min-size or --keep-largest");
    std::vector<std::uint32_t> names(components_.found().size(), 0);
    for (std::size_t i = 0; i < labelled_.size(); ++i) names[labelled_[i]] = static_cast<std::uint32_t>(i + 1);
    components_.rename(names, threads_);
}

void Label::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = intersect(out.box, region_);
    if (inside != out.box) fill_box(out, VoxelBytes{}, execution);
    if (inside.empty()) return;
    AnyView const to = out.part(inside).moved_to(inside.lower - region_.lower);
    components_.for_each_row(
        in_region(inputs[0]), execution,
        [&](std::int64_t y, std::int64_t z, std::span<std::int32_t const> edges, std::uint32_t const* names) {
            Box row = to.box;
            row.lower.y = y, row.upper.y = y + 1;
            row.lower.z = z, row.upper.z = z + 1;
            paint_row(edges, names, to.part(row), execution);
        });
}

std::vector<Remark> Label::remarks() const {
    if (nan_ == 0) return {};
    return {{text(share_text(nan_, region_.voxels()), " not a number: they belong to no component"), false}};
}

Report Label::report() const {
    Report result;
    LargeVector<Components::Component> const& all = components_.found();
    result.add("components", static_cast<std::int64_t>(all.size()));
    result.add("labelled", static_cast<std::int64_t>(labelled_.size()));
    std::vector<Report> rows;
    for (std::size_t i = 0; i < labelled_.size(); ++i) {
        Components::Component const& c = all[labelled_[i]];
        auto const n = static_cast<long double>(c.size);
        auto const centre = [&](std::uint64_t sum, std::int64_t lower) {
            return static_cast<double>(static_cast<long double>(sum) / n + static_cast<long double>(lower));
        };
        Vec3 const centroid{centre(c.sum_x, region_.lower.x), centre(c.sum_y, region_.lower.y),
                            centre(c.sum_z, region_.lower.z)};
        Report row;
        row.add("label", static_cast<std::int64_t>(i + 1));
        row.add("size", static_cast<std::int64_t>(c.size));
        row.add("lower", Index3{c.lower_x, c.lower_y, c.lower_z} + region_.lower);
        row.add("upper", Index3{c.upper_x, c.upper_y, c.upper_z} + region_.lower);
        row.add("centroid", centroid);
        row.add("centroid_world", index_to_world(input_.geometry, centroid));
        rows.push_back(std::move(row));
    }
    result.add("labels", std::move(rows));
    return result;
}

} // namespace vkt
