// Filling what objects enclose.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/operation.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/number.h"
#include "libvkt/operations/common/zero.h"
#include "libvkt/operations/shape/components.h"
#include "libvkt/operations/shape/connectivity.h"
#include "libvkt/operations/shape/kernels/device_components.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

namespace vkt {

namespace {

/// A hole is a component of voxels that are (physically) zero which touches no face of the volume; axes of
/// one voxel have no faces, so that slices are what they are in two dimensions. Its voxels get the
/// value of the voxel before its first one in x-fastest order, which belongs to what encloses it, or the value given.
/// All else is copied, bit for bit. NaN is no hole, and closes one. Two passes; tables as for Label.
class FillHoles : public Operation {
public:
    int connectivity = 6; ///< of the holes
    std::optional<Number> value;
    std::optional<std::int64_t> max_size; ///< voxels
    Roi roi;                              ///< as if it were the volume; all else is copied

    std::string_view name() const override { return "fill-holes"; }
    Texts texts() const override {
        return {"Fill what objects enclose.",
                "Zero voxels from which no path of zero voxels leads to a face of the volume get the value of what "
                "encloses them. All else stays as it is."
                "\n\n"
                "Accuracy: Exact: voxels outside of holes are copied; a value given is correctly rounded once.",
                {{"An object without cavities", "vkt fill-holes volume.nrrd -o solid.nrrd"},
                 {"Only bubbles of at most 100 voxels", "vkt fill-holes volume.nrrd --max-size 100 | vkt stats"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override {
        connectivity_option(parameters, connectivity, "zero voxels");
        parameters.option("value", value, "VALUE",
                          "physical value to fill with; by default that of what encloses the hole");
        parameters.option("max-size", max_size, "VOXELS", "fill only holes of at most so many voxels");
        parameters.option("roi", roi, "REGION",
                          "look only at this region, as if it were the volume; keep the other voxels");
    }

    void check() const override {
        check_connectivity(connectivity);
        if (max_size && *max_size < 1)
            throw Error(ErrorKind::usage, text("--max-size: ", *max_size, " is less than 1"));
    }

    Plan plan(std::span<Header const> inputs) const override {
        Header const& in = inputs[0];
        Plan plan;
        plan.output = in;
        plan.scans = true;
        plan.passing = ErrorPassing::jumps();
        if (!is_integer(in.dtype)) plan.passing = {};
        if (value) plan.passing = {};
        plan.method = text("runs and union-find, holes ", connectivity, "-connected");
        plan.cost = 60;
        if (in.kind == Kind::hierarchical) return plan; // refused by the engine
        plan.state_bytes = Components::table_bytes(roi.resolve(in.dims).dims());
        plan.grows_by = "4 bytes a run of zero voxels in a row, 80 a component of them";
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const&) override {
        input_ = inputs[0];
        fillings_.clear();
        device_.reset();
        passes_ = 0;
        holes_ = 0;
        filled_ = 0;
        stored_.reset();
        fits_ = true;
        if (input_.kind == Kind::hierarchical) return;
        Components::Rules rules;
        rules.connectivity = connectivity;
        rules.members = BitRule::hole;
        rules.zero = zero_ = stored_zero(input_);
        rules.keeps_value_before = true;
        region_ = roi.resolve(input_.dims);
        components_.begin(region_.dims(), rules);
        if (value) {
            Number const number = input_.values == ValueMap{} ? *value : Number(input_.values.stored(value->value));
            stored_ = voxel_bytes(input_.dtype, number);
            fits_ = fits(input_.dtype, number);
        }
    }

    Box footprint(Box const& output, int) const override {
        return {{0, output.lower.y, output.lower.z}, {input_.dims.x, output.upper.y, output.upper.z}};
    }

    void scan(ConstView whole_rows, Execution const& execution) override {
        ConstView const slab = in_region(whole_rows);
        if (slab.box.empty()) return;
        scanned_on_ = execution;
        if (execution.device != Device::gpu) return components_.add(slab, execution);
        if (passes_ > 0) return component_values(*device_, slab, execution);
        if (!device_) {
            device_ = std::make_unique<DeviceComponents>();
            device_->dims = region_.dims();
            device_->connectivity = connectivity;
            device_->holes = true;
        }
        component_bits(*device_, slab, zero_, execution);
    }

    void scan_end() override {
        ++passes_;
        if (device_) {
            if (passes_ == 1) number_on_device();
            return;
        }
        components_.end();
        LargeVector<ComponentFacts> const& all = components_.found();
        std::vector<std::uint32_t> names(all.size(), 0);
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (!fills(all[i])) continue;
            fillings_.push_back(stored_.value_or(all[i].value_before));
            names[i] = static_cast<std::uint32_t>(fillings_.size());
            filled_ += all[i].size;
        }
        holes_ = static_cast<std::int64_t>(fillings_.size());
        components_.rename(names, scanned_on_.threads);
    }

    /// On a GPU the values come in a second pass.
    bool scans_again() const override { return device_ && passes_ == 1 && !stored_ && filled_ > 0; }
    void run(std::span<ConstView const> inputs, AnyView whole, Execution const& execution) override {
        copy_region(inputs[0].part(whole.box), whole, execution);
        Box const inside = intersect(whole.box, region_);
        if (holes_ == 0 || inside.empty()) return;
        AnyView const out = whole.part(inside).moved_to(inside.lower - region_.lower);
        if (device_) {
            if (out.space == Space::device) return component_paint(*device_, out, execution);
            // They were looked for where the voxels lay.
            Buffer memory(out.bytes());
            AnyView const made = dense_view(memory.write(Space::device), out.type, out.box, Space::device);
            copy_region(out, made, scanned_on_);
            component_paint(*device_, made, scanned_on_);
            return copy_region(made, out, scanned_on_);
        }
        VKT_BACKEND::for_each_size(size_of(out.type), [&]<class U>(U) {
            View<U> const to = out.as<U>();
            auto const first = static_cast<std::int32_t>(out.box.lower.x),
                       last = static_cast<std::int32_t>(out.box.upper.x);
            components_.for_each_row(
                in_region(inputs[0]), execution,
                [&](std::int64_t y, std::int64_t z, std::span<std::int32_t const> edges, std::uint32_t const* names) {
                    U* const row = &to(first, y, z);
                    for (std::size_t i = 0; i < edges.size(); i += 2) {
                        std::uint32_t const name = names[i / 2];
                        if (name == 0) continue;
                        U bits;
                        std::memcpy(&bits, fillings_[name - 1].data(), sizeof bits);
                        std::int32_t const begin = std::clamp(edges[i], first, last);
                        std::int32_t const end = std::clamp(edges[i + 1], first, last);
                        std::fill(row + (begin - first), row + (end - first), bits);
                    }
                });
        });
    }

    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<Remark> remarks() const override {
        if (fits_ || filled_ == 0) return {};
        return {
            {text("the value ", *value, " does not fit ", input_.dtype, ": another is stored in ", filled_, " voxels"),
             true}};
    }

    bool reports() const override { return true; }
    /// How many holes were filled, and how many voxels.
    Report report() const override {
        Report result;
        result.add("holes", holes_);
        result.add("voxels", static_cast<std::int64_t>(filled_));
        return result;
    }

private:
    /// The part of whole rows that lies in the region, in voxels of the region.
    ConstView in_region(ConstView rows) const {
        Box const inside = intersect(rows.box, region_);
        return inside.empty() ? ConstView{} : rows.part(inside).moved_to(inside.lower - region_.lower);
    }

    bool fills(ComponentFacts const& hole) const {
        Index3 const n = region_.dims();
        bool const open = (n.x > 1 && (hole.lower_x == 0 || hole.upper_x == n.x)) ||
                          (n.y > 1 && (hole.lower_y == 0 || hole.upper_y == n.y)) ||
                          (n.z > 1 && (hole.lower_z == 0 || hole.upper_z == n.z));
        return !open && !(max_size && hole.size > static_cast<std::uint64_t>(*max_size));
    }

    void number_on_device() {
        component_numbers(*device_, scanned_on_);
        std::vector<ComponentFacts> facts;
        component_facts(*device_, facts, scanned_on_);
        device_->names.assign(facts.size(), 0);
        for (std::size_t i = 0; i < facts.size(); ++i) {
            if (!fills(facts[i])) continue;
            device_->names[i] = 1;
            ++holes_;
            filled_ += facts[i].size;
        }
        if (!stored_ || facts.empty()) return;
        std::vector<VoxelBytes> const values(facts.size(), *stored_);
        device_->values.reserve(values.size() * sizeof values[0]);
        copy_to_device(device_->values.write(Space::device), values.data(), values.size() * sizeof values[0]);
    }

    Header input_;
    Box region_;
    std::optional<double> zero_;
    Components components_;
    std::unique_ptr<DeviceComponents> device_; ///< instead, if they are looked for on a GPU
    Execution scanned_on_;
    int passes_ = 0;
    std::int64_t holes_ = 0;           ///< that are filled
    std::vector<VoxelBytes> fillings_; ///< of holes by their name less 1
    std::optional<VoxelBytes> stored_; ///< the value given
    bool fits_ = true;                 ///< … as it is
    std::uint64_t filled_ = 0;         ///< voxels
};

} // namespace

VKT_OPERATION(FillHoles, "fill-holes")

} // namespace vkt
