// The contract of operations, for all that are registered: plan() changes nothing, and begin() starts anew.
// SPDX-License-Identifier: MIT
#include "volumes.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <string>
#include <unistd.h>

using namespace vkt;

namespace {

using Words = std::vector<std::string>;

/// A kernel that is no product, for `filter kernel`.
class KernelFile {
public:
    KernelFile()
        : path_((std::filesystem::temp_directory_path() / text("vkt-contract-", static_cast<std::int64_t>(::getpid())))
                    .string()) {
        std::ofstream(path_) << "3 3 1  1 2 1  0 5 0  -1 0 -3\n";
    }
    KernelFile(KernelFile const&) = delete;
    KernelFile& operator=(KernelFile const&) = delete;
    ~KernelFile() { std::filesystem::remove(path_); }
    std::string const& path() const { return path_; }

private:
    std::string path_;
};

/// Lives as long as the tests run.
std::string const& kernel_file() {
    static KernelFile const file;
    return file.path();
}

/// What each operation is asked for, several times over. Options that clip, drop or count are among them, so that what
/// is remarked is not nothing. An operation that stands here with no words is asked for as it is.
std::map<std::string, std::vector<Words>> const& requests() {
    static std::map<std::string, std::vector<Words>> const all{
        {"affine", {{"1 0.2 0 1 0 1 0 0 0 0 1 0"}, {"1 0 0 2 0 1 0 0 0 0 1 0", "--roi", "2:9,:,1:6"}}},
        {"arith", {{"mul", "-", "37.5"}, {"div", "-", "-"}, {"sub", "-", "90", "--dtype", "uint8"}}},
        {"filter bilateral", {{"--range-sigma", "20"}}},
        {"filter box", {{"--radius", "2,1,1"}}},
        {"clahe", {{"--bricks", "2,2,2"}, {"--range", "10:60"}, {"--range", "p5:p90"}}},
        {"convert", {{"--dtype", "int8"}, {"--dtype", "uint8", "--range", "p5:p90"}, {"--dtype", "auto"}}},
        {"crop", {{"--roi", "1:9,2:,:"}, {"--roi", "::2,::3,:"}}},
        {"filter gradient", {{"--dtype", "uint8"}}},
        {"filter sobel", {{"--dtype", "uint8"}}},
        {"filter laplacian", {{"--dtype", "uint8"}}},
        {"diff", {{"--ssim", "--mutual-information"}, {"--tolerance", "3"}}},
        {"distance", {{}, {"--signed", "--unit", "voxel", "--roi", "1:9,:,:"}}},
        {"dump", {{}}},
        {"dump-range", {{"--first", "1", "1", "1", "--last", "4", "5", "3"}}},
        {"fill", {{"--value", "1e9", "--roi", "1:5,:,:"}, {"--value", "300"}}},
        {"fill-range", {{"--value", "-400", "--first", "1", "1", "1", "--last", "4", "5", "3"}}},
        {"delete", {{"--roi", "1:5,:,:", "--value", "1000"}}},
        {"fill-holes", {{}, {"--value", "300"}}},
        {"flip", {{"x"}, {"z", "--roi", ":,:,1:6"}}},
        {"flip-range", {{"--axis", "y", "--first", "1", "1", "1", "--last", "4", "5", "3"}}},
        {"filter gaussian", {{"--sigma", "1.5"}, {"--sigma", "4", "--boundary", "border:9000"}, {"--sigma", "5"}}},
        {"histogram", {{"--bins", "9"}, {"--range", "10:60"}, {"--range", "p5:p90"}}},
        {"info", {{}}},
        {"filter kernel", {{kernel_file(), "--dtype", "uint8"}}},
        {"label", {{}, {"--by-value", "--connectivity", "26", "--min-size", "2"}}},
        {"make checkerboard", {{"--dims", "9", "8", "7"}}},
        {"make constant", {{"--dims", "9", "8", "7", "--value", "5"}}},
        {"make marschner-lobb", {{"--dims", "9", "8", "7"}}},
        {"make noise", {{"--dims", "9", "8", "7"}}},
        {"make ramp", {{"--dims", "9", "8", "7"}}},
        {"make sphere", {{"--dims", "9", "8", "700", "--edge", "distance", "--dtype", "int8", "--radius", "300"}}},
        {"make amr", {{"--blocks", "20", "--levels", "4"}}},
        {"filter median", {{"--radius", "1"}, {"--radius", "2,1,0"}}},
        {"mesh", {{"--iso", "50"}, {"--labels"}}},
        {"morphology", {{"open"}, {"gradient", "--shape", "box"}}},
        {"filter nlmeans", {{"--noise", "auto", "--search", "1"}, {"--strength", "20", "--search", "2"}}},
        {"pad", {{"--by", "1:2,0:3,2:2"}, {"--by", "2", "--value", "1e7"}}},
        {"copy", {{"-", "-", "--at", "0", "0", "0"}}},
        {"permute", {{"zyx"}, {"xzy"}}},
        {"project", {{"max"}, {"sum", "--axis", "y"}, {"median", "--roi", "1:9,:,:"}}},
        {"refine", {{"--tolerance", "20", "--block-size", "4"}, {"--tolerance", "30", "--dtype", "auto"}}},
        {"resample",
         {{"--scale", "0.7"},
          {"--dims", "20", "auto", "11", "--method", "cubic", "--dtype", "uint8"},
          {"--scale", "1.5", "--tolerance", "40"},
          {"--roi", "0.5:8,1:7.5,:", "--scale", "2"},
          {"--dtype", "int8"}}},
        {"rotate",
         {{"--angle", "30"}, {"--angle", "20", "--tolerance", "40"}, {"--angle", "9", "--method", "bspline3"}}},
        {"scale", {{"--factor", "0.7"}, {"--factor", "1.3", "--roi", "1:9,:,:"}}},
        {"filter log", {{"--sigma", "1", "--dtype", "uint8"}}},
        {"filter dog", {{"--sigma", "1", "--dtype", "uint8"}}},
        {"filter sharpen", {{"--sigma", "1", "--amount", "9"}}},
        {"scan", {{}, {"--exclusive"}}},
        {"set", {{"--slope", "2"}, {"--units", "HU"}}},
        {"declare-sv", {{"--dims", "9", "8", "7"}}},
        {"slice", {{"--z", "3"}, {"--x", "-2", "--range", "p5:p90"}}},
        {"stats", {{}, {"--percentiles", "5,50"}, {"--per", "y"}}},
        {"threshold", {{"--otsu"}, {"--above", "40", "--roi", "1:9,:,:"}}},
        {"transform", {{"v * 9 - x"}, {"v[1,0,0] / (v - 50)"}, {"sqrt(40 - v)", "--dtype", "uint8"}}},
        {"watershed", {{"--depth", "20"}, {"--on", "distance"}}},
    };
    return all;
}

struct Request {
    std::string name;
    Words words;
    std::string text() const { return vkt::text(name, " ", join(words, " ")); }
    std::unique_ptr<Operation> made() const {
        auto operation = make_operation(name);
        Parameters parameters;
        operation->parameters(parameters);
        read_words(words, {&parameters});
        operation->check();
        return operation;
    }
};

std::vector<Request> all_requests() {
    std::vector<Request> result;
    for (RegisteredOperation const& one : operations()) {
        auto const found = requests().find(std::string(one.name));
        EXPECT_NE(found, requests().end()) << one.name << " is asked for nothing here";
        if (found == requests().end()) continue;
        for (Words const& words : found->second) result.push_back({found->first, words});
    }
    return result;
}

/// Some values that are no numbers, beyond other types, and equal.
Volume volume_of(Index3 dims, DataType type, unsigned seed) {
    Volume volume = noise_volume(dims, type, seed);
    with_type(type, [&]<class T>(T) {
        T* const values = reinterpret_cast<T*>(volume.mutable_view().data);
        std::int64_t const n = volume.header().voxels();
        for (std::int64_t i = 0; i < n; i += 5) values[i] = T{};
        if constexpr (std::is_integral_v<T> && std::is_signed_v<T>) values[n / 4] = std::numeric_limits<T>::lowest();
        if constexpr (std::is_same_v<T, float>) {
            values[n / 3] = std::numeric_limits<float>::quiet_NaN();
            values[n / 2] = 1e6F;
        }
    });
    return volume;
}

Volume tree_of(std::string const& field) {
    return vkt::apply({"make", "amr", "--blocks", "30", "--levels", "3", "--block-size", "4", "--field", field}, {});
}

/// Calls ask() before every look at the volume.
class Asking : public SourceDecorator {
public:
    Asking(std::unique_ptr<Source> source, std::function<void()> ask)
        : SourceDecorator(std::move(source)), ask_(std::move(ask)) {}
    void read(AnyView out) override {
        ask_();
        inner().read(out);
    }
    std::optional<ConstView> borrow(Box const& region) override {
        ask_();
        return inner().borrow(region);
    }
    BrickSequence take_bricks() override {
        ask_();
        return inner().take_bricks();
    }

private:
    std::function<void()> ask_;
};

/// All that comes out of an operation.
struct Outcome {
    std::string header, voxels, said;
    std::int64_t counted = 0; ///< in all of its counters
    friend bool operator==(Outcome const&, Outcome const&) = default;
};

std::string bytes_of(Volume const& volume) {
    std::string bytes(reinterpret_cast<char const*>(volume.buffer().read(Space::host)), volume.header().bytes());
    for (std::size_t i = 0; i < volume.bricks().size(); ++i)
        bytes += text(volume.bricks()[i].lower, volume.bricks()[i].level);
    return bytes;
}

/// `ask` is called at every turn: when the volume has begun, before its input is looked at, between slabs of the
/// result.
Outcome outcome_of(Operation& operation, std::vector<Volume> const& volumes, std::function<void()> const& ask) {
    Outcome outcome;
    Execution execution = default_execution();
    execution.threads = 2;
    execution.slab = 3;
    std::vector<std::unique_ptr<Source>> inputs;
    inputs.reserve(volumes.size());
    for (Volume const& volume : volumes) inputs.push_back(std::make_unique<Asking>(volume_source({volume}), ask));
    StageInfo info;
    info.on_plan = [&](Plan const&, std::vector<Header> const&) { ask(); };
    info.listener = [&](std::string const&, std::string const& message, bool) { outcome.said += message + "\n"; };
    if (operation.shape() == Shape::reduction) {
        Measurement of{inputs,
                       execution,
                       info,
                       operation.prints(ReportForm::json) ? ReportForm::json : ReportForm::text,
                       [&](Report const& report) { outcome.said += report.json() + "\n"; },
                       [&](std::string_view words) { outcome.said += words; }};
        operation.measure(of);
        outcome.said += operation.satisfied() ? "" : "not satisfied\n";
        return outcome;
    }
    info.on_report = [&](Report const& report) { outcome.said += report.json() + "\n"; };
    auto const source = attach(std::move(inputs), operation, execution, info);
    EXPECT_TRUE(source->next_volume());
    ask();
    Volume made;
    if (source->header().kind == Kind::hierarchical) {
        made = source->take_bricks().whole();
    } else {
        made = Volume(source->header());
        Box const box = box_of(made.header().dims);
        source->expect(box);
        for (std::int64_t z = 0; z < box.upper.z; z += 2) {
            ask();
            source->read(made.mutable_view().part(intersect(box, {{0, 0, z}, {box.upper.x, box.upper.y, z + 2}})));
        }
    }
    for (std::int64_t const* const counter : operation.counters()) outcome.counted += *counter;
    source->finish();
    outcome.header = to_json(made.header());
    outcome.voxels = bytes_of(made);
    return outcome;
}

std::vector<Header> headers_of(std::vector<Volume> const& volumes) {
    std::vector<Header> headers;
    headers.reserve(volumes.size());
    for (Volume const& volume : volumes) headers.push_back(volume.header());
    return headers;
}

/// What is worked on, and others of the same kind.
struct Inputs {
    std::vector<Volume> volumes, others;
};

std::vector<Inputs> inputs_for(Operation const& operation, bool trees) {
    auto const n = static_cast<std::size_t>(operation.inputs());
    if (n == 0) return trees ? std::vector<Inputs>{} : std::vector<Inputs>{{}};
    auto const several = [&](Volume const& volume) { return std::vector<Volume>(n, volume); };
    if (trees) {
        static Volume const disk = tree_of("disk");
        static Volume const other = vkt::apply(
            {"make", "amr", "--blocks", "12", "--levels", "2", "--block-size", "6", "--dtype", "float64"}, {});
        return {{several(disk), several(other)}};
    }
    Volume const bytes = volume_of({14, 11, 8}, DataType::uint8, 1),
                 floats = volume_of({14, 11, 8}, DataType::float32, 2);
    Volume wide = volume_of({19, 9, 7}, DataType::int32, 3);
    wide.header().values = {-0.5, 3};
    wide.header().geometry.spacing = {2, 1, 0.7};
    std::vector<Inputs> all{
        {several(bytes), several(wide)}, {several(floats), several(wide)}, {several(wide), several(floats)}};
    if (n == 2) all.push_back({{floats, bytes}, {wide, wide}});
    return all;
}

/// Calls visit(request, inputs) for all that an operation takes: what it refuses is passed over.
template <class Visit> void for_each_case(Visit const& visit) {
    std::map<std::string, int> cases;
    for (Request const& request : all_requests())
        for (bool const trees : {false, true})
            for (Inputs const& inputs : inputs_for(*request.made(), trees)) {
                Outcome expected;
                try {
                    expected = outcome_of(*request.made(), inputs.volumes, [] {});
                } catch (Error const& error) {
                    if (error.kind() != ErrorKind::usage && error.kind() != ErrorKind::data) throw;
                    continue;
                }
                ++cases[request.name];
                visit(request, inputs, expected);
            }
    for (RegisteredOperation const& one : operations())
        EXPECT_GT(cases[std::string(one.name)], 0) << one.name << " was refused whatever it was asked";
}

std::string summary(Outcome const& outcome) {
    return text(outcome.header, "\n", static_cast<std::uint64_t>(std::hash<std::string>{}(outcome.voxels)), "\n",
                outcome.said, outcome.counted, " counted");
}

TEST(Contract, PlansOfOtherVolumesChangeNothing) {
    for_each_case([](Request const& request, Inputs const& inputs, Outcome const& expected) {
        auto const operation = request.made();
        std::vector<Header> const own = headers_of(inputs.volumes), others = headers_of(inputs.others);
        auto const planned = [&](std::vector<Header> const& headers) -> std::string {
            try {
                Plan const plan = std::as_const(*operation).plan(headers);
                return text(to_json(plan.output), plan.method, plan.cost, " ", plan.error.range, " ",
                            plan.error.magnitude, " ", plan.error.absolute, " ",
                            static_cast<std::uint64_t>(plan.state_bytes), " ", plan.slab_hint);
            } catch (Error const& error) {
                return error.what(); // some are no volumes for it
            }
        };
        std::string const before = planned(own), of_others = planned(others);
        Outcome const outcome = outcome_of(*operation, inputs.volumes, [&] {
            EXPECT_EQ(planned(others), of_others) << request.text();
            EXPECT_EQ(planned(own), before) << request.text();
            planned(others);
        });
        EXPECT_TRUE(outcome == expected) << request.text() << "\n"
                                         << summary(outcome) << "\n  instead of\n"
                                         << summary(expected);
        EXPECT_EQ(planned(own), before) << request.text();
    });
}

TEST(Contract, VolumesBeginAnew) {
    std::map<std::string, std::int64_t> counted;
    std::map<std::string, bool> counts;
    for_each_case([&](Request const& request, Inputs const& inputs, Outcome const& expected) {
        auto const operation = request.made();
        for (char const* const what : {"first", "again", "after another"}) {
            Outcome const outcome = outcome_of(*operation, inputs.volumes, [] {});
            EXPECT_TRUE(outcome == expected) << request.text() << ", " << what << "\n"
                                             << summary(outcome) << "\n  instead of\n"
                                             << summary(expected);
            if (std::string_view(what) != "again") continue;
            try {
                (void)outcome_of(*operation, inputs.others, [] {});
            } catch (Error const&) { // the other is no volume for it, which does not matter either
            }
        }
        counts[request.name] = counts[request.name] || !operation->counters().empty();
        counted[request.name] += expected.counted;
    });
    // A counter that stays 0 would hide that it is not reset. These choose or average values and keep their type, so
    // that none is lost.
    for (char const* const name : {"filter bilateral", "filter box", "filter median", "filter nlmeans"})
        counts[name] = false;
    for (auto const& [name, has] : counts)
        EXPECT_TRUE(!has || counted[name] > 0) << name << " counted nothing here: ask it for something that it counts";
}

TEST(Contract, AliasesNameOperations) {
    for (OperationAlias const& alias : operation_aliases()) {
        EXPECT_EQ(make_operation(alias.name)->name(), alias.operation);
        EXPECT_EQ(operation_name(alias.name), alias.operation);
        EXPECT_TRUE(std::ranges::none_of(operations(), [&](auto const& one) { return one.name == alias.name; }));
    }
    EXPECT_EQ(operation_name("flip"), "flip");
    try {
        (void)make_operation("reorent");
        FAIL() << "taken";
    } catch (Error const& e) {
        EXPECT_NE(e.hint().find("'reorient'"), std::string::npos) << e.hint();
    }
}

} // namespace
