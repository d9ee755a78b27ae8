// Pipelines of several shares make the bytes, the headers and the remarks of one.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/divided.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"

#include <cstring>
#include <gtest/gtest.h>
#include <random>
#include <thread>

using namespace vkt;

namespace {

Volume volume_of(DataType type, Index3 dims) {
    Header header;
    header.dims = dims;
    header.dtype = type;
    Volume volume(header);
    std::mt19937 random(7);
    std::uniform_real_distribution<float> values(-400, 700);
    AnyView const view = volume.mutable_view();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x) {
                auto const value = values(random);
                if (type == DataType::float32)
                    std::memcpy(view.at(x, y, z), &value, sizeof value);
                else
                    *view.at(x, y, z) = static_cast<std::byte>(static_cast<int>(value) & 255);
            }
    return volume;
}

/// What a pipeline does, as one share.
struct Line {
    explicit Line(std::vector<std::vector<std::string>> const& stages) {
        for (auto const& words : stages) {
            operations.push_back(make_operation(words.front()));
            EXPECT_NE(operations.back(), nullptr) << words.front();
            Parameters parameters;
            operations.back()->parameters(parameters);
            read_words({words.begin() + 1, words.end()}, {&parameters});
            operations.back()->check();
        }
    }
    Share attached(std::unique_ptr<Source> source, Execution const& execution, std::vector<std::string>* remarks) {
        Share share;
        for (auto& operation : operations) {
            StageInfo info;
            info.name = std::string(operation->name());
            if (remarks != nullptr)
                info.listener = [remarks](std::string const& stage, std::string const& message, bool) {
                    remarks->push_back(stage + ": " + message);
                };
            std::vector<std::unique_ptr<Source>> inputs;
            inputs.push_back(std::move(source));
            source = attach(std::move(inputs), *operation, execution, info);
            share.operations.push_back(operation.get());
        }
        share.source = std::move(source);
        return share;
    }
    std::vector<std::unique_ptr<Operation>> operations;
};

struct Result {
    Volume volume;
    std::vector<std::string> remarks;
};

Execution small() {
    Execution execution;
    execution.threads = 2;
    execution.memory = std::size_t{1} << 22;
    return execution;
}

/// A source that cannot be read again, as a pipe.
class Once : public SourceDecorator {
public:
    using SourceDecorator::SourceDecorator;
    Access access() const override { return Access::forward; }
    std::optional<ConstView> borrow(Box const&) override { return std::nullopt; }
    std::optional<Volume> take_whole() override { return std::nullopt; }
};

Result alone(std::vector<std::vector<std::string>> const& stages, Volume const& input) {
    Result result;
    Line line(stages);
    Share share = line.attached(volume_source({input}), small(), &result.remarks);
    EXPECT_TRUE(share.source->next_volume());
    result.volume = load(*share.source, small());
    return result;
}

Result together(std::vector<std::vector<std::string>> const& stages, Volume const& input, int count, bool once) {
    Result result;
    std::deque<Line> lines;
    std::vector<Share> shares;
    Execution const execution = share_of(small(), count);
    SharedInput* shared = nullptr;
    std::unique_ptr<SharedInput> held;
    if (once) {
        held = std::make_unique<SharedInput>(std::make_unique<Once>(volume_source({input})), small());
        shared = held.get();
    }
    for (int i = 0; i < count; ++i) {
        auto source = shared != nullptr ? shared->reader() : volume_source({input});
        shares.push_back(
            lines.emplace_back(stages).attached(std::move(source), execution, i == 0 ? &result.remarks : nullptr));
    }
    held.reset();
    auto const source = divided(std::move(shares), small());
    EXPECT_TRUE(source->next_volume());
    result.volume = load(*source, small());
    EXPECT_FALSE(source->next_volume());
    return result;
}

void expect_equal(Result const& one, Result const& other, std::string const& what) {
    ASSERT_EQ(one.volume.header().dims, other.volume.header().dims) << what;
    ASSERT_EQ(one.volume.header().dtype, other.volume.header().dtype) << what;
    EXPECT_EQ(std::memcmp(one.volume.view().at(0, 0, 0), other.volume.view().at(0, 0, 0), one.volume.header().bytes()),
              0)
        << what;
    EXPECT_EQ(one.remarks, other.remarks) << what;
}

std::vector<std::vector<std::vector<std::string>>> pipelines() {
    return {
        {{"convert", "--dtype", "uint8"}},
        {{"convert", "--dtype", "uint8"}, {"filter median", "--radius", "1"}},
        {{"convert", "--dtype", "int8"}, {"filter gaussian", "--sigma", "2"}, {"convert", "--dtype", "uint8"}},
        {{"filter gaussian", "--sigma", "1"}, {"resample", "--scale", "0.5"}, {"convert", "--dtype", "uint8"}},
        {{"crop", "--roi", "2:20,:,3:40"}, {"convert", "--dtype", "uint8"}, {"filter box", "--radius", "2"}},
        {{"convert", "--dtype", "uint8"}, {"resample", "--dims", "17,19,61", "--method", "cubic"}},
        {{"convert", "--dtype", "uint8"}, {"crop", "--roi", ":,:,11:35"}},
        {{"rotate", "--axis", "z", "--angle", "20"}},
        // These cannot be divided, or only their last stages could.
        {{"convert", "--dtype", "uint8"}, {"flip", "z"}},
        {{"scan"}},
        {{"convert", "--dtype", "uint8"}, {"filter box", "--radius", "2", "--boundary", "wrap"}},
        {{"convert", "--dtype", "uint8"}, {"label"}},
        {{"convert", "--dtype", "uint8"}, {"rotate", "--axis", "x", "--angle", "20"}},
    };
}

} // namespace

TEST(Divided, MakesWhatOneShareMakes) {
    for (Index3 const dims : {Index3{23, 17, 48}, Index3{9, 8, 5}, Index3{31, 30, 1}})
        for (auto const& stages : pipelines()) {
            if (dims.z < 48 && stages.front().front() == "crop") continue;
            if (dims.z < 48 && stages.back().front() == "crop") continue;
            Volume const input = volume_of(DataType::float32, dims);
            Result const one = alone(stages, input);
            for (int const count : {2, 3}) {
                std::string const what =
                    text(stages.front().front(), " … ", stages.back().front(), " ", dims, " by ", count);
                expect_equal(one, together(stages, input, count, false), what);
                expect_equal(one, together(stages, input, count, true), what + ", from a pipe");
            }
        }
}

TEST(Divided, KeepsWhatArrivesOnceInAFileBeyondItsMemory) {
    Volume const input = volume_of(DataType::float32, {128, 96, 48}); // 2.25 MiB, of which a quarter of 4 has no room
    for (std::size_t const i : {std::size_t{1}, std::size_t{3}})
        expect_equal(alone(pipelines()[i], input), together(pipelines()[i], input, 2, true), text(i));
}

TEST(Divided, CountsWhatIsLostOnce) {
    Volume const input = volume_of(DataType::float32, {23, 17, 48});
    Result const one = alone(pipelines()[1], input);
    ASSERT_EQ(one.remarks.size(), 1U);
    EXPECT_NE(one.remarks.front().find("clipped"), std::string::npos);
}

TEST(Divided, WorksInSeveralThreads) {
    // A share that reads on its own says on which thread: two of them are not one.
    class Seen : public SourceDecorator {
    public:
        Seen(std::unique_ptr<Source> source, std::vector<std::thread::id>& ids)
            : SourceDecorator(std::move(source)), ids_(ids) {}
        void read(AnyView out) override {
            ids_.push_back(std::this_thread::get_id());
            inner().read(out);
        }

    private:
        std::vector<std::thread::id>& ids_;
    };
    Volume const input = volume_of(DataType::uint8, {8, 8, 32});
    std::vector<std::thread::id> first, second;
    std::vector<Share> shares;
    shares.push_back({std::make_unique<Seen>(volume_source({input}), first), {}});
    shares.push_back({std::make_unique<Seen>(volume_source({input}), second), {}});
    auto const source = divided(std::move(shares), small());
    ASSERT_TRUE(source->next_volume());
    load(*source, small());
    ASSERT_FALSE(first.empty());
    ASSERT_FALSE(second.empty());
    EXPECT_NE(first.front(), second.front());
    EXPECT_EQ(first.size(), second.size());
}

TEST(Divided, TellsWhatFailsInAShare) {
    class Broken : public SourceDecorator {
    public:
        using SourceDecorator::SourceDecorator;
        void read(AnyView out) override {
            if (out.box.upper.z > 20) throw Error(ErrorKind::data, "torn");
            inner().read(out);
        }
    };
    Volume const input = volume_of(DataType::uint8, {8, 8, 32});
    std::vector<Share> shares;
    for (int i = 0; i < 2; ++i) shares.push_back({std::make_unique<Broken>(volume_source({input})), {}});
    auto const source = divided(std::move(shares), small());
    ASSERT_TRUE(source->next_volume());
    EXPECT_THROW(load(*source, small()), Error);
}

TEST(Divided, HoldsNoMoreThanHalfOfTheBudget) {
    // 64 slices of 64 KiB and 4 MiB: eight slabs of several slices would be more than half.
    class Most : public SourceDecorator {
    public:
        Most(std::unique_ptr<Source> source, std::int64_t& most) : SourceDecorator(std::move(source)), most_(most) {}
        void read(AnyView out) override {
            most_ = std::max(most_, out.box.dims().z);
            inner().read(out);
        }

    private:
        std::int64_t& most_;
    };
    Volume const input = volume_of(DataType::uint8, {256, 256, 192});
    std::int64_t first = 0, second = 0;
    std::vector<Share> shares;
    shares.push_back({std::make_unique<Most>(volume_source({input}), first), {}});
    shares.push_back({std::make_unique<Most>(volume_source({input}), second), {}});
    Execution execution = small();
    execution.memory = std::size_t{1} << 21;
    auto const source = divided(std::move(shares), execution);
    ASSERT_TRUE(source->next_volume());
    std::vector<std::byte> slice(256 * 256);
    for (std::int64_t z = 0; z < 192; ++z)
        source->read(dense_view(slice.data(), DataType::uint8, {{0, 0, z}, {256, 256, z + 1}}));
    source->finish();
    EXPECT_LE(4 * std::max(first, second) * 65536, std::int64_t{1} << 20);
}
