// The worker thread of the viewer: draws the newest view quickly, refines it while it stands still, saves pictures.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/viewer/viewer.h"

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

namespace vkt::shell::viewer {

/// What is told where there is no next volume, and none before.
inline constexpr char const* no_next_volume = "this is the last volume";
inline constexpr char const* no_previous_volume = "there is no volume before that can be had once more";

/// Which volume to go on to: the next one, the same but the first one after the last, or the one before.
enum class Turn : std::uint8_t { next, around, previous };

/// A picture for the screen.
struct Frame {
    View view;
    std::string name; ///< of what is shown
    render::Camera camera;
    int width = 0, height = 0;
    std::vector<unsigned char> rgb; ///< rows from the top
    double seconds = 0;
    double effort = 1;           ///< 1: the full picture
    int paths = 0;               ///< a pixel so far, of multiple scattering
    render::RenderReport report; ///< of this picture
    std::weak_ptr<render::Renderer const> volume;
    Arrival arrival;
    int turn = 0; ///< how many times another volume was gone on to
};

/// Every view that is asked for is first drawn with the effort that meets the target time; such a frame is never given
/// up, or a hand that keeps moving would see nothing. What comes after refines it and is given up for a newer view.
class Painter {
public:
    /// `wake` is called on the worker thread whenever there is something to take. The scene must outlive the painter.
    Painter(Scene& scene, render::RenderSettings const& asked, render::Background const& background,
            std::function<void()> wake, double target_seconds);
    ~Painter() { finish(); }
    Painter(Painter const&) = delete;
    Painter& operator=(Painter const&) = delete;

    void show(View view);
    /// Saves the full picture of the view that was last asked for.
    void save();
    void go_on(Turn turn);
    /// Tells the command line of the view that was last asked for, as a message that begins with "vkt ".
    void say_command();
    /// Shows a part of the volume finer; an empty box: all of it.
    void magnify(Box const& part);
    /// Ends the work: pictures that are being saved are finished, all else is given up.
    void finish();

    /// The newest frame, once. Throws what went wrong on the worker thread.
    std::optional<Frame> take();
    /// What there is to tell, once each: "saved …" or why not.
    std::optional<std::string> take_message();
    bool saving() const;

private:
    struct Request {
        View view;
        std::int64_t number = 0;
    };
    struct Picture {
        render::Image image;
        render::RenderReport report;
        double seconds = 0;
    };

    /// What keys ask for, in their order.
    struct Task {
        enum class Kind { save, go_on, command, magnify } kind;
        Request request;
        Box part;
        Turn turn = Turn::next;
    };

    void work();
    void do_task(Task const& task);
    Picture draw(render::RenderSettings const& settings, std::stop_token const& stop,
                 render::Accumulation* accumulation = nullptr);
    void draw_frame(Request const& request, double effort);
    void draw_more_paths(Request const& request);
    void publish(Request const& request, Picture picture, double effort);
    void save_picture(Request const& request);
    void open(Turn turn);
    /// The same view of something else.
    void show_anew();
    void tell(std::string message);
    void add_task(Task task);

    Scene& scene_;
    render::RenderSettings asked_;
    render::Background background_;
    std::function<void()> wake_;
    double target_;

    mutable std::mutex mutex_; ///< guards what follows
    std::condition_variable changed_;
    Request wanted_;
    std::deque<Task> tasks_;
    bool quit_ = false, saving_ = false;
    std::stop_source refinement_; ///< stops a pass over the same view
    std::stop_source drawing_;    ///< stops everything that is not saved
    std::optional<Frame> frame_;
    std::deque<std::string> messages_;
    std::exception_ptr failure_;

    // Of the worker thread alone.
    std::int64_t shown_ = 0;     ///< number of the request that the last frame answers
    double shown_effort_ = 0;    ///< of that frame
    Arrival arrival_;            ///< of the volume
    int turn_ = 0;               ///< as in Frame
    render::Accumulation paths_; ///< of that request, once its full picture is begun
    int last_pass_ = 0;          ///< paths a pixel
    double last_pass_seconds_ = 0;
    double shown_seconds_ = 0;             ///< that it took
    double effort_ = 1;                    ///< of the next first frame
    render::RenderSettings full_settings_; ///< of the picture that effort_ is a share of
    std::optional<Picture> full_;          ///< the full picture of that request, if it was drawn
    std::thread thread_;                   ///< last, so that all it uses is there
};

} // namespace vkt::shell::viewer
