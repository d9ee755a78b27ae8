// Label: components that are too small or too many are named 0, the others in order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/label.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/labels.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/common/zero.h"
#include "libvkt/operations/shape/connectivity.h"
#include "libvkt/operations/voxels/kernels/fill.h"
#include "libvkt/operations/voxels/kernels/paint.h"

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

Plan Label::plan(std::span<Header const> inputs) const {
    Header const& in = inputs[0];
    Plan plan;
    plan.output = in;
    plan.output.dtype = dtype;
    plan.output.values = {};
    plan.output.units.clear();
    plan.output.attributes.erase("background");
    mark_as_labels(plan.output);
    plan.scans = true;
    plan.passing = ErrorPassing::jumps();
    plan.method = text("runs and union-find, ", connectivity, "-connected");
    plan.cost = by_value ? 120 : 85;
    if (in.kind == Kind::hierarchical) return plan; // refused by the engine
    plan.grows_by = "4 bytes a run of voxels in a row, 72 a component";
    plan.state_bytes = Components::table_bytes(roi.resolve(in.dims).dims());
    return plan;
}

void Label::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs[0];
    nan_ = 0;
    labelled_.clear();
    found_ = 0;
    device_.reset();
    if (input_.kind == Kind::hierarchical) return;
    Components::Rules rules;
    rules.connectivity = connectivity;
    rules.by_value = by_value;
    rules.zero = zero_ = stored_zero(input_);
    region_ = roi.resolve(input_.dims);
    components_.begin(region_.dims(), rules);
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
    scanned_on_ = execution;
    if (execution.device == Device::gpu) {
        if (!device_) {
            device_ = std::make_unique<DeviceComponents>();
            device_->dims = region_.dims();
            device_->connectivity = connectivity;
            device_->by_value = by_value;
        }
        return component_bits(*device_, slab, zero_, execution);
    }
    components_.add(slab, execution);
    if (is_integer(slab.type)) return;
    Index3 const n = slab.dims();
    std::vector<std::uint64_t> bits(static_cast<std::size_t>(bit_words(n.x) * n.y * n.z));
    pack_bits(slab, BitRule::number, {}, bits.data(), execution);
    nan_ += slab.box.voxels();
    for (std::uint64_t const word : bits) nan_ -= std::popcount(word);
}

void Label::choose(std::span<ComponentFacts const> all) {
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

/// The label of each component, 0 for those that get none.
std::vector<std::uint32_t> Label::chosen_names(std::size_t components) const {
    std::vector<std::uint32_t> names(components, 0);
    for (std::size_t i = 0; i < labelled_.size(); ++i) names[labelled_[i]] = static_cast<std::uint32_t>(i + 1);
    return names;
}

void Label::scan_end() {
    if (device_) {
        component_numbers(*device_, scanned_on_);
        nan_ = device_->nan;
        found_ = device_->count;
        if (!takes_all()) {
            std::vector<ComponentFacts> facts;
            component_facts(*device_, facts, scanned_on_);
            choose(facts);
        }
    } else {
        components_.end();
        found_ = static_cast<std::int64_t>(components_.found().size());
        choose(components_.found());
    }
    std::int64_t const labels = device_ && takes_all() ? found_ : static_cast<std::int64_t>(labelled_.size());
    if (static_cast<double>(labels) > highest_of(dtype))
        throw Error(ErrorKind::failure, text(labels, " components are more than ", dtype, " can number"),
                    "take a larger --dtype, or fewer components by --min-size or --keep-largest");
    if (!device_)
        components_.rename(chosen_names(components_.found().size()), scanned_on_.threads);
    else if (!takes_all())
        device_->names = chosen_names(static_cast<std::size_t>(found_));
}

void Label::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = intersect(out.box, region_);
    if (inside != out.box) fill_box(out, VoxelBytes{}, execution);
    if (inside.empty()) return;
    AnyView const to = out.part(inside).moved_to(inside.lower - region_.lower);
    if (device_) {
        if (to.space == Space::device) return component_labels(*device_, to, execution);
        // They were looked for where the voxels lay.
        Buffer memory(to.bytes());
        AnyView const made = dense_view(memory.write(Space::device), to.type, to.box, Space::device);
        component_labels(*device_, made, scanned_on_);
        return copy_region(made, to, scanned_on_);
    }
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
    std::vector<ComponentFacts> on_device;
    if (device_) component_facts(*device_, on_device, scanned_on_);
    std::span<ComponentFacts const> const all =
        device_ ? std::span<ComponentFacts const>(on_device) : std::span<ComponentFacts const>(components_.found());
    bool const everything = device_ && takes_all();
    std::size_t const labels = everything ? all.size() : labelled_.size();
    result.add("components", static_cast<std::int64_t>(all.size()));
    result.add("labelled", static_cast<std::int64_t>(labels));
    // There may be a label for every few voxels: what is told of one is made when it is printed.
    auto const facts = std::make_shared<LargeVector<ComponentFacts>>();
    facts->reserve(labels);
    for (std::size_t i = 0; i < labels; ++i) facts->push_back(all[everything ? i : labelled_[i]]);
    result.add("labels", labels, [facts, lower = region_.lower, geometry = input_.geometry](std::size_t i) {
        ComponentFacts const& c = (*facts)[i];
        auto const n = static_cast<long double>(c.size);
        auto const centre = [&](std::uint64_t sum, std::int64_t from) {
            return static_cast<double>(static_cast<long double>(sum) / n + static_cast<long double>(from));
        };
        Vec3 const centroid{centre(c.sum_x, lower.x), centre(c.sum_y, lower.y), centre(c.sum_z, lower.z)};
        Report row;
        row.add("label", static_cast<std::int64_t>(i + 1));
        row.add("size", static_cast<std::int64_t>(c.size));
        row.add("lower", Index3{c.lower_x, c.lower_y, c.lower_z} + lower);
        row.add("upper", Index3{c.upper_x, c.upper_y, c.upper_z} + lower);
        row.add("centroid", centroid);
        row.add("centroid_world", index_to_world(geometry, centroid));
        return row;
    });
    return result;
}

} // namespace vkt
