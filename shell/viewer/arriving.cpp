// Reading beside drawing; parts of volumes made finer.
// SPDX-License-Identifier: MIT
#include "shell/viewer/arriving.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/registry.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace vkt::shell::viewer {

namespace {

/// Of a volume that comes slowly, at most.
constexpr std::int64_t pictures = 16;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// One step of the kind that a command line has, in this process.
Volume applied(std::string const& name, std::vector<std::string> const& options, Volume const& input,
               StageInfo const& stage, Execution const& execution) {
    std::unique_ptr<Operation> const operation = make_operation(name);
    Parameters own;
    operation->parameters(own);
    read_words(options, {&own});
    operation->check();
    StageInfo info;
    info.name = text("vkt ", name);
    if (!stage.words.empty()) info.words = history_words(name, own, {"-"}, false);
    info.input_names = stage.input_names;
    info.listener = stage.listener;
    std::vector<std::unique_ptr<Source>> inputs;
    inputs.push_back(volume_source({input}));
    auto const result = attach(std::move(inputs), *operation, execution, info);
    result->next_volume();
    return load(*result, execution);
}

} // namespace

ArrivingVolumes::ArrivingVolumes(Source& source, Execution execution, render::TreeDrawing tree,
                                 std::function<bool()> open)
    : source_(source), execution_(std::move(execution)), tree_(tree), open_(std::move(open)) {}

ArrivingVolumes::~ArrivingVolumes() { stop(); }

void ArrivingVolumes::stop() {
    {
        std::lock_guard const lock(mutex_);
        quit_ = true;
    }
    if (reader_.joinable()) reader_.join();
}

Header const& ArrivingVolumes::header() const { return part_ ? part_->header() : header_; }

void ArrivingVolumes::settle() {
    if (reader_.joinable()) reader_.join();
    if (failure_) end_early(std::exchange(failure_, nullptr), here_);
}

bool ArrivingVolumes::next() {
    settle();
    if (!open_()) return false;
    renderer_.reset();
    part_.reset();
    broken_.reset();
    header_ = source_.header();
    shown_ = here_ = 0;
    complete_ = finished_ = false;
    std::optional<Volume> whole;
    try {
        whole = header_.kind == Kind::hierarchical ? load(source_, execution_) : source_.take_whole();
    } catch (std::exception const& error) {
        broken_ = Broken{std::current_exception(), error.what()};
        throw;
    }
    if (whole) {
        volume_ = std::move(*whole);
        here_ = header_.dims.z;
        finished_ = true;
    } else {
        volume_ = Volume(header_);
        source_.expect(box_of(header_.dims));
        reader_ = std::thread([this] { read(); });
    }
    next_time_ = now() + 0.3; // what is there sooner needs no parts
    return true;
}

void ArrivingVolumes::read() {
    try {
        AnyView const all = volume_.mutable_view();
        Index3 const dims = header_.dims;
        constexpr std::int64_t bytes = 4 << 20;
        std::int64_t const per_slice =
            std::max<std::int64_t>(1, dims.x * dims.y * static_cast<std::int64_t>(size_of(header_.dtype)));
        // Small volumes may come slowly, too: no more at once than makes a new picture of what is there.
        std::int64_t const height =
            std::max({std::int64_t{1}, source_.natural_slab(), std::min(bytes / per_slice, dims.z / pictures)});
        for (std::int64_t z = 0; z < dims.z; z += height) {
            {
                std::lock_guard const lock(mutex_);
                if (quit_) return;
            }
            std::int64_t const end = std::min(dims.z, z + height);
            source_.read(all.part({{0, 0, z}, {dims.x, dims.y, end}}));
            {
                std::lock_guard const lock(mutex_);
                here_ = end;
            }
            changed_.notify_all();
        }
        source_.finish();
        std::lock_guard const lock(mutex_);
        finished_ = true;
    } catch (...) {
        std::lock_guard const lock(mutex_);
        failure_ = std::current_exception();
    }
    changed_.notify_all();
}

/// Makes the lower slices ready. Those without finite voxels show nothing, and are no mistake as long as more may come.
void ArrivingVolumes::show_slices(std::int64_t here) {
    Header lower = header_;
    lower.dims.z = here;
    ConstView const slices = static_cast<Volume const&>(volume_).view().part({{0, 0, 0}, lower.dims});
    try {
        renderer_.reset();
        renderer_ = std::make_shared<render::Renderer>(lower, slices, execution_);
        shown_ = here;
    } catch (Error const& error) {
        if (error.kind() != ErrorKind::data) throw;
    }
}

Arrival ArrivingVolumes::end_early(std::exception_ptr const& failure, std::int64_t here) {
    if (here > shown_) show_slices(here);
    if (renderer_ == nullptr) std::rethrow_exception(failure);
    try {
        std::rethrow_exception(failure);
    } catch (std::exception const& error) {
        broken_ = Broken{failure, error.what()};
    }
    return {shown_, header_.dims.z, true, broken_->text};
}

Arrival ArrivingVolumes::arrive() {
    if (complete_) return {header_.dims.z, header_.dims.z, true};
    if (broken_) return {shown_, header_.dims.z, true, broken_->text};
    std::int64_t here = 0;
    bool finished = false;
    {
        std::unique_lock lock(mutex_);
        auto const something = [&] { return finished_ || failure_ != nullptr; };
        // The first picture of a part is to come soon; later ones are not to cost more than they show.
        double const wait = std::max(0.0, next_time_ - now());
        changed_.wait_for(lock, std::chrono::duration<double>(std::min(wait + 0.02, 0.25)), something);
        if (failure_) {
            std::exception_ptr const failure = std::exchange(failure_, nullptr);
            here = here_;
            lock.unlock();
            if (reader_.joinable()) reader_.join();
            return end_early(failure, here);
        }
        here = here_, finished = finished_;
    }
    if (finished) {
        if (reader_.joinable()) reader_.join();
        renderer_.reset();
        renderer_ = std::make_shared<render::Renderer>(volume_, execution_, tree_);
        shown_ = header_.dims.z;
        complete_ = true;
        return {shown_, header_.dims.z, true};
    }
    bool const enough = here - shown_ >= std::max<std::int64_t>(1, header_.dims.z / pictures);
    if (enough && now() >= next_time_) {
        double const start = now();
        show_slices(here);
        next_time_ = now() + std::max(0.25, 3 * (now() - start));
    }
    return {shown_, header_.dims.z, false};
}

void ArrivingVolumes::magnify(Box const& part, StageInfo const& stage) {
    if (broken_) throw Error(ErrorKind::usage, "the volume is not whole");
    if (!complete_) throw Error(ErrorKind::usage, "the volume is still on its way");
    if (part.empty()) {
        if (!part_) return;
        part_.reset();
        renderer_.reset();
        renderer_ = std::make_shared<render::Renderer>(volume_, execution_, tree_);
        return;
    }
    // Of what is shown: parts of parts become ever finer.
    Volume const from = part_ ? *part_ : volume_;
    std::string roi;
    for (int axis = 0; axis < 3; ++axis) roi += text(axis == 0 ? "" : ",", part.lower[axis], ":", part.upper[axis]);
    // As many voxels as move fluently, and as fit beside what is there.
    double const budget = static_cast<double>(execution_.memory) / 4 / static_cast<double>(2 * size_of(header_.dtype));
    double const most = std::clamp(budget, 4096.0, 12.0e6);
    Volume finer;
    if (from.header().kind == Kind::hierarchical) {
        finer = applied("resample", {"--roi", roi, "--cells", text(static_cast<std::int64_t>(most))}, from, stage,
                        execution_);
    } else {
        Volume const cropped = applied("crop", {"--roi", roi}, from, stage, execution_);
        double const scale = std::cbrt(most / static_cast<double>(cropped.header().voxels()));
        // Beyond eight there is nothing more to see between two voxels.
        double const factor = std::floor(2 * std::clamp(scale, 1.0, 8.0)) / 2;
        finer = factor > 1 ? applied("resample", {"--scale", text(factor)}, cropped, stage, execution_) : cropped;
    }
    auto renderer = std::make_shared<render::Renderer>(finer, execution_);
    part_ = std::move(finer);
    renderer_ = std::move(renderer);
}

} // namespace vkt::shell::viewer
