// The worker loop: keys in their order first, then new views, then refinement.
// SPDX-License-Identifier: MIT
#include "shell/viewer/painter.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace vkt::shell::viewer {

Painter::Painter(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
                 std::function<void()> wake, double target_seconds)
    : scene_(scene), asked_(asked), background_(background), wake_(std::move(wake)), target_(target_seconds) {
    background_.alpha = 1; // a window has nothing behind it
    wanted_ = {initial_view(asked_), 1};
    full_settings_ = asked_;
    effort_ = first_effort(asked_);
    thread_ = std::thread([this] { work(); });
}

void Painter::finish() {
    if (!thread_.joinable()) return;
    {
        std::lock_guard const lock(mutex_);
        quit_ = true;
        refinement_.request_stop();
        drawing_.request_stop();
    }
    changed_.notify_all();
    thread_.join();
}

void Painter::show(View view) {
    {
        std::lock_guard const lock(mutex_);
        wanted_ = {std::move(view), wanted_.number + 1};
        refinement_.request_stop();
    }
    changed_.notify_all();
}

void Painter::add_task(Task task) {
    {
        std::lock_guard const lock(mutex_);
        bool const again = task.kind == Task::Kind::go_on && !tasks_.empty() &&
                           tasks_.back().kind == Task::Kind::go_on && tasks_.back().turn == task.turn;
        task.request = wanted_;
        if (task.kind == Task::Kind::save) saving_ = true;
        // What is drawn now is of no use any more, or need not be waited for.
        if (task.kind != Task::Kind::save) refinement_.request_stop();
        if (!again) tasks_.push_back(std::move(task));
    }
    changed_.notify_all();
}

void Painter::save() { add_task({Task::Kind::save, {}, {}}); }
void Painter::go_on(Turn turn) { add_task({Task::Kind::go_on, {}, {}, turn}); }
void Painter::say_command() { add_task({Task::Kind::command, {}, {}}); }
void Painter::magnify(Box const& part) { add_task({Task::Kind::magnify, {}, part}); }

std::optional<Frame> Painter::take() {
    std::lock_guard const lock(mutex_);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    return std::exchange(frame_, std::nullopt);
}

std::optional<std::string> Painter::take_message() {
    std::lock_guard const lock(mutex_);
    if (messages_.empty()) return std::nullopt;
    std::string message = std::move(messages_.front());
    messages_.pop_front();
    return message;
}

bool Painter::saving() const {
    std::lock_guard const lock(mutex_);
    return saving_;
}

void Painter::work() {
    try {
        arrival_ = scene_.arrive();
        for (;;) {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] {
                return quit_ || !tasks_.empty() || wanted_.number != shown_ || shown_effort_ < 1 || !arrival_.complete;
            });
            if (quit_ && !saving_) return;
            if (!tasks_.empty()) {
                // A picture is one of the whole volume.
                if (!arrival_.complete && tasks_.front().kind == Task::Kind::save) {
                    lock.unlock();
                    arrival_ = scene_.arrive();
                    continue;
                }
                Task const task = std::move(tasks_.front());
                tasks_.pop_front();
                lock.unlock();
                do_task(task);
                continue;
            }
            Request const request = wanted_;
            refinement_ = std::stop_source();
            lock.unlock();
            bool const fresh = request.number != shown_;
            if (!fresh && !arrival_.complete) {
                Arrival const now = scene_.arrive();
                bool const more = now.slices != arrival_.slices || now.complete;
                arrival_ = now;
                if (more) show_anew();
                continue;
            }
            bool const scattering = request.view.look.algorithm == render::Algorithm::multi_scattering;
            if (!fresh && scattering)
                draw_more_paths(request);
            else
                draw_frame(request, fresh ? effort_ : refined_effort(shown_effort_, shown_seconds_));
        }
    } catch (...) {
        std::lock_guard const lock(mutex_);
        failure_ = std::current_exception();
    }
    wake_();
}

void Painter::do_task(Task const& task) {
    switch (task.kind) {
    case Task::Kind::go_on:
        open(task.turn);
        return;
    case Task::Kind::command:
        tell(scene_.command(task.request.view));
        return;
    case Task::Kind::magnify:
        // Too large a part is no reason to lose the window.
        try {
            scene_.magnify(task.part);
            show_anew();
        } catch (Error const& error) {
            tell(error.what());
        }
        return;
    case Task::Kind::save:
        save_picture(task.request);
        {
            std::lock_guard const lock(mutex_);
            saving_ =
                std::any_of(tasks_.begin(), tasks_.end(), [](Task const& t) { return t.kind == Task::Kind::save; });
        }
        wake_(); // the window stops saying that something is being saved
        return;
    }
}

Painter::Picture Painter::draw(render::RenderSettings const& settings, std::stop_token const& stop,
                               render::Accumulation* accumulation) {
    auto const start = std::chrono::steady_clock::now();
    Picture picture;
    picture.image = scene_.draw(settings, picture.report, stop, accumulation);
    picture.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return picture;
}

void Painter::draw_frame(Request const& request, double effort) {
    bool const fresh = request.number != shown_;
    std::stop_token stop = drawing_.get_token();
    if (!fresh) {
        std::lock_guard const lock(mutex_);
        stop = refinement_.get_token();
    }
    render::RenderSettings const full = settings_of(asked_, request.view);
    if (fresh) {
        // A frame of many paths is not what an algorithm that is as quick as marching has time for.
        effort = effort_ = carried_effort(effort, full_settings_, full);
        full_settings_ = full;
    }
    // Both differ from algorithm to algorithm.
    effort = std::clamp(effort, least_effort(full), fresh ? most_effort(full) : 1);
    Picture picture;
    try {
        picture = draw(reduced(full, effort), stop);
    } catch (Error const& error) {
        // What this volume cannot be drawn with, such as labels where there are none, leaves the picture as it was.
        if (shown_ == 0 || error.kind() != ErrorKind::usage) throw;
        tell(error.what());
        full_.reset();
        shown_ = request.number, shown_effort_ = 1;
        return;
    }
    if (stop.stop_requested()) return;
    if (fresh) {
        effort_ = next_effort(effort, picture.seconds, target_, least_effort(full), most_effort(full));
        paths_ = {};
        last_pass_ = 0;
    }
    publish(request, std::move(picture), effort);
}

void Painter::draw_more_paths(Request const& request) {
    std::stop_token stop;
    {
        std::lock_guard const lock(mutex_);
        stop = refinement_.get_token();
    }
    render::RenderSettings settings = settings_of(asked_, request.view);
    int const wanted = settings.samples;
    settings.samples = next_paths(paths_.samples, wanted, last_pass_, last_pass_seconds_);
    Picture picture = draw(settings, stop, &paths_);
    if (stop.stop_requested()) {
        paths_ = {};
        last_pass_ = 0;
        return;
    }
    last_pass_ = settings.samples, last_pass_seconds_ = picture.seconds;
    publish(request, std::move(picture), paths_.samples >= wanted ? 1 : paths_.samples / static_cast<double>(wanted));
}

void Painter::publish(Request const& request, Picture picture, double effort) {
    shown_ = request.number;
    shown_effort_ = effort;
    shown_seconds_ = picture.seconds;
    Frame frame;
    frame.view = request.view, frame.name = scene_.name();
    frame.camera = picture.report.camera;
    frame.width = picture.image.width, frame.height = picture.image.height;
    frame.rgb = render::to_bytes(picture.image, background_);
    frame.seconds = picture.seconds, frame.effort = effort;
    frame.paths = paths_.samples;
    frame.report = picture.report;
    frame.volume = scene_.volume();
    frame.arrival = arrival_;
    frame.turn = turn_;
    full_.reset();
    if (effort >= 1 && arrival_.complete && arrival_.failure.empty()) full_ = std::move(picture);
    {
        std::lock_guard const lock(mutex_);
        frame_ = std::move(frame);
    }
    wake_();
}

void Painter::save_picture(Request const& request) {
    if (!arrival_.failure.empty()) {
        tell("nothing is saved: the volume is not whole");
        return;
    }
    // A file that cannot be written is no reason to lose the window.
    try {
        if (request.number != shown_ || !full_) {
            render::RenderSettings settings = settings_of(asked_, request.view);
            bool const scattering = settings.algorithm == render::Algorithm::multi_scattering;
            // Those paths that are there already need not be drawn again.
            if (!scattering || request.number != shown_) paths_ = {};
            settings.samples -= scattering ? paths_.samples : 0;
            publish(request, draw(settings, {}, scattering ? &paths_ : nullptr), 1);
        }
        tell("saved " + scene_.save(full_->image, full_->report, request.view));
    } catch (Error const& error) {
        tell(error.what());
    }
}

void Painter::open(Turn turn) {
    bool const back = turn == Turn::previous;
    try {
        bool const there = back ? scene_.previous() : scene_.next() || (turn == Turn::around && scene_.first_again());
        if (!there) {
            tell(back ? no_previous_volume : no_next_volume);
            return;
        }
    } catch (Error const& error) {
        // What is on the screen is no worse for what does not follow.
        tell(error.what());
        arrival_ = scene_.arrive();
        return;
    }
    ++turn_;
    arrival_ = scene_.arrive();
    show_anew();
}

void Painter::show_anew() {
    full_.reset(); // what was asked to be saved meanwhile is a picture of this volume
    std::lock_guard const lock(mutex_);
    ++wanted_.number;
}

void Painter::tell(std::string message) {
    {
        std::lock_guard const lock(mutex_);
        messages_.push_back(std::move(message));
    }
    wake_();
}

} // namespace vkt::shell::viewer
