// The painter of the viewer: its thread, what it draws, keeps, saves and says.
// SPDX-License-Identifier: MIT
#include "shell/viewer/interaction.h"
#include "shell/viewer/painter.h"

#include "libvkt/core/text.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

namespace vkt::shell::viewer {
namespace {

using render::RenderSettings;

/// Draws nothing, and takes as long as the pixels ask for.
class SlowScene : public Scene {
public:
    std::string name() const override { return "scene"; }
    render::Image draw(RenderSettings const& s, render::RenderReport& report, std::stop_token const& stop,
                       render::Accumulation*) override {
        auto const until = std::chrono::steady_clock::now() + std::chrono::microseconds(s.width * s.height / 50);
        while (std::chrono::steady_clock::now() < until && !stop.stop_requested())
            std::this_thread::sleep_for(std::chrono::microseconds(200));
        if (stop.stop_requested()) ++stopped;
        report.camera.fov = s.camera.fov;
        render::Image image{s.width, s.height, {}};
        image.pixels.resize(4 * static_cast<std::size_t>(s.width) * static_cast<std::size_t>(s.height));
        return image;
    }
    std::string save(render::Image const& image, render::RenderReport const&, View const& view) override {
        if (fails) throw Error(ErrorKind::io, "the disk is full");
        EXPECT_EQ(image.width, view.width);
        ++saved;
        return "a.png";
    }
    bool next() override { return false; }
    std::atomic<int> stopped{0}, saved{0};
    std::atomic<bool> fails{false};
};

/// The last frame that comes within a minute, which sanitizers on a busy machine may need, once `done` says so.
template <class Done> Frame wait_for(Painter& painter, Done done) {
    for (int i = 0; i < 60000; ++i) {
        if (auto frame = painter.take(); frame && done(*frame)) return *frame;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ADD_FAILURE() << "no such frame came";
    return {};
}

TEST(Painting, coarseFirstThenFull) {
    SlowScene scene;
    RenderSettings const asked;
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    Frame const first = wait_for(painter, [](Frame const&) { return true; });
    EXPECT_LT(first.width, 512);
    Frame const full = wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    EXPECT_EQ(full.width, 512);
    EXPECT_EQ(full.rgb.size(), std::size_t{3 * 512 * 512});
}

TEST(Painting, movingGivesUpRefinementOnly) {
    SlowScene scene;
    RenderSettings asked;
    asked.width = 4096, asked.height = 4096; // 0.34 s
    Painter painter(
        scene, asked, {}, [] {}, 0.005);
    wait_for(painter, [](Frame const&) { return true; });
    View view = initial_view(asked);
    int frames = 0;
    // Frames keep coming while the view moves without a pause; how fast is the machine's business.
    for (int i = 0; i < 4000 && frames <= 10; ++i) {
        view.camera = orbit(render::Camera{}, {0.01 * i, 0});
        painter.show(view);
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        if (painter.take()) ++frames;
    }
    EXPECT_GT(frames, 10);
    Frame const last = wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    EXPECT_EQ(last.view.camera->eye, view.camera->eye);
    EXPECT_EQ(last.width, 4096);
}

TEST(Painting, whatWasAskedToBeSavedIsSaved) {
    SlowScene scene;
    RenderSettings const asked;
    {
        Painter painter(
            scene, asked, {}, [] {}, 0.03);
        painter.save();
        painter.save();
    }
    EXPECT_EQ(scene.saved, 2);
    scene.fails = true;
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    painter.save();
    painter.finish();
    EXPECT_EQ(painter.take_message(), "the disk is full");
    EXPECT_FALSE(painter.saving());
}

/// Three volumes; drawing and loading wait for leave. Notes of which volume a saved picture is, and what its file says.
class SteppedScene : public SlowScene {
public:
    render::Image draw(RenderSettings const& s, render::RenderReport& report, std::stop_token const& stop,
                       render::Accumulation*) override {
        drawing = true;
        await(may_draw);
        if (until_given_up.exchange(false))
            for (int i = 0; i < 20000 && !stop.stop_requested(); ++i)
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
        report.unit = volume;
        return {s.width, s.height, std::vector<float>(static_cast<std::size_t>(4 * s.width * s.height))};
    }
    std::string save(render::Image const&, render::RenderReport const& report, View const&) override {
        return text("picture of ", report.unit, " as ", static_cast<int>(volume));
    }
    bool next() override {
        loading = true;
        await(may_load);
        if (volume == 2) return false;
        ++volume;
        return true;
    }
    static void await(std::atomic<bool> const& leave) {
        for (int i = 0; i < 20000 && !leave; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    std::atomic<int> volume{0};
    std::atomic<bool> drawing{false}, loading{false}, may_draw{true}, may_load{true}, until_given_up{false};
};

std::vector<std::string> messages(Painter& painter) {
    std::vector<std::string> all;
    while (auto const message = painter.take_message()) all.push_back(*message);
    return all;
}

TEST(Painting, whatIsSavedWhileAVolumeLoadsIsThatVolume) {
    SteppedScene scene;
    RenderSettings const asked;
    scene.may_load = false;
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    painter.go_on(Turn::next);
    SteppedScene::await(scene.loading);
    painter.save();
    scene.may_load = true;
    painter.finish();
    EXPECT_EQ(messages(painter), std::vector<std::string>{"saved picture of 1 as 1"});
}

TEST(Painting, keysTakeEffectInTheirOrder) {
    SteppedScene scene;
    RenderSettings const asked;
    scene.until_given_up = true; // the first picture takes until the window closes
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    SteppedScene::await(scene.drawing); // and meanwhile, all of these
    painter.save();
    painter.go_on(Turn::next);
    painter.save();
    painter.go_on(Turn::next);
    painter.go_on(Turn::next); // hit again before it had any effect
    painter.save();
    painter.go_on(Turn::next); // the last one: given up, because the window closes
    painter.finish();
    EXPECT_EQ(messages(painter), (std::vector<std::string>{"saved picture of 0 as 0", "saved picture of 1 as 1",
                                                           "saved picture of 2 as 2"}));
    EXPECT_FALSE(painter.saving());
}

TEST(Painting, theLastVolumeStays) {
    SteppedScene scene;
    RenderSettings const asked;
    scene.volume = 2;
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    painter.go_on(Turn::next);
    painter.save();
    painter.finish();
    EXPECT_EQ(messages(painter), (std::vector<std::string>{"this is the last volume", "saved picture of 2 as 2"}));
}

/// Draws a real volume; counts the paths of each pass.
class RealScene : public SlowScene {
public:
    explicit RealScene(Volume const& volume) : renderer_(std::make_shared<render::Renderer>(volume, Execution{})) {}
    render::Image draw(RenderSettings const& s, render::RenderReport& report, std::stop_token const& stop,
                       render::Accumulation* accumulation) override {
        if (accumulation != nullptr) passes.push_back(s.samples);
        return renderer_->render(s, &report, stop, accumulation);
    }
    std::string save(render::Image const& image, render::RenderReport const&, View const&) override {
        kept = image;
        return "kept.png";
    }
    std::shared_ptr<render::Renderer const> volume() override { return renderer_; }
    std::vector<int> passes;
    render::Image kept;

private:
    std::shared_ptr<render::Renderer> renderer_;
};

TEST(Painting, pathsAddUpToThePictureOfOnePass) {
    Volume const volume = render::testing::blobs({20, 16, 24}, DataType::uint8);
    RenderSettings asked;
    asked.algorithm = render::Algorithm::multi_scattering;
    asked.width = asked.height = 160, asked.samples = 24;
    RealScene scene(volume);
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    Frame const first = wait_for(painter, [](Frame const&) { return true; });
    EXPECT_LT(first.effort, 1);
    Frame const full = wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    EXPECT_EQ(full.paths, 24);
    painter.save();
    painter.finish();
    // Nothing was drawn anew, and bit for bit it is what one pass gives.
    int sum = 0;
    for (int const n : scene.passes) sum += n;
    EXPECT_EQ(sum, 24);
    EXPECT_GT(scene.passes.size(), std::size_t{1});
    EXPECT_EQ(scene.kept.pixels, render::testing::render_one(volume, asked).image.pixels);
}

/// Draws nothing, in no time, and keeps what was asked for.
class QuickScene : public Scene {
public:
    std::string name() const override { return "scene"; }
    render::Image draw(RenderSettings const& s, render::RenderReport&, std::stop_token const&,
                       render::Accumulation* accumulation) override {
        if (accumulation == nullptr) first.push_back(s); // not one of the passes that add up
        if (accumulation != nullptr) accumulation->samples += s.samples;
        render::Image image{s.width, s.height, {}};
        image.pixels.resize(4 * static_cast<std::size_t>(s.width) * static_cast<std::size_t>(s.height));
        return image;
    }
    std::string save(render::Image const&, render::RenderReport const&, View const&) override { return "a.png"; }
    bool next() override { return false; }
    std::vector<RenderSettings> first; ///< read once the painter has finished
};

TEST(Painting, paintersOfQuickPicturesDoNotBeginWithManyPaths) {
    QuickScene scene;
    RenderSettings asked;
    asked.samples = 256;
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    View view = initial_view(asked);
    wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    // Some movement, until frames have all rays.
    for (int i = 0; i < 8; ++i) {
        view.camera = orbit(render::Camera{}, {0.01 * i, 0});
        painter.show(view);
        wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    }
    view.look.algorithm = render::Algorithm::multi_scattering;
    painter.show(view);
    wait_for(painter, [](Frame const& f) { return f.effort == 1 && f.paths == 256; });
    painter.finish();
    RenderSettings const& paths = scene.first.back();
    EXPECT_EQ(paths.algorithm, render::Algorithm::multi_scattering);
    EXPECT_EQ(paths.samples, 1);
}

TEST(Painting, whatAVolumeCannotBeDrawnWithLeavesThePicture) {
    Volume const volume = render::testing::volume_of({6, 6, 6}, {1, 1, 1}, [](double x, double, double) {
        return x / 4; // no labels
    });
    RenderSettings asked;
    asked.width = asked.height = 16;
    RealScene scene(volume);
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    View view = wait_for(painter, [](Frame const& f) { return f.effort == 1; }).view;
    draw_labels(view.look, render::LabelMode::always);
    painter.show(view);
    std::optional<std::string> said;
    for (int i = 0; i < 60000 && !said; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        said = painter.take_message();
    }
    ASSERT_TRUE(said);
    EXPECT_NE(said->find("whole numbers"), std::string::npos) << *said;
    view.look.labels = render::LabelMode::never;
    painter.show(view);
    EXPECT_EQ(wait_for(painter, [](Frame const& f) { return f.effort == 1; }).report.labels, nullptr);
    painter.finish();
}

/// Half of its slices are there at first.
class ArrivingScene : public SteppedScene {
public:
    Arrival arrive() override {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        if (all) return {8, 8, true};
        return {4, 8, false};
    }
    std::atomic<bool> all{false};
};

TEST(Painting, whatArrivesIsShownAndSavedWhenItIsWhole) {
    ArrivingScene scene;
    RenderSettings const asked;
    Painter painter(
        scene, asked, {}, [] {}, 0.03);
    Frame const part = wait_for(painter, [](Frame const&) { return true; });
    EXPECT_EQ(part.arrival.slices, 4);
    EXPECT_FALSE(part.arrival.complete);
    painter.save();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(painter.take_message(), std::nullopt);
    scene.all = true;
    Frame const whole = wait_for(painter, [](Frame const& f) { return f.arrival.complete && f.effort == 1; });
    EXPECT_EQ(whole.width, 512);
    painter.finish();
    EXPECT_EQ(messages(painter), std::vector<std::string>{"saved picture of 0 as 0"});
}

/// Half of its slices came, and no more will.
class BrokenScene : public SteppedScene {
public:
    Arrival arrive() override { return {4, 8, true, "it ended early"}; }
};

TEST(Painting, whatCameOfAVolumeThatEndsEarlyIsShownAndNotSaved) {
    BrokenScene scene;
    Painter painter(
        scene, {}, {}, [] {}, 0.03);
    Frame const part = wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    EXPECT_EQ(part.arrival.failure, "it ended early");
    EXPECT_TRUE(part.arrival.complete);
    painter.save();
    painter.finish();
    EXPECT_EQ(messages(painter), std::vector<std::string>{"nothing is saved: the volume is not whole"});
}

/// Its first volume is followed by one that cannot be read.
class LastReadableScene : public SteppedScene {
public:
    bool next() override { throw Error(ErrorKind::data, "it cannot be read"); }
};

TEST(Painting, aVolumeThatCannotBeReadLeavesTheOneBefore) {
    LastReadableScene scene;
    Painter painter(
        scene, {}, {}, [] {}, 0.03);
    wait_for(painter, [](Frame const& f) { return f.effort == 1; });
    painter.go_on(Turn::next);
    View other = initial_view({});
    other.width = 40, other.height = 30;
    painter.show(other);
    Frame const after = wait_for(painter, [](Frame const& f) { return f.width == 40 && f.effort == 1; });
    EXPECT_EQ(after.turn, 0);
    EXPECT_EQ(messages(painter), std::vector<std::string>{"it cannot be read"});
}

} // namespace
} // namespace vkt::shell::viewer
