// Settings of knobs: listed, run on a part of the volume in memory, timed, and compared with a float64 reference.
// SPDX-License-Identifier: MIT
#include "shell/chart/trade_off.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/current_volume.h"
#include "libvkt/engine/registry.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/statistics/difference.h"
#include "libvkt/operations/voxels/crop.h"
#include "shell/chart/chain.h"
#include "shell/machine/calibration.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

namespace vkt::shell {
namespace {

constexpr std::size_t most_combined = 64; ///< settings: of more only one knob at a time is turned

/// A knob of a stage, or one of the machine ("threads", "device").
struct Dial {
    std::size_t stage = 0;
    Knob knob;
    std::string given; ///< empty: the operation's own choice
    bool of_machine = false;
};

/// What each dial is set to, in their order; empty leaves it as it is given.
using Setting = std::vector<std::string>;

DifferenceResult difference(Volume const& reference, Volume const& other, Execution const& execution) {
    auto const a = volume_source({reference}), b = volume_source({other});
    a->next_volume();
    b->next_volume();
    return compare(*a, *b, execution);
}

/// The middle of a box, with so many voxels at most and its proportions, but no axis below 16 voxels if it has them.
Box middle_part(Box const& box, double voxels) {
    constexpr std::int64_t least = 16;
    Index3 const dims = box.dims();
    Index3 kept = dims;
    std::array<bool, 3> fixed{};
    // An axis that stays longer than its share leaves less to the others.
    for (bool again = true; again;) {
        double open = 1, count = 0, held = 1;
        for (int axis = 0; axis < 3; ++axis) {
            bool const is_fixed = fixed[static_cast<std::size_t>(axis)];
            (is_fixed ? held : open) *= static_cast<double>(is_fixed ? kept[axis] : dims[axis]);
            count += is_fixed ? 0 : 1;
        }
        double const share = std::min(1.0, std::pow(voxels / (held * open), 1 / std::max(1.0, count)));
        again = false;
        for (int axis = 0; axis < 3; ++axis) {
            if (fixed[static_cast<std::size_t>(axis)]) continue;
            kept[axis] = static_cast<std::int64_t>(share * static_cast<double>(dims[axis]));
            if (kept[axis] >= std::min(dims[axis], least)) continue;
            kept[axis] = std::min(dims[axis], least);
            again = fixed[static_cast<std::size_t>(axis)] = true;
        }
    }
    Box part = box;
    for (int axis = 0; axis < 3; ++axis) {
        part.lower[axis] += (dims[axis] - kept[axis]) / 2;
        part.upper[axis] = part.lower[axis] + kept[axis];
    }
    return part;
}

Volume cut_out(std::unique_ptr<Source> source, Box const& box, Execution const& execution) {
    Crop crop;
    Parameters parameters;
    crop.parameters(parameters);
    parameters.set("roi", {to_text(box)});
    std::vector<std::unique_ptr<Source>> inputs;
    inputs.push_back(std::move(source));
    auto const cropped = attach(std::move(inputs), crop, execution, {});
    cropped->next_volume();
    return load(*cropped, execution);
}

double seconds_of(std::function<void()> const& work) {
    auto const start = std::chrono::steady_clock::now();
    work();
    return std::max(1e-9, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    std::size_t const n = values.size();
    return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

void set(Chain& chain, Dial const& dial, std::string const& value) {
    if (!dial.of_machine && !value.empty()) chain.set(dial.stage, dial.knob.option, value);
}

class Study {
public:
    Study(TradeOffRequest const& request, Source& source) : request_(request), execution_(request.execution) {
        Header const& header = source.header();
        result_.whole = header.dims;
        chain_.emplace(request_.pipeline);
        draws_ = chain_->picturing() != nullptr;
        result_.units = draws_ ? "display levels" : header.units;
        if (header.kind != Kind::structured || draws_) {
            take_whole(source);
            return;
        }
        Box const allowed = request.roi.empty() ? box_of(header.dims) : request.roi.resolve(header.dims);
        // A part, the reference, results and what stages hold on the way: some dozens of bytes a voxel, and as much
        // again for the code that all of the settings take.
        double const room = static_cast<double>(execution_.memory) / 224;
        Box held = middle_part(allowed, std::min(16.8e6, room));
        if (request.roi.empty()) {
            whole_only_ = !fits(header, middle_part(allowed, 4096)) || !fits(header, held);
            if (whole_only_) held = middle_part(allowed, room);
        }
        if ((whole_only_ || !request.roi.empty()) && !(held == allowed))
            throw Error(ErrorKind::resources,
                        text(whole_only_ ? "the pipeline does something else to a part than to the whole: " : "--roi: ",
                             allowed.voxels(), " voxels are more than --memory allows"),
                        whole_only_ ? "raise --memory, or name a region that is to be the volume: --roi"
                                    : "name a smaller region, or leave the choice to vkt chart");
        volume_ = cut_out(std::make_unique<CurrentVolume>(source), held, execution_);
        part_ = held;
    }

    TradeOff run() {
        chain_->plan(volume_, execution_); // whose knobs are listed
        list_dials();
        list_settings();
        drop_equals();
        choose_part();
        std::vector<Setting> order = settings_;
        std::stable_sort(order.begin(), order.end(),
                         [&](Setting const& a, Setting const& b) { return meaning(a) < meaning(b); });
        reference_ = reference(best_of({}, true));
        describe_reference();
        check_reference();
        Extremes const values = extremes_of(*reference_);
        double const slope = reference_->header().values.slope, intercept = reference_->header().values.intercept;
        result_.low = std::min(slope * values.low, slope * values.high) + intercept;
        result_.high = std::max(slope * values.low, slope * values.high) + intercept;
        for (auto const& setting : order) measure(setting);
        finish();
        return std::move(result_);
    }

private:
    static bool is_given(Setting const& setting) {
        return std::all_of(setting.begin(), setting.end(), [](auto const& v) { return v.empty(); });
    }

    bool fits(Header const& whole, Box const& part) {
        Header of_part = whole;
        of_part.dims = part.dims();
        return chain_->fits_part(whole, of_part);
    }

    /// Of pictures and hierarchical volumes no part stands for the whole.
    void take_whole(Source& source) {
        auto current = std::make_unique<CurrentVolume>(source);
        bool const tree = source.header().kind != Kind::structured;
        if (tree && !request_.roi.empty())
            throw Error(ErrorKind::usage, "--roi: a region of a hierarchical volume cannot be charted",
                        "cut it out before: vkt crop");
        part_ = request_.roi.empty() ? box_of(result_.whole) : request_.roi.resolve(result_.whole);
        // The volume, what is drawn of it, and the same for a reference.
        double const bytes =
            tree ? static_cast<double>(source.header().bytes())
                 : static_cast<double>(part_.voxels()) * static_cast<double>(size_of(source.header().dtype));
        if (6 * bytes > static_cast<double>(execution_.memory))
            throw Error(
                ErrorKind::resources,
                text("the whole volume has to be measured, ", bytes_text(bytes), ", and a sixth of --memory is less"),
                "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
        if (tree) {
            current->next_volume();
            volume_ = load(*current, execution_);
        } else {
            volume_ = cut_out(std::move(current), part_, execution_);
        }
    }

    bool kept(std::string const& option) const {
        return std::find(request_.kept.begin(), request_.kept.end(), option) != request_.kept.end();
    }

    void list_dials() {
        std::vector<std::string> known{"threads", "device"};
        for (std::size_t i = 0; i < chain_->stages().size(); ++i) {
            Invocation& stage = chain_->stages()[i];
            auto const* const tunable = chain_->tunable(i);
            if (tunable == nullptr) continue;
            for (auto& knob : tunable->knobs()) {
                Parameter const& p = *stage.own_parameters().find(knob.option);
                known.push_back(knob.option);
                if (kept(knob.option)) continue;
                std::string const given = p.given ? join(p.get(), ",") : "";
                dials_.push_back({i, knob, given, false});
            }
        }
        for (auto const& option : request_.kept)
            if (std::find(known.begin(), known.end(), option) == known.end())
                throw Error(ErrorKind::usage, text("--keep ", option, ": the pipeline has no such knob"),
                            text("its knobs are ", join(known, ", ")));
        if (!kept("threads") && execution_.threads > 1) {
            Knob threads{"threads", {"1"}, {}};
            if (execution_.threads > 2) threads.values.push_back(to_text(execution_.threads / 2));
            dials_.push_back({0, threads, to_text(execution_.threads), true});
        }
        bool const gpu = std::any_of(chain_->stages().begin(), chain_->stages().end(), [](Invocation const& s) {
            return s.operation() != nullptr ? s.operation()->runs_on_gpu() : s.consumer()->runs_on_gpu();
        });
        if (!kept("device") && gpu && execution_.device != Device::gpu && built_with_cuda() && gpu_count() > 0)
            dials_.push_back({0, {"device", {"gpu"}, {}}, "cpu", true});
        if (dials_.empty())
            throw Error(ErrorKind::usage, "nothing in the pipeline trades error for time",
                        "operations with a method, a tolerance or a result type do, see 'man vkt-chart'");
    }

    void list_settings() {
        std::size_t all = 1;
        for (auto const& dial : dials_) all *= choices(dial).size();
        settings_.emplace_back(dials_.size());
        if (all <= most_combined) {
            for (std::size_t d = 0; d < dials_.size(); ++d) {
                std::vector<Setting> more;
                for (auto const& setting : settings_)
                    for (auto const& value : choices(dials_[d])) {
                        more.push_back(setting);
                        more.back()[d] = value;
                    }
                settings_ = std::move(more);
            }
            result_.settings = text("all ", static_cast<std::uint64_t>(all), " settings of the knobs");
            return;
        }
        for (std::size_t d = 0; d < dials_.size(); ++d)
            for (auto const& value : choices(dials_[d]))
                if (!value.empty()) {
                    settings_.emplace_back(dials_.size());
                    settings_.back()[d] = value;
                }
        result_.settings = text("one knob turned at a time: ", static_cast<std::uint64_t>(settings_.size()), " of ",
                                static_cast<std::uint64_t>(all), " settings");
    }

    /// Settings that are refused, or plan the computation of one before, are not worth the time.
    void drop_equals() {
        std::set<std::pair<Setting, std::string>> seen;
        std::size_t refused = 0;
        std::size_t const all = settings_.size();
        std::erase_if(settings_, [&](Setting const& setting) {
            try {
                Setting definition = meaning(setting);
                for (std::size_t d = 0; d < dials_.size(); ++d)
                    if (dials_[d].of_machine) definition[d] = setting[d];
                return !seen.emplace(definition, chain_of(setting).plan(volume_, execution_)).second;
            } catch (Error const& e) {
                if (e.kind() != ErrorKind::usage || is_given(setting)) throw;
                ++refused; // the value does not go together with what else is given
                return true;
            }
        });
        if (refused > 0)
            result_.settings += text(", ", static_cast<std::uint64_t>(refused), " of them refused by the operations");
        if (all - refused > settings_.size())
            result_.settings += text(", ", static_cast<std::uint64_t>(all - refused - settings_.size()),
                                     " that plan the same as another");
    }

    /// The values of a dial; an empty one is what is given.
    static std::vector<std::string> choices(Dial const& dial) {
        std::vector<std::string> result{""};
        for (auto const& value : dial.knob.values)
            if (value != dial.given) result.push_back(value);
        return result;
    }

    /// As large a part as there is time for, by what each setting takes for a small one: a warm run, three repeats,
    /// what compares the results, and a reference of each definition.
    void choose_part() {
        result_.part = part_;
        if (draws_) return choose_picture();
        if (whole_only_ || !request_.roi.empty() || volume_.header().kind != Kind::structured) return;
        constexpr double compares = 60e-9; // seconds a voxel
        Box const whole = box_of(volume_.header().dims), probed = middle_part(whole, 32768);
        Volume const small = cut_out(volume_source({volume_}), probed, execution_);
        chain_of(Setting(dials_.size())).run(small, execution_); // pages, threads and tables that later runs find
        auto const once = [&](Setting const& setting) {
            Execution const execution = execution_of(setting);
            Chain& chain = chain_of(setting);
            return seconds_of([&] { chain.run(small, execution); }) / static_cast<double>(probed.voxels());
        };
        double rate = 2 * once(best_of({}, true)); // in float64
        std::set<Setting> definitions;
        for (auto const& setting : settings_) {
            rate += 4 * once(setting) + compares;
            if (definitions.insert(meaning(setting)).second) rate += 2 * once(best_of(setting, false));
        }
        Box const inner = middle_part(whole, std::max(4096.0, request_.seconds / rate));
        result_.part = {part_.lower + inner.lower, part_.lower + inner.upper};
        volume_ = cut_out(volume_source({volume_}), inner, execution_);
    }

    /// As large a picture as there is time for, by what small ones take.
    void choose_picture() {
        Index3 const whole = chain_of(Setting(dials_.size())).picturing()->picture_dims();
        auto const pixels = static_cast<double>(whole.x * whole.y);
        share_ = std::min(1.0, 32 / std::sqrt(pixels));
        chain_->run(volume_, execution_, {false, share_}); // pages, threads and tables that later runs find
        double fixed = 0, drawn = 0;
        auto const once = [&](Setting const& setting, int times, bool reference) {
            Execution const execution = execution_of(setting);
            Chain& chain = chain_of(setting);
            double const all = seconds_of([&] { chain.run(volume_, execution, {reference, share_}); });
            drawn += times * chain.drawing();
            fixed += times * (all - chain.drawing());
        };
        once(best_of({}, true), 1, true);
        for (auto const& setting : settings_) once(setting, 4, false);
        double const affordable = std::max(0.0, request_.seconds - fixed) / (drawn / (share_ * share_));
        share_ = std::clamp(std::sqrt(affordable), share_, 1.0);
        result_.whole_picture = whole;
    }

    /// Only what makes another definition of the result.
    Setting meaning(Setting setting) const {
        for (std::size_t d = 0; d < dials_.size(); ++d)
            if (dials_[d].of_machine || dials_[d].knob.bounded) setting[d].clear();
        return setting;
    }

    /// The most exact setting of the same definition, or of the best one.
    Setting best_of(Setting setting, bool of_all) const {
        setting.resize(dials_.size());
        for (std::size_t d = 0; d < dials_.size(); ++d) {
            if (dials_[d].of_machine)
                setting[d].clear();
            else if (of_all || dials_[d].knob.bounded)
                setting[d] = dials_[d].knob.best;
        }
        return setting;
    }

    Chain& chain_of(Setting const& setting) {
        Chain& chain = chain_.emplace(request_.pipeline);
        for (std::size_t d = 0; d < dials_.size(); ++d) set(chain, dials_[d], setting[d]);
        return chain;
    }

    Execution execution_of(Setting const& setting) const {
        Execution execution = execution_;
        for (std::size_t d = 0; d < dials_.size(); ++d) {
            if (!dials_[d].of_machine || setting[d].empty()) continue;
            if (dials_[d].knob.option == "threads") execution.threads = static_cast<int>(parse_integer(setting[d]));
            if (dials_[d].knob.option == "device") execution.device = Device::gpu;
        }
        return execution;
    }

    Volume reference(Setting const& setting) {
        // What a picture chooses by itself from the values is to be the same.
        if (draws_) return chain_of(setting).run(volume_, execution_, {true, share_});
        if (!wide_) wide_ = in_float64(volume_);
        return chain_of(setting).run(*wide_, execution_);
    }

    void describe_reference() {
        std::string const stages = join(chain_->lines(), " | ");
        result_.reference = draws_ ? text(stages, ", drawn with ", chain_->picturing()->reference_method())
                                   : text("float64 input, ", stages);
        if (draws_) result_.picture = reference_->header().dims;
    }

    /// At the corners, on the edges and faces, and in the middle.
    void check_reference() {
        if (draws_ || chain_->stages().size() != 1 || !wide_ || wide_->header().kind != Kind::structured) return;
        Tunable const* const tunable = chain_->tunable(0);
        Index3 const dims = wide_->header().dims;
        if (tunable == nullptr || !(dims == reference_->header().dims)) return;
        auto const bound = chain_->bound(*wide_, *reference_, execution_);
        if (!bound) return;
        ConstView const in = wide_->view(), out = reference_->view();
        auto const found = out.as<double>();
        TradeOff::Check check{0, 0, *bound};
        auto const places = [](std::int64_t n) { return std::set<std::int64_t>{0, n / 2, n - 1}; };
        for (std::int64_t const z : places(dims.z))
            for (std::int64_t const y : places(dims.y))
                for (std::int64_t const x : places(dims.x)) {
                    auto const wanted = tunable->by_definition(in, {x, y, z});
                    if (!wanted) return;
                    double const error = std::abs(reference_->header().values.slope * (found(x, y, z) - *wanted));
                    ++check.voxels;
                    if (!std::isnan(error)) check.error = std::max(check.error, error);
                }
        result_.check = check;
    }

    void measure(Setting const& setting) {
        Execution const execution = execution_of(setting);
        Chain& chain = chain_of(setting);
        TradeOffPoint point;
        point.stages = chain.lines();
        point.threads = execution.threads;
        point.gpu = execution.device == Device::gpu;
        point.given = is_given(setting);
        point.label = label_of(setting);
        {
            Volume const out = chain.run(volume_, execution, {false, share_}); // the warm run
            if (point.gpu && !chain.uses_gpu()) {
                if (!point.given) return; // the processors did it, as without
                point.gpu = false;
            }
            if (calibration_ && !point.gpu) point.predicted = chain.seconds(*calibration_, execution.threads);
            result_.calibrated = result_.calibrated || point.predicted;
            point.operations = chain.cost();
            point.lossy = chain.lossy();
            // What floats cannot hold is infinite, and no bound is about that; integers are clipped as is the
            // reference.
            if (!point.lossy || is_integer(out.header().dtype)) point.bound = chain.bound(volume_, out, execution);
            DifferenceResult const all = difference(*reference_, out, execution_);
            point.max_error = all.max_abs;
            point.rms_error = all.rmse;
            point.own_error = difference_to_own(setting, out, point.lossy);
        }
        Chain& timed = chain_of(setting);
        std::vector<double> times, drawing;
        double spent = 0;
        while (times.size() < 3 || (times.size() < 9 && spent < 0.1)) {
            times.push_back(seconds_of([&] { timed.run(volume_, execution, {false, share_}); }));
            drawing.push_back(timed.drawing());
            spent += times.back();
        }
        point.seconds = median(times);
        point.whole_seconds =
            draws_ ? point.seconds + (result_.scale() - 1) * median(drawing) : point.seconds * result_.scale();
        point.repeats = static_cast<int>(times.size());
        result_.points.push_back(std::move(point));
    }

    double difference_to_own(Setting const& setting, Volume const& out, bool lossy) {
        if (draws_) return difference(*reference_, out, execution_).max_abs;
        Setting const exact = best_of(setting, false);
        if (!own_ || own_setting_ != exact) {
            own_.reset();
            own_ = reference(exact);
            own_setting_ = exact;
        }
        DataType const type = out.header().dtype;
        if (!lossy || !is_integer(type)) return difference(*own_, out, execution_).max_abs;
        // Clipping brings values no further apart: what it does to the reference, too, excuses nothing else.
        ValueMap const& map = out.header().values;
        double const low = map.physical(lowest_of(type)), high = map.physical(highest_of(type));
        Volume const clipped =
            vkt::apply({"arith", "clamp", "-", to_text(std::min(low, high)), to_text(std::max(low, high))}, {*own_});
        return difference(clipped, out, execution_).max_abs;
    }

    std::string label_of(Setting const& setting) {
        std::vector<std::string> parts;
        for (std::size_t d = 0; d < dials_.size(); ++d) {
            Dial const& dial = dials_[d];
            if (dial.of_machine) {
                if (dial.knob.option == "threads" && !setting[d].empty())
                    parts.push_back(text(setting[d], setting[d] == "1" ? " thread" : " threads"));
                else if (!setting[d].empty())
                    parts.push_back(setting[d]);
            } else if (!setting[d].empty()) {
                bool const several = chain_->stages().size() > 1;
                parts.push_back(text(several ? chain_->stages()[dial.stage].verb().name : "", several ? " " : "", "--",
                                     dial.knob.option, " ", setting[d]));
            }
        }
        return parts.empty() ? "as given" : join(parts, ", ");
    }

    void finish() {
        auto& points = result_.points;
        std::stable_sort(points.begin(), points.end(),
                         [](auto const& a, auto const& b) { return a.seconds < b.seconds; });
        double least = std::numeric_limits<double>::infinity();
        for (auto& point : points) {
            point.front = point.max_error < least;
            least = std::min(least, point.max_error);
        }
        auto const given = std::find_if(points.begin(), points.end(), [](auto const& p) { return p.given; });
        if (result_.calibrated) return;
        for (auto& point : points)
            if (point.operations > 0 && given->operations > 0 && !point.gpu && !given->gpu)
                point.predicted = given->seconds * (point.operations / given->operations) *
                                  (static_cast<double>(given->threads) / point.threads);
    }

    TradeOffRequest const& request_;
    Execution execution_;
    std::optional<Calibration> const calibration_ = load_calibration();
    bool draws_ = false;
    bool whole_only_ = false; ///< no part of the volume stands for it
    double share_ = 1;        ///< of the width and height of pictures
    TradeOff result_;
    Volume volume_;
    Box part_;
    std::optional<Volume> wide_, reference_, own_;
    Setting own_setting_;
    std::optional<Chain> chain_;
    std::vector<Dial> dials_;
    std::vector<Setting> settings_;
};

} // namespace

double TradeOff::scale() const {
    if (picture.x > 0)
        return static_cast<double>(whole_picture.x * whole_picture.y) / static_cast<double>(picture.x * picture.y);
    return static_cast<double>(whole.x * whole.y * whole.z) / static_cast<double>(part.voxels());
}

TradeOff measure_trade_off(TradeOffRequest const& request, Source& source) { return Study(request, source).run(); }

} // namespace vkt::shell
