// Fill: the region from a constant, the rest from the input.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/fill.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/beside.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/voxels/kernels/fill.h"

namespace vkt {

VKT_OPERATION(Fill, "fill")
VKT_OPERATION(FillRange, "fill-range")
VKT_OPERATION(Delete, "delete")

Texts Fill::texts() const {
    return {
        "Set all voxels, or those of a region, to one value.",
        "The value is physical: it is mapped to a stored value through the slope and intercept of the volume, rounded "
        "half to even and saturated."
        "\n\n"
        "Accuracy: The value is correctly rounded once; all other voxels stay, bit for bit.",
        {{"An empty volume of the same shape", "vkt fill volume.nrrd --value 0 -o empty.nrrd"},
         {"Blank a corner", "vkt fill volume.nrrd --value 0 --roi 0:8,0:8,0:8 | vkt stats"}}};
}

void Fill::parameters(Parameters& parameters) {
    parameters.option("value", value_, "VALUE", "physical value to store");
    parameters.option("roi", region_, "REGION", "fill only the voxels of this region");
    parameters.option("first", first_, "X Y Z", "first voxel of the region (volkit)");
    parameters.option("last", last_, "X Y Z", "the voxel just beyond the region (volkit)");
}

void Fill::check() const {
    if (first_.has_value() != last_.has_value()) throw Error(ErrorKind::usage, "--first and --last go together");
    if (first_ && !region_.empty())
        throw Error(ErrorKind::usage, "--roi and --first/--last say the same: give one of them");
}

void FillRange::check() const {
    Fill::check();
    if (!first_ && region_.empty())
        throw Error(ErrorKind::usage, "no range is given", "say for example --first 0 0 0 --last 8 8 8");
}

Number Fill::stored_in(Header const& in) const {
    Number const value = value_in(in);
    return in.values == ValueMap{} ? value : Number(in.values.stored(value.value));
}

Plan Fill::plan(std::span<Header const> inputs) const {
    Header const& in = inputs[0];
    static_cast<void>(LevelRegion(region(), in)); // or it is refused
    Number const stored = stored_in(in);
    Plan plan;
    plan.output = in;
    plan.method = "constant";
    auto values = values_of(in);
    if (values) values = values->with(in.values.physical(stored.value));
    plan.passing = ErrorPassing::moved(values);
    plan.passing.more = std::abs(in.values.slope) * storing_loss(in.dtype, stored);
    plan.cost = 0;
    return plan;
}

void Fill::begin(std::span<Header const> inputs, Plan const&) {
    Header const& in = inputs[0];
    inside_ = {region(), in};
    filled_ = 0;
    physical_ = value_in(in);
    stored_ = stored_in(in);
    type_ = in.dtype;
}

void Fill::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = inside_.part_of(out.box);
    for_each_beside(out.box, inside,
                    [&](Box const& box) { copy_region(inputs[0].part(box), out.part(box), execution); });
    filled_ += inside.voxels();
    if (!inside.empty()) fill_box(out.part(inside), voxel_bytes(type_, stored_), execution);
}

std::vector<Remark> Fill::remarks() const { return value_remarks(physical_, stored_, type_, filled_); }

Delete::Delete(Roi region, std::optional<Number> background) : Fill({}, std::move(region)), background_(background) {}

Texts Delete::texts() const {
    return {
        "Make a region background.",
        "The extent of the volume stays; vkt crop changes it. The background is --value, or what the volume says its "
        "background is, or 0."
        "\n\n"
        "Accuracy: The value is correctly rounded once; all other voxels stay, bit for bit.",
        {{"Without the table under the patient", "vkt delete volume.nrrd --roi :,75%:,: -o patient.nrrd"},
         {"As air", "vkt delete volume.nrrd --roi 0:8,0:8,: --value -1000 --dry-run"}}};
}

void Delete::parameters(Parameters& parameters) {
    parameters.option("roi", region_, "REGION", "the voxels to delete, X0:X1,Y0:Y1,Z0:Z1").needed();
    parameters.option("value", background_, "VALUE", "physical value that they get (the volume's background, or 0)");
}

Number Delete::value_in(Header const& in) const {
    auto const own = in.attributes.find("background");
    return background_ ? *background_ : own != in.attributes.end() ? Number::parse(own->second) : Number(0);
}

Texts FillRange::texts() const {
    return {"Set the voxels of a region to one value.",
            "volkit's name for vkt fill with a range, which must be given."
            "\n\n"
            "Accuracy: The value is correctly rounded once; all other voxels stay, bit for bit.",
            {{"Blank a corner",
              "vkt make ramp --dims 16 12 8 | vkt fill-range --first 0 0 0 --last 4 4 4 --value 0 | vkt stats"}}};
}

} // namespace vkt
