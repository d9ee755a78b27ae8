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

/// An operation whose options say how the volume continues outside and where it works.
template <class Options> Words local(std::initializer_list<std::string> name, Options const& options) {
    Words words(name);
    words.option("boundary", options.boundary).option("roi", options.roi);
    return words;
}

} // namespace

Region::Region(Box const& box)
    : text(vkt::text(box.lower.x, ":", box.upper.x, ",", box.lower.y, ":", box.upper.y, ",", box.lower.z, ":",
                     box.upper.z)) {}

Volume gaussian(Volume const& volume, GaussianOptions const& options, CallOptions const& how) {
    Words words = local({"filter", "gaussian"}, options);
    words.option("sigma", options.sigma);
    if (options.world) words.option("unit", std::string("world"));
    if (options.tolerance) words.option("tolerance", text(*options.tolerance, "%"));
    return words.applied({volume}, how);
}

Volume median(Volume const& volume, MedianOptions const& options, CallOptions const& how) {
    return local({"filter", "median"}, options).option("radius", options.radius).applied({volume}, how);
}

Volume bilateral(Volume const& volume, BilateralOptions const& options, CallOptions const& how) {
    return local({"filter", "bilateral"}, options)
        .option("sigma", options.sigma)
        .option("range-sigma", options.range_sigma)
        .applied({volume}, how);
}

Volume box_mean(Volume const& volume, BoxOptions const& options, CallOptions const& how) {
    return local({"filter", "box"}, options).option("radius", options.radius).applied({volume}, how);
}

namespace {

Volume derivative(std::string const& name, Volume const& volume, DerivativeOptions const& options,
                  CallOptions const& how) {
    return local({"filter", name}, options)
        .option("component", options.component)
        .option("dtype", options.dtype)
        .applied({volume}, how);
}

} // namespace

Volume gradient(Volume const& volume, DerivativeOptions const& options, CallOptions const& how) {
    return derivative("gradient", volume, options, how);
}

Volume sobel(Volume const& volume, DerivativeOptions const& options, CallOptions const& how) {
    return derivative("sobel", volume, options, how);
}

Volume laplacian(Volume const& volume, LaplacianOptions const& options, CallOptions const& how) {
    return local({"filter", options.sigma ? "log" : "laplacian"}, options)
        .option("sigma", options.sigma)
        .option("dtype", options.dtype)
        .applied({volume}, how);
}

Volume sharpen(Volume const& volume, SharpenOptions const& options, CallOptions const& how) {
    return local({"filter", "sharpen"}, options)
        .option("sigma", options.sigma)
        .option("amount", options.amount)
        .applied({volume}, how);
}

Volume nlmeans(Volume const& volume, NlmeansOptions const& options, CallOptions const& how) {
    return local({"filter", "nlmeans"}, options)
        .option("noise", options.noise)
        .option("strength", options.strength)
        .option("patch", options.patch)
        .option("search", options.search)
        .applied({volume}, how);
}

Volume morphology(std::string const& what, Volume const& volume, MorphologyOptions const& options,
                  CallOptions const& how) {
    return local({"morphology", what}, options)
        .option("radius", options.radius)
        .option("shape", options.shape)
        .applied({volume}, how);
}

Volume clahe(Volume const& volume, ClaheOptions const& options, CallOptions const& how) {
    return Words{"clahe"}
        .option("clip", options.clip)
        .option("bricks", options.bricks)
        .option("bins", std::int64_t{options.bins})
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

Volume scale(Volume const& volume, ScaleOptions const& options, CallOptions const& how) {
    return Words{"scale"}
        .option("factor", options.factor)
        .option("about", options.about)
        .flag("expand", options.expand)
        .option("method", options.method)
        .option("background", options.background)
        .option("roi", options.roi)
        .applied({volume}, how);
}

Volume affine(Volume const& volume, AffineOptions const& options, CallOptions const& how) {
    std::vector<std::string> numbers;
    for (double const number : options.matrix) numbers.push_back(to_text(number));
    return Words{"affine", join(numbers, " ")}
        .option("unit", std::string(options.voxels ? "voxel" : "world"))
        .flag("inverse", options.inverse)
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

Volume paste(Volume const& part, Volume const& into, Index3 at, CallOptions const& how) {
    return Words{"copy", "-", "-"}.option("at", at).applied({part, into}, how);
}

Volume permute(Volume const& volume, std::string const& order, CallOptions const& how) {
    return Words{"permute", order}.applied({volume}, how);
}

Volume slice(Volume const& volume, Axis axis, std::int64_t at, CallOptions const& how) {
    return Words{"slice"}.option(enum_name(axis), at).applied({volume}, how);
}

Volume project(std::string const& what, Volume const& volume, ProjectOptions const& options, CallOptions const& how) {
    return Words{"project", what}
        .option("axis", std::string(enum_name(options.axis)))
        .option("roi", options.roi)
        .applied({volume}, how);
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

Volume fill_holes(Volume const& volume, int connectivity, CallOptions const& how) {
    return Words{"fill-holes"}.option("connectivity", std::int64_t{connectivity}).applied({volume}, how);
}

Volume watershed(Volume const& volume, WatershedOptions const& options, CallOptions const& how) {
    Words words{"watershed"};
    if (options.markers) words.option("markers", std::string("-"));
    if (!options.markers) words.option("depth", options.depth);
    words.option("on", options.on)
        .option("connectivity", std::int64_t{options.connectivity})
        .flag("line", options.line);
    std::vector<Volume> inputs{volume};
    if (options.markers) inputs.push_back(*options.markers);
    return words.applied(inputs, how);
}

Volume scan(Volume const& volume, bool exclusive, CallOptions const& how) {
    return Words{"scan"}.flag("exclusive", exclusive).applied({volume}, how);
}

Volume transform(std::string const& expression, Volume const& volume, TransformOptions const& options,
                 CallOptions const& how) {
    std::vector<Volume> inputs{volume};
    inputs.insert(inputs.end(), options.others.begin(), options.others.end());
    return local({"transform", expression}, options).option("dtype", options.dtype).applied(inputs, how);
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
