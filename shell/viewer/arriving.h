// The volumes of an input for a window: each is shown while it is still on its way, and parts of it may be magnified.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/source.h"
#include "libvkt/render/render.h"
#include "shell/viewer/viewer.h"

#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

namespace vkt::shell::viewer {

/// A thread of its own reads structured volumes slab by slab, so that slow pipelines upstream keep nobody waiting; what
/// is there is made ready now and then. All else is called on one thread.
class ArrivingVolumes {
public:
    /// `open` moves the source to the next volume that is to be shown and checks that it fits into memory; false if
    /// there is none. The source must outlive this.
    ArrivingVolumes(Source& source, Execution execution, render::TreeDrawing tree, std::function<bool()> open);
    /// What is read then is not shown any more, but the slab that is on its way is waited for.
    ~ArrivingVolumes();
    ArrivingVolumes(ArrivingVolumes const&) = delete;
    ArrivingVolumes& operator=(ArrivingVolumes const&) = delete;

    bool next();
    /// Waits until the volume has come to its end, or to that of what can be read.
    void settle();
    /// Waits a little for something new and makes it ready. What went wrong on the reading thread is thrown where
    /// nothing can be shown; otherwise it is told, and what came before stays.
    Arrival arrive();
    /// Why the volume ended early; null if it did not, or not yet.
    std::exception_ptr ended_early() const { return broken_ ? broken_->why : nullptr; }
    /// Whether a part is shown, resampled.
    bool magnified() const { return part_.has_value(); }
    /// That of the volume as it came.
    Header const& whole_header() const { return header_; }
    /// Of what is shown: the whole volume's, or that of its part.
    Header const& header() const;
    /// Null until the first slices are there.
    std::shared_ptr<render::Renderer const> renderer() const { return renderer_; }
    /// Whether only the lower slices are there, of which `renderer` has no more.
    bool partial() const { return shown_ < header_.dims.z && !complete_; }
    /// A part as crop and resample make it, with `words` and `names` of the stage that shows it for the history; an
    /// empty box: the whole volume again.
    void magnify(Box const& part, StageInfo const& stage);

private:
    /// A volume that ended early.
    struct Broken {
        std::exception_ptr why;
        std::string text;
    };

    void read();
    void stop();
    void show_slices(std::int64_t here);
    Arrival end_early(std::exception_ptr const& failure, std::int64_t here);

    Source& source_;
    Execution execution_;
    render::TreeDrawing tree_;
    std::function<bool()> open_;
    Header header_;
    Volume volume_;
    std::shared_ptr<render::Renderer const> renderer_;
    std::optional<Volume> part_; ///< that is shown instead
    std::int64_t shown_ = 0;     ///< slices that the renderer has
    bool complete_ = false;      ///< and it is one of the whole volume
    std::optional<Broken> broken_;
    double prepare_seconds_ = 0, next_time_ = 0;

    std::thread reader_;
    mutable std::mutex mutex_; ///< guards what follows
    std::condition_variable changed_;
    std::int64_t here_ = 0; ///< slices that were read
    bool finished_ = false, quit_ = false;
    std::exception_ptr failure_;
};

} // namespace vkt::shell::viewer
