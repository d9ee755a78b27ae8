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

void Painter::save() {
    {
        std::lock_guard const lock(mutex_);
        tasks_.emplace_back(wanted_);
        saving_ = true;
    }
    changed_.notify_all();
}

void Painter::next() {
    {
        std::lock_guard const lock(mutex_);
        if (tasks_.empty() || tasks_.back()) tasks_.emplace_back(std::nullopt);
        refinement_.request_stop();
    }
    changed_.notify_all();
}

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
        for (;;) {
            std::unique_lock lock(mutex_);
            changed_.wait(lock,
                          [&] { return quit_ || !tasks_.empty() || wanted_.number != shown_ || shown_effort_ < 1; });
            if (quit_ && !saving_) return;
            if (!tasks_.empty()) {
                std::optional<Request> const task = std::move(tasks_.front());
                tasks_.pop_front();
                lock.unlock();
                if (!task) {
                    go_on();
                    continue;
                }
                save_picture(*task);
                lock.lock();
                saving_ = std::any_of(tasks_.begin(), tasks_.end(), [](auto const& t) { return t.has_value(); });
                wake_(); // the window stops saying that something is being saved
                continue;
            }
            Request const request = wanted_;
            refinement_ = std::stop_source();
            lock.unlock();
            bool const fresh = request.number != shown_;
            draw_frame(request, fresh ? effort_ : refined_effort(shown_effort_, shown_seconds_));
        }
    } catch (...) {
        std::lock_guard const lock(mutex_);
        failure_ = std::current_exception();
    }
    wake_();
}

Painter::Picture Painter::draw(render::RenderSettings const& settings, std::stop_token const& stop) {
    auto const start = std::chrono::steady_clock::now();
    Picture picture;
    picture.image = scene_.draw(settings, picture.report, stop);
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
    Picture picture = draw(reduced(settings_of(asked_, request.view), effort), stop);
    if (stop.stop_requested()) return;
    if (fresh) effort_ = next_effort(effort, picture.seconds, target_, least_effort(asked_));
    publish(request, std::move(picture), effort);
}

void Painter::publish(Request const& request, Picture picture, double effort) {
    shown_ = request.number;
    shown_effort_ = effort;
    shown_seconds_ = picture.seconds;
    Frame frame{request.view,          scene_.name(),
                picture.report.camera, picture.image.width,
                picture.image.height,  render::to_bytes(picture.image, background_),
                picture.seconds,       effort};
    full_.reset();
    if (effort >= 1) full_ = std::move(picture);
    {
        std::lock_guard const lock(mutex_);
        frame_ = std::move(frame);
    }
    wake_();
}

void Painter::save_picture(Request const& request) {
    // A file that cannot be written is no reason to lose the window.
    try {
        if (request.number != shown_ || !full_) publish(request, draw(settings_of(asked_, request.view), {}), 1);
        tell("saved " + scene_.save(full_->image, full_->report, request.view));
    } catch (Error const& error) {
        tell(error.what());
    }
}

void Painter::go_on() {
    if (!scene_.next()) {
        tell("this is the last volume");
        return;
    }
    full_.reset(); // what was asked to be saved meanwhile is a picture of this volume
    std::lock_guard const lock(mutex_);
    ++wanted_.number; // the same view of something else
}

void Painter::tell(std::string message) {
    {
        std::lock_guard const lock(mutex_);
        messages_.push_back(std::move(message));
    }
    wake_();
}

} // namespace vkt::shell::viewer
