// Errors that travel: what the engine makes of gains, bounds, types and value maps, and what it never keeps.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/kernel/border.h"

#include <cmath>
#include <gtest/gtest.h>

namespace {

using namespace vkt;

Header header_of(DataType type, VolumeError error) {
    Header header;
    header.dims = {3, 2, 2};
    header.dtype = type;
    header.error = std::move(error);
    return header;
}

VolumeError bound_of(double at_most) {
    VolumeError error;
    error.kind = Certainty::bound;
    error.at_most = at_most;
    return error;
}

/// An operation whose author gave no thought to errors: it copies the header and says nothing.
class Forgetful : public Operation {
public:
    std::string_view name() const override { return "forgetful"; }
    Shape shape() const override { return Shape::pointwise; }
    Plan plan(std::span<Header const> inputs) const override {
        Plan plan;
        plan.output = inputs.front();
        return plan;
    }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        copy_region(inputs.front().part(out.box), out, execution);
    }
};

TEST(Travelled, AnOperationThatSaysNothingLosesTheError) {
    Forgetful operation;
    for (VolumeError const& error : {VolumeError::given(), bound_of(0.25)}) {
        Volume const result = apply(operation, {Volume(header_of(DataType::uint8, error))}, {});
        EXPECT_EQ(result.header().error.kind, Certainty::unknown);
        EXPECT_NE(result.header().error.because.find("forgetful"), std::string::npos);
    }
}

TEST(Travelled, AHeaderThatSaysNothingIsUnknown) {
    EXPECT_EQ(Header{}.error.kind, Certainty::unknown);
    Header const old = header_from_json(to_json(header_of(DataType::uint8, {})));
    EXPECT_EQ(old.error.kind, Certainty::unknown);
    Plan plan;
    plan.output = old;
    plan.passing = ErrorPassing::moved({});
    EXPECT_EQ(travelled({&old, 1}, plan, "flip").kind, Certainty::unknown);
}

TEST(Travelled, JsonKeepsWhatIsSaid) {
    VolumeError all = bound_of(0x1.23456789p-30);
    all.values = ValueInterval{-1024.5, 3071};
    for (VolumeError const& error : {VolumeError{}, VolumeError::given(), all, VolumeError::lost("it \"jumps\"")}) {
        EXPECT_EQ(header_from_json(to_json(header_of(DataType::int16, error))).error, error);
        EXPECT_EQ(volume_error_from_json(error.silent() ? R"({"kind": "unknown"})" : to_json(error)), error);
    }
    EXPECT_THROW(volume_error_from_json(R"({"kind": "bound", "at_most": -1})"), Error);
    EXPECT_THROW(volume_error_from_json(R"({"kind": "bound"})"), Error);
    EXPECT_THROW(volume_error_from_json(R"({"at_most": 1})"), Error);
    EXPECT_EQ(volume_error_from_json(R"({"kind": "certain"})").kind, Certainty::unknown);
}

TEST(Travelled, KindsNeverImprove) {
    for (Certainty const kind : {Certainty::exact, Certainty::bound, Certainty::estimate, Certainty::unknown}) {
        VolumeError error = bound_of(kind == Certainty::exact ? 0 : 0.1);
        error.kind = kind;
        Header const in = header_of(DataType::uint8, error);
        for (Certainty const own : {Certainty::exact, Certainty::bound, Certainty::estimate, Certainty::unknown}) {
            Plan plan;
            plan.output = in;
            plan.error.kind = own;
            plan.error.absolute = own == Certainty::exact ? 0 : 0.2;
            plan.passing = ErrorPassing::averaged(1, values_of(in));
            EXPECT_GE(travelled({&in, 1}, plan, "filter").kind, std::max(kind, own));
        }
    }
}

TEST(Travelled, TypesAndValueMapsAddTheirSteps) {
    Header in = header_of(DataType::uint8, VolumeError::given());
    in.values = {2, -1000};
    Plan plan;
    plan.output = in;
    plan.passing = ErrorPassing::averaged(1, values_of(in));
    EXPECT_NEAR(travelled({&in, 1}, plan, "mean").at_most, 1, 1e-9); // half a step of 2
    EXPECT_GE(travelled({&in, 1}, plan, "mean").at_most, 1);
    // A share of 510 values, which the type limits.
    plan.error.kind = Certainty::bound;
    plan.error.range = 0.01;
    EXPECT_NEAR(travelled({&in, 1}, plan, "mean").at_most, 1 + 5.1, 1e-9);
    // Nothing limits those of floats.
    Header const real = header_of(DataType::float32, VolumeError::given());
    plan.output = real;
    EXPECT_EQ(travelled({&real, 1}, plan, "mean").kind, Certainty::unknown);
    VolumeError limited = VolumeError::given();
    limited.values = ValueInterval{0, 100};
    Header const known = header_of(DataType::float32, limited);
    plan.output = known;
    plan.passing = ErrorPassing::averaged(1, values_of(known));
    EXPECT_NEAR(travelled({&known, 1}, plan, "mean").at_most, 1, 1e-9);
    // Integers in floats that hold them cost nothing, in those that do not half a unit in the last place.
    for (auto const& [from, to, steps] : {std::tuple{DataType::uint16, DataType::float32, 0.0},
                                          {DataType::uint8, DataType::float16, 0.0},
                                          {DataType::int32, DataType::float32, 0x1p-24 * 0x1p31},
                                          {DataType::float64, DataType::float32, HUGE_VAL}}) {
        Header const given = header_of(from, VolumeError::given());
        Plan convert;
        convert.output = given;
        convert.output.dtype = to;
        convert.passing = ErrorPassing::computed(1, values_of(given));
        convert.passing.storing = ErrorPassing::Storing::converts;
        VolumeError const error = travelled({&given, 1}, convert, "convert");
        if (steps == HUGE_VAL)
            EXPECT_FALSE(error.known());
        else
            EXPECT_NEAR(error.at_most, steps, 1e-9 * steps) << name_of(from) << " " << name_of(to);
    }
}

TEST(Travelled, JumpsNeedExactInputs) {
    Header const exact = header_of(DataType::uint8, VolumeError::given());
    Header const near = header_of(DataType::uint8, bound_of(1e-9));
    Plan plan;
    plan.output = exact;
    plan.passing = ErrorPassing::jumps(ValueInterval{0, 1});
    EXPECT_TRUE(travelled({&exact, 1}, plan, "threshold").exact());
    VolumeError const lost = travelled({&near, 1}, plan, "threshold");
    EXPECT_EQ(lost.kind, Certainty::unknown);
    EXPECT_NE(lost.because.find("threshold jumps"), std::string::npos);
}

TEST(Travelled, Sentences) {
    EXPECT_EQ(to_sentence(VolumeError::given(), "HU"), "exact");
    EXPECT_EQ(to_sentence(bound_of(0.3), "HU"), "within 0.3 HU of exact");
    EXPECT_EQ(to_sentence(bound_of(0.301), ""), "within 0.31 of exact");
    VolumeError about = bound_of(2);
    about.kind = Certainty::estimate;
    EXPECT_EQ(to_sentence(about, ""), "about 2 from exact");
    EXPECT_EQ(to_sentence({}, ""), "unknown");
}

} // namespace
