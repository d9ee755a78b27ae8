// Functions as words for apply().
// SPDX-License-Identifier: MIT
#include "libvkt/operations/functions.h"

#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"

#include <utility>

namespace vkt {
namespace {

/// The words of one operation, option after option.
class Words {
public:
    Words(std::initializer_list<std::string> name) : words_(name) {}

    Words& option(std::string const& name, std::string const& value) {
        words_.push_back(text("--", name, "=", value));
        return *this;
    }
    Words& option(std::string const& name, double value) { return option(name, to_text(value)); }
    Words& option(std::string const& name, std::int64_t value) { return option(name, to_text(value)); }
    Words& option(std::string const& name, DataType value) { return option(name, std::string(to_text(value))); }
    Words& option(std::string const& name, Index3 v) { return option(name, text(v.x, ",", v.y, ",", v.z)); }
    Words& option(std::string const& name, Vec3 v) { return option(name, text(v.x, ",", v.y, ",", v.z)); }
    Words& option(std::string const& name, PerAxis const& v) { return option(name, v.value); }
    Words& option(std::string const& name, Outside const& outside) {
        std::string rule = enum_name(outside.rule);
        if (outside.rule == Boundary::border) rule += text(":", outside.value);
        return option(name, rule);
    }
    Words& option(std::string const& name, Region const& region) {
        return region.text.empty() ? *this : option(name, region.text);
    }
    template <class T> Words& option(std::string const& name, std::optional<T> const& value) {
        return value ? option(name, *value) : *this;
    }
    Words& flag(std::string const& name, bool set) {
        if (set) words_.push_back("--" + name);
        return *this;
    }
    Volume applied(std::vector<Volume> const& inputs, CallOptions const& how) const {
        return apply(words_, inputs, how);
    }

private:
    std::vector<std::string> words_;
};

} // namespace

Region::Region(Box const& box)
    : text(vkt::text(box.lower.x, ":", box.upper.x, ",", box.lower.y, ":", box.upper.y, ",", box.lower.z, ":",
                     box.upper.z)) {}

Volume gaussian(Volume const& volume, GaussianOptions const& options, CallOptions const& how) {
    Words words{"filter", "gaussian"};
    words.option("sigma", options.sigma).option("boundary", options.boundary).option("roi", options.roi);
    if (options.world) words.option("unit", std::string("world"));
    if (options.tolerance) words.option("tolerance", text(*options.tolerance, "%"));
    return words.applied({volume}, how);
}

Volume median(Volume const& volume, MedianOptions const& options, CallOptions const& how) {
    return Words{"filter", "median"}
        .option("radius", options.radius)
        .option("boundary", options.boundary)
        .option("roi", options.roi)
        .applied({volume}, how);
}

Volume bilateral(Volume const& volume, BilateralOptions const& options, CallOptions const& how) {
    return Words{"filter", "bilateral"}
        .option("sigma", options.sigma)
        .option("range-sigma", options.range_sigma)
        .option("boundary", options.boundary)
        .option("roi", options.roi)
        .applied({volume}, how);
}

Volume resample(Volume const& volume, ResampleOptions const& options, CallOptions const& how) {
    return Words{"resample"}
        .option("dims", options.dims)
        .option("scale", options.scale)
        .option("spacing", options.spacing)
        .option("method", options.method)
        .option("dtype", options.dtype)
        .applied({volume}, how);
}

Volume rotate(Volume const& volume, RotateOptions const& options, CallOptions const& how) {
    return Words{"rotate"}
        .option("angle", options.angle)
        .option("axis", options.axis)
        .option("about", options.about)
        .flag("expand", options.expand)
        .option("method", options.method)
        .option("background", options.background)
        .option("roi", options.roi)
        .applied({volume}, how);
}

Volume flip(Volume const& volume, Axis axis, CallOptions const& how) {
    return Words{"flip", enum_name(axis)}.applied({volume}, how);
}

Volume crop(Volume const& volume, Region const& roi, CallOptions const& how) {
    return Words{"crop"}.option("roi", roi).applied({volume}, how);
}

Volume pad(Volume const& volume, PadOptions const& options, CallOptions const& how) {
    return Words{"pad"}
        .option("by", Region(Box{options.below, options.above}))
        .option("boundary", options.boundary)
        .applied({volume}, how);
}

Volume fill(Volume const& volume, FillOptions const& options, CallOptions const& how) {
    return Words{"fill"}.option("value", options.value).option("roi", options.roi).applied({volume}, how);
}

Volume threshold(Volume const& volume, ThresholdOptions const& options, CallOptions const& how) {
    return Words{"threshold"}
        .option("above", options.above)
        .option("below", options.below)
        .flag("otsu", !options.above && !options.below)
        .option("roi", options.roi)
        .applied({volume}, how);
}

Volume label(Volume const& volume, LabelOptions const& options, CallOptions const& how) {
    return Words{"label"}
        .option("connectivity", std::int64_t{options.connectivity})
        .option("keep-largest", options.keep_largest)
        .option("min-size", options.min_size)
        .option("dtype", options.dtype)
        .applied({volume}, how);
}

Volume distance(Volume const& volume, DistanceOptions const& options, CallOptions const& how) {
    return Words{"distance"}
        .flag("signed", options.both_sides)
        .option("unit", std::string(options.voxels ? "voxel" : "world"))
        .applied({volume}, how);
}

Volume convert(Volume const& volume, DataType type, CallOptions const& how) {
    return Words{"convert"}.option("dtype", type).applied({volume}, how);
}

Volume arith(std::string const& name, Volume const& a, Volume const& b, CallOptions const& how) {
    return Words{"arith", name, "-", "-"}.applied({a, b}, how);
}

Volume arith(std::string const& name, Volume const& a, double b, CallOptions const& how) {
    return Words{"arith", name, "-", to_text(b)}.applied({a}, how);
}

StatisticsResult stats(Volume const& volume, StatsOptions const& options, CallOptions const& how) {
    Statistics statistics;
    statistics.roi = {options.roi.text};
    Execution execution = how.execution.execution();
    execution.monitor = how.monitor;
    StageInfo info;
    info.name = "stats";
    info.listener = how.listener;
    auto const source = volume_source({volume});
    source->next_volume();
    reduce(*source, statistics, execution, info);
    return statistics.result();
}

} // namespace vkt
