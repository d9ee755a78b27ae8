// One operation as a source: what it needs is fetched, computed on its device and handed on, slab by slab.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/operation_source.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/current_volume.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/engine/stopwatch.h"
#include "libvkt/engine/travelled.h"

#include <algorithm>
#include <utility>

namespace vkt {
namespace {

/// The inputs were possible: what is not is what was asked for.
void check_result(Header const& output) {
    try {
        check(output);
    } catch (Error const& error) {
        throw Error(ErrorKind::usage, error.what(), error.hint());
    }
}

/// Below this many multiply-adds per moved byte a GPU loses to the transfers (measured: 55 GB/s against ~40 Gop/s a
/// core).
constexpr double gpu_cost_threshold = 60;

constexpr char placeholder_mark = '\x02';

bool is_tree(Header const& header) { return header.kind == Kind::hierarchical; }
bool any_tree(std::vector<Header> const& headers) { return std::ranges::any_of(headers, is_tree); }

void refuse_grids_among(Operation const& operation, std::vector<Header> const& headers) {
    if (std::ranges::all_of(headers, is_tree)) return;
    throw Error(ErrorKind::usage,
                text(operation.name(), " has no meaning on a hierarchical volume: its inputs are of both kinds"),
                "make it a grid first: vkt resample --cells 50M");
}

} // namespace

Execution on_device(Execution execution, Operation const& operation, Plan const& plan) {
    if (execution.device == Device::automatic) {
        double const work = plan.cost * static_cast<double>(plan.output.voxels());
        bool const worth_it = operation.runs_on_gpu() && plan.cost >= gpu_cost_threshold && work > 1e10;
        execution.device = worth_it && gpu_count() > 0 ? Device::gpu : Device::cpu;
    }
    if (execution.device == Device::gpu && !operation.runs_on_gpu()) {
        if (execution.only_gpu && !plan.shift) refuse_cpu(text(operation.name(), " as it is asked for here"));
        execution.device = Device::cpu;
    }
    return execution;
}

std::optional<History> planned_step(StageInfo const& info, std::vector<Header> headers) {
    if (headers.empty() || !headers.front().dry_run || info.words.empty()) return std::nullopt;
    for (auto& header : headers) header.history = header.planned;
    return history_step(info, headers);
}

History history_step(StageInfo const& info, std::vector<Header> const& headers) {
    History step;
    bool any = false;
    for (auto const& header : headers) {
        step.inputs.push_back(header.history.value_or(History{}));
        any = any || header.history.has_value();
    }
    if (!any) step.inputs.clear();
    for (auto const& word : info.words) {
        if (word.size() < 3 || word.front() != placeholder_mark) {
            step.command.push_back(word);
            continue;
        }
        auto const i = static_cast<std::size_t>(parse_integer(word.substr(2)));
        if (i >= headers.size() || i >= info.input_names.size()) continue;
        if (!headers[i].history)
            step.command.push_back(info.input_names[i]);
        else if (i > 0)
            step.command.emplace_back("<(…)");
        else if (word[1] == 'e')
            step.command.emplace_back("-");
    }
    return folded(std::move(step));
}

std::string input_placeholder(std::size_t i, bool explicit_word) {
    return text(std::string(1, placeholder_mark), explicit_word ? "e" : "i", static_cast<std::uint64_t>(i));
}

StageInfo with_inputs(StageInfo info, std::vector<std::string> names) {
    auto const is_placeholder = [](std::string const& word) { return word.starts_with(placeholder_mark); };
    auto const first = std::ranges::find_if(info.words, is_placeholder);
    if (first != info.words.end()) {
        auto place = first - info.words.begin();
        std::erase_if(info.words, is_placeholder);
        for (std::size_t i = 0; i < names.size(); ++i)
            info.words.insert(info.words.begin() + place++, input_placeholder(i, true));
    }
    info.input_names = std::move(names);
    return info;
}

bool OperationSource::Input::next_volume() {
    spool_.reset();
    preparing_.reset();
    prepared_.reset();
    bool const more = source_->next_volume();
    volumes_ += more ? 1 : 0;
    return more;
}

bool OperationSource::Input::repeat() { return volumes_ == 1 && source_->rewind() && source_->next_volume(); }

void OperationSource::Input::read(AnyView out) {
    if (spool_)
        spool_->read(out);
    else
        source_->read(out);
}

std::optional<ConstView> OperationSource::Input::borrow(Box const& region) {
    return spool_ ? spool_->borrow(region) : source_->borrow(region);
}

std::shared_ptr<Lease> OperationSource::Input::lease(Box const& region) {
    return spool_ ? nullptr : source_->lease(region);
}

void OperationSource::Input::expect(Box const& region) {
    if (!spool_) source_->expect(region);
}

void OperationSource::Input::finish() {
    if (!spool_) source_->finish();
}

void OperationSource::Input::spool(std::size_t in_memory, Execution const& execution, StageInfo const& info) {
    Source& from = preparing_ ? *preparing_ : *source_;
    Space const space = execution.device == Device::gpu ? from.space() : Space::host;
    auto spool = std::make_unique<Spool>(from.header(), in_memory, execution, info, space);
    spool->fill(from, execution);
    spool_ = std::move(spool);
    preparing_.reset();
}

void OperationSource::Input::prepare(Operation& by, Execution const& execution, StageInfo const& info) {
    StageInfo quiet;
    quiet.name = info.name;
    quiet.times = info.times;
    std::vector<std::unique_ptr<Source>> inputs;
    inputs.push_back(std::make_unique<CurrentVolume>(*source_));
    preparing_ = attach(std::move(inputs), by, execution, std::move(quiet));
    preparing_->next_volume();
    prepared_ = preparing_->header();
}

bool OperationSource::Input::in_memory() {
    return !prepared_ && access() == Access::random && space() == Space::host &&
           borrow(box_of(header().dims)).has_value();
}

OperationSource::OperationSource(std::vector<std::unique_ptr<Source>> inputs, Operation& operation,
                                 Execution const& execution, StageInfo info)
    : operation_(operation), requested_(execution), execution_(execution), info_(std::move(info)) {
    for (auto& input : inputs) inputs_.push_back(std::make_unique<Input>(std::move(input)));
}

bool OperationSource::next_volume() {
    if (inputs_.empty()) {
        if (std::exchange(generated_, true)) return false;
    } else {
        std::vector<Input*> ended;
        for (auto& input : inputs_)
            if (!input->next_volume()) ended.push_back(input.get());
        if (ended.size() == inputs_.size()) return false;
        for (Input* const input : ended)
            if (!input->repeat())
                throw Error(ErrorKind::data, "the inputs hold different numbers of volumes",
                            "a single volume is used with each of a series if it is a file");
    }
    plan_volume();
    return true;
}

void OperationSource::plan_volume() {
    std::vector<Header> headers;
    for (auto const& input : inputs_) headers.push_back(input->header());
    tree_.reset();
    made_.reset();
    inputs_used_up_ = false;
    work_ = {};
    result_.reset();
    done_y_ = done_z_ = 0;
    ahead_box_ = {};
    begins_ = true;
    counted_.reset();
    operation_.computed = 0;
    seen_ = {0, 0};
    bool const trees = !headers.empty() && !headers.front().dry_run && any_tree(headers);
    if (trees) refuse_grids_among(operation_, headers);
    // All but what makes a grid of a tree is planned by who works on trees: brick by brick, or level by level.
    bool const alone = headers.size() == 1 && operation_.shape() == Shape::geometric;
    if (trees && !alone) return run_on_tree(headers);
    plan_ = operation_.plan(headers);
    if (trees && plan_.output.kind == Kind::hierarchical) return run_on_tree(headers);
    check_result(plan_.output);
    operation_.begin(headers, plan_);
    if (!headers.empty()) {
        plan_.output.dry_run = headers.front().dry_run;
        plan_.output.timing = headers.front().timing;
    }
    if (!info_.words.empty()) plan_.output.history = history_step(info_, headers);
    plan_.output.planned = planned_step(info_, headers);
    settle_error(headers, false);
    if (info_.on_plan) info_.on_plan(plan_, headers);
    expected_end_ = plan_.output.dims.z;
    if (plan_.output.dry_run) return;
    if (plan_.output.kind == Kind::hierarchical && inputs_.empty()) { // bricks are made when they are asked for
        execution_ = requested_;
        if (execution_.only_gpu) refuse_cpu(text(operation_.name(), " of hierarchical volumes"));
        execution_.device = Device::cpu;
        return;
    }
    if (!headers.empty() && plan_.output.kind != headers.front().kind) return change_kind(headers.front());

    execution_ = beside_neighbours(on_device(requested_, operation_, plan_), plan_, info_);
    if (!plan_.shift) select_gpu(execution_);
    auto* const prepared = dynamic_cast<Prepared*>(&operation_);
    if (Operation* const first = prepared != nullptr ? prepared->preparation() : nullptr) {
        inputs_.front()->prepare(*first, requested_, info_);
        headers.front() = inputs_.front()->header();
    }
    prepare_inputs(headers);
    if (plan_.scans) {
        scan();
        settle_error(headers, true);
    }
}

/// No header keeps the error of another: whatever the operation copied is replaced.
void OperationSource::settle_error(std::vector<Header> const& headers, bool scanned) {
    // The value map of a range that is looked for, and with it the step of integers, is not known before.
    bool const later = plan_.scans && !scanned && is_integer(plan_.output.dtype) &&
                       plan_.passing.storing == ErrorPassing::Storing::computes;
    if (later && plan_.passing.known) {
        plan_.output.error = VolumeError::lost(text(operation_.name(), " has to read all voxels to know it"));
        return;
    }
    settle_header(headers, plan_, operation_.name());
}

/// Chooses how to work within the budget, before anything is read, and spools what then cannot be read as it comes.
void OperationSource::prepare_inputs(std::vector<Header> const& headers) {
    std::size_t const in_memory = spool_limit(inputs_.size(), requested_);
    std::size_t spooled = 0;
    std::vector<bool> lent, spool;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        // What is needed for the scan alone is not kept.
        bool const scanned =
            plan_.scans && !operation_.footprint(box_of(plan_.output.dims), static_cast<int>(i)).empty();
        bool const again = scanned || plan_.access == Access::random || plan_.boundary == Boundary::wrap;
        bool const keeps = inputs_[i]->prepared() || (again && inputs_[i]->access() == Access::forward);
        // Tables that an operation needs have precedence over a volume that may as well lie in a file.
        bool const held = keeps && headers[i].bytes() <= in_memory && plan_.state_bytes <= requested_.memory / 8;
        if (held) spooled += headers[i].bytes();
        spool.push_back(keeps);
        lent.push_back(held || inputs_[i]->in_memory());
    }
    work_ = work_plan(operation_, plan_, headers, lent, spooled, execution_);
    execution_.threads = work_.threads;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        WindowRule rule{headers[i].dims, headers[i].dtype, plan_.boundary, plan_.border_value, work_.window[i]};
        if (plan_.access == Access::forward)
            rule.expect(operation_.footprint(box_of(plan_.output.dims), static_cast<int>(i)));
        inputs_[i]->window.reset(rule);
        if (spool[i])
            inputs_[i]->spool(lent[i] ? in_memory : 0, execution_, info_);
        else if (work_.jumps && inputs_[i]->access() == Access::forward)
            inputs_[i]->spool(0, execution_, info_); // its windows have their share of the memory already
    }
}

/// Trees that stay trees: bricks are worked on as they come, if the operation can.
void OperationSource::run_on_tree(std::vector<Header> const& headers) {
    execution_ = requested_;
    tree_ = std::make_unique<TreeRun>(
        operation_, collect(inputs_, [](auto const& input) { return input->take_bricks(); }), execution_, info_);
    plan_ = tree_->plan();
    check_result(plan_.output);
    plan_.output.timing = headers.front().timing;
    if (!info_.words.empty()) plan_.output.history = history_step(info_, headers);
    settle_error(headers, true);
    if (info_.on_plan) info_.on_plan(plan_, headers);
}

/// A grid becomes a tree, or a tree a grid: the operation is given all of it at once.
void OperationSource::change_kind(Header const& input) {
    bool const makes_tree = plan_.output.kind == Kind::hierarchical;
    execution_ = requested_;
    if (execution_.device != Device::gpu || !operation_.runs_on_gpu()) {
        if (execution_.only_gpu)
            refuse_cpu(
                text(operation_.name(), " of hierarchical volumes", makes_tree ? "" : " as it is asked for here"));
        execution_.device = Device::cpu;
    }
    if (makes_tree)
        check_budget(std::max(plan_.state_bytes, plan_.output.bytes()), requested_);
    else
        tree_work(operation_.shape(), plan_, {&input, 1}, {}, requested_);
    Volume whole = load(*inputs_.front(), requested_);
    inputs_used_up_ = true;
    Stopwatch const watch(info_.times ? &info_.times->compute : nullptr);
    select_gpu(execution_);
    made_ = operation_.take_whole(std::move(whole), execution_);
    if (!made_) {
        if (makes_tree) throw Error(ErrorKind::failure, text(operation_.name(), " made no hierarchical volume"));
        work_.cut = cut_of(plan_.output, slab_hint_on(execution_, plan_.output, plan_.slab_hint), requested_);
        return;
    }
    operation_.after_scan(plan_);
    settle_error({input}, true);
    Header header = made_->header();
    header.history = plan_.output.history;
    header.error = plan_.output.error;
    header.timing = plan_.output.timing;
    plan_.output = made_->header() = std::move(header);
    if (info_.times) info_.times->voxels += plan_.output.voxels();
}

BrickSequence OperationSource::take_bricks() {
    if (tree_) return tree_->bricks(plan_.output);
    if (made_) return std::move(*made_);
    if (inputs_.empty() && plan_.output.kind == Kind::hierarchical)
        if (auto bricks = operation_.make_bricks(execution_)) return std::move(*bricks).with_header(plan_.output);
    return Source::take_bricks();
}

void OperationSource::scan() {
    Input& input = *inputs_.front();
    ProgressPart const half(ProgressPart::OfCall{}, requested_.monitor, 0.0, 0.5);
    do scan_volume(input, operation_, requested_, info_.times.get());
    while (operation_.scans_again());
    operation_.after_scan(plan_);
    // A source whose end was proven in the first pass may be read again; the end is proven once more in finish().
}

Access OperationSource::access() const {
    if (inputs_used_up_ || work_.bands) return Access::random;
    if (plan_.carries) return Access::forward;
    bool const random =
        std::all_of(inputs_.begin(), inputs_.end(), [](auto const& i) { return i->access() == Access::random; });
    return random ? Access::random : Access::forward;
}

std::int64_t OperationSource::natural_slab() const {
    if (plan_.slab_hint > 0) return plan_.slab_hint;
    bool const in_step = operation_.shape() == Shape::pointwise || (plan_.shift && plan_.shift->z == 0);
    if (!inputs_.empty() && !inputs_used_up_ && in_step && plan_.access == Access::forward)
        return inputs_.front()->natural_slab();
    return 0;
}

void OperationSource::expect(Box const& region) {
    expected_end_ = region.upper.z;
    begins_ = true;
    if (inputs_used_up_ || region.empty() || plan_.access == Access::random || work_.jumps)
        return; // jumps cannot be read ahead
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        Box const wanted = plan_.carries ? Box{{}, {plan_.output.dims.x, plan_.output.dims.y, region.upper.z}} : region;
        Box const footprint = plan_.shift ? moved(wanted) : operation_.footprint(wanted, static_cast<int>(i));
        inputs_[i]->expect(intersect(footprint, box_of(inputs_[i]->header().dims)));
    }
}

/// Stages that look at all of their input first, keep what came before or ask for slabs in another order would do all
/// of the work before them in every share.
bool OperationSource::divisible(bool ascending) const {
    bool const slabs = !tree_ && !made_ && !inputs_used_up_ && plan_.output.kind == Kind::structured &&
                       !plan_.carries && !plan_.whole && !plan_.scans && !work_.bands && !result_;
    bool const in_order = plan_.access == Access::forward && plan_.boundary != Boundary::wrap;
    return ascending && slabs &&
           std::ranges::all_of(inputs_, [&](auto const& input) { return input->divisible(in_order); });
}

void OperationSource::count_only(std::int64_t begin, std::int64_t end) {
    counted_ = {begin, end};
    // What was computed before did not count.
    ahead_box_ = {};
    for (auto& input : inputs_) input->window.forget();
    Index3 const n = plan_.output.dims;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        std::int64_t const all = inputs_[i]->header().dims.z;
        // Of the slices that two slabs are made of, those of the lower one are counted with it.
        auto const first_for = [&](std::int64_t z) {
            if (z <= 0) return std::int64_t{0};
            if (z >= n.z) return all;
            Box const below{{}, {n.x, n.y, z}};
            Box const from = plan_.shift ? moved(below) : operation_.footprint(below, static_cast<int>(i));
            return std::clamp<std::int64_t>(from.upper.z, 0, all);
        };
        inputs_[i]->count_only(first_for(begin), first_for(end));
    }
}

std::optional<ConstView> OperationSource::borrow(Box const& region) {
    if (made_) return made_->view().part(region);
    if (work_.bands) return result_ ? result_->borrow(region) : std::nullopt;
    if (!plan_.shift) return std::nullopt;
    auto lent = inputs_.front()->borrow(moved(region));
    if (!lent || lent->space != space()) return std::nullopt;
    return lent->moved_to(region.lower);
}

std::shared_ptr<Lease> OperationSource::lease(Box const& region) {
    return plan_.shift ? inputs_.front()->lease(moved(region)) : nullptr;
}

void OperationSource::finish() {
    if (!inputs_used_up_)
        for (auto& input : inputs_) input->finish();
    if (info_.on_report && operation_.reports()) info_.on_report(operation_.report());
    tell_remarks();
}

/// What remarks count is of the voxels that were asked for: where these are fewer than all that a remark speaks of, it
/// says so.
void OperationSource::tell_remarks() const {
    if (!info_.listener) return;
    std::int64_t const all = plan_.output.voxels();
    bool const some = !tree_ && operation_.computed > 0 && operation_.computed < all;
    for (auto const& remark : tree_ ? tree_->remarks() : operation_.remarks()) {
        bool const counts = remark.message.find(text(" of ", all, " voxels")) != std::string::npos;
        info_.listener(info_.name,
                       some && counts ? text(remark.message, "; ", operation_.computed, " were asked for")
                                      : remark.message,
                       remark.lossy);
    }
}

} // namespace vkt
