// The window on the volumes of an input: draws, saves, goes on to the next.
// SPDX-License-Identifier: MIT
#include "shell/viewer/scene_of_input.h"

#include "shell/picture/pictures.h"
#include "shell/viewer/arriving.h"
#include "shell/viewer/viewer.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

namespace vkt::shell::viewer {

namespace {

/// Puts a step that reads the file in the place of those that made it.
void read_instead(History& step, History const& made, std::string const& file) {
    if (step == made) {
        step = {};
        step.command = {"read", file};
        return;
    }
    for (History& input : step.inputs) read_instead(input, made, file);
}

/// What the window asks for of the volumes of an input.
class InputScene : public Scene {
public:
    InputScene(Source& source, Context& context, render::RenderSettings asked, render::Background background)
        : context_(context), asked_(std::move(asked)), background_(background),
          opened_(source, context, asked_.tree,
                  [this](Header const& header) { return render::bytes_of_picture(asked_, header, {}); }),
          volumes_(source, context.execution(), asked_.tree, [this] { return opened_.open(); }) {}

    std::string name() const override {
        std::string const volume = most_ < 2    ? ""
                                   : count_ > 0 ? text(", volume ", shown_, " of ", count_)
                                                : text(", volume ", shown_);
        return text(input(), " (", volumes_.header().dims, ")", volume);
    }
    render::Image draw(render::RenderSettings const& settings, render::RenderReport& report,
                       std::stop_token const& stop, render::Accumulation* accumulation) override {
        auto const renderer = volumes_.renderer();
        render::RenderSettings s = settings;
        if (renderer == nullptr) { // nothing has come yet
            render::Image image{s.width, s.height, {}};
            for (int i = 0; i < s.width * s.height; ++i) image.pixels.insert(image.pixels.end(), {0, 0, 0, 1});
            return image;
        }
        if (volumes_.partial()) {
            // The place of the whole, so that what comes does not move what is there.
            Header const& header = volumes_.header();
            render::Camera const camera =
                render::make_camera(s.camera, render::corners_of(header.geometry, box_of(header.dims)),
                                    static_cast<double>(s.width) / s.height);
            View view = initial_view(s);
            view.camera = camera;
            s = settings_of(s, view);
            s.clip = {};
        }
        // Of a series the first one that was whole decides, so that the others can be compared with it.
        if (!chosen_from_ && !volumes_.partial() && !volumes_.magnified())
            chosen_from_ = std::make_shared<render::Histogram const>(renderer->histogram());
        // A part of it is a volume of its own, as in the command that makes it.
        if (!volumes_.magnified()) s.chosen_from = chosen_from_;
        return renderer->render(s, &report, stop, accumulation);
    }
    std::string save(render::Image const& image, render::RenderReport const& report, View const& view) override {
        std::string path = free_picture_name(input());
        write_picture(path, false, {image, report, background_, {}, {}}, volumes_.header(), stage_of(view), context_);
        return path;
    }
    std::string command(View const& view) override {
        StageInfo stage = stage_of(view);
        if (stage.words.empty()) return "with --no-history there is no command line";
        Header header = volumes_.header();
        std::optional<History> const& made = volumes_.whole_header().history;
        if (names_what_is_open() && made) { // what once made the file is not what is shown
            if (header.history == made)
                header.history.reset();
            else if (header.history) // a part of it
                read_instead(*header.history, *made, input_name());
        }
        return text(history_as_shell(folded(history_step(stage, {header}))), " -o ", output_word(input(), several()));
    }
    bool next() override {
        volumes_.settle();
        if (keep_failure()) return false; // nobody knows what is behind it
        try {
            bool const more = volumes_.next();
            if (more) most_ = std::max(most_, ++shown_);
            if (!more) count_ = shown_;
            return more;
        } catch (std::exception const&) {
            if (most_ == 0) throw;
            failure_ = std::current_exception();
            throw Error(ErrorKind::data, "the next volume cannot be read");
        }
    }
    bool first_again() override { return most_ > 1 && back_to(0); }
    bool previous() override {
        if (shown_ < 2) return false;
        volumes_.settle();
        keep_failure();
        return back_to(shown_ - 2);
    }
    Arrival arrive() override { return volumes_.arrive(); }
    std::shared_ptr<render::Renderer const> volume() override {
        return volumes_.partial() ? nullptr : volumes_.renderer();
    }
    void magnify(Box const& part) override { volumes_.magnify(part, context_.stage_info()); }
    /// The first volume that ended early, of those that were shown nevertheless, is what the command ends with.
    void rethrow_failure() {
        keep_failure();
        if (failure_) std::rethrow_exception(failure_);
    }

private:
    /// Whether the volume that is shown ended early.
    bool keep_failure() {
        std::exception_ptr const failure = volumes_.ended_early();
        if (!failure_) failure_ = failure;
        return failure != nullptr;
    }
    std::string input_name() const { return context_.stage_info().input_names.front(); }
    std::string input() const {
        std::string const name = input_name();
        return name == "-" ? "volume" : name.substr(name.rfind('/') + 1);
    }
    /// Whether the input has a name by which it can be had once more: a pipe has none, but the steps that led to it.
    bool names_what_is_open() const {
        std::string const name = input_name();
        std::error_code unknown;
        return name != "-" && !std::filesystem::is_fifo(name, unknown);
    }
    /// Whether the command is one of several volumes, as far as that can be known without waiting for a pipe.
    bool several() {
        bool const piped = context_.stage_info().input_names.front() == "-";
        return most_ > 1 || (!piped && !volumes_.partial() && opened_.another());
    }
    bool back_to(std::int64_t volume) {
        if (!opened_.rewind_to(volume) || !volumes_.next()) return false;
        shown_ = volume + 1;
        return true;
    }
    StageInfo stage_of(View const& view) const {
        StageInfo stage = context_.stage_info();
        stage.words = words_of(stage.words, asked_, view);
        if (!stage.words.empty()) stage.words.front() = "render"; // vkt view shows what vkt render draws
        return stage;
    }

    Context& context_;
    render::RenderSettings asked_;
    render::Background background_;
    Volumes opened_;
    ArrivingVolumes volumes_;
    std::exception_ptr failure_;
    std::shared_ptr<render::Histogram const> chosen_from_; ///< what colours and the like are chosen from
    std::int64_t shown_ = 0, most_ = 0; ///< number of the volume that is shown, from 1, and the highest so far
    std::int64_t count_ = 0;            ///< of all of them, once it is known
};

} // namespace

void show_input(Source& source, Context& context, render::RenderSettings const& asked,
                render::Background const& background) {
    InputScene scene(source, context, asked, background);
    if (!scene.next()) return;
    show(scene, asked, background, [&](std::string const& line) { context.note(line); });
    scene.rethrow_failure();
}

} // namespace vkt::shell::viewer
