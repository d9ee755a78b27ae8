// Candidates are made by operations in memory, run through the pipeline, and compared with what the volume itself
// makes.
// SPDX-License-Identifier: MIT
#include "shell/chart/slim.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/operations/statistics/difference.h"
#include "shell/chart/chain.h"
#include "shell/picture/picture_levels.h"
#include "shell/short_number.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <optional>

namespace vkt::shell {
namespace {

using Words = std::vector<std::string>;

constexpr double preview_share = 0.25; ///< of a picture's width and height
constexpr double hopeless = 4;         ///< times the limit, in a preview
constexpr double share_of_cut = 0.25;  ///< of what is allowed, for what is cut off: of the box, and of the values

Volume made(Volume volume, std::vector<Words> const& stages) {
    for (auto const& words : stages) volume = vkt::apply(words, {volume});
    return volume;
}

std::string line_of(std::vector<Words> const& stages) {
    return join(collect(stages,
                        [](Words const& words) {
                            return join(collect(words, [](auto const& w) { return shell_quoted(w); }), " ");
                        }),
                " | ");
}

struct Candidate {
    std::vector<Words> stages;
    std::size_t bytes = 0;
};

struct Found {
    bool holds = false;
    double max_error = 0, rms_error = 0, flip = 0;
};

class Search {
public:
    Search(Volume const& volume, SlimRequest const& request)
        : volume_(volume), request_(request), chain_(request.pipeline), draws_(chain_.picturing() != nullptr) {}

    SlimModel run() {
        reference_ = chain_.run(volume_, request_.execution);
        if (draws_) preview_ = chain_.run(volume_, request_.execution, {false, preview_share});
        SlimModel model;
        model.pictures = draws_ ? chain_.picturing()->picture_dims().z / 3 : 0;
        model.bytes_before = model_bytes(volume_);
        std::vector<Candidate> candidates = list();
        std::stable_sort(candidates.begin(), candidates.end(),
                         [](Candidate const& a, Candidate const& b) { return a.bytes < b.bytes; });
        Candidate best{{}, model.bytes_before};
        Volume chosen = volume_;
        Found measured{true, 0, 0, 0};
        for (auto const& candidate : candidates) {
            if (candidate.bytes >= best.bytes) break;
            Volume const smaller = made(volume_, candidate.stages);
            Found const found = test(smaller, candidate);
            if (!found.holds) continue;
            best = candidate;
            chosen = smaller;
            measured = found;
            break;
        }
        if (volume_.header().kind == Kind::structured) refine(best, chosen, measured);
        model.tried = tried_;
        model.made = line_of(best.stages);
        model.bytes = best.bytes;
        model.max_error = measured.max_error;
        model.rms_error = measured.rms_error;
        model.flip = measured.flip;
        model.seconds_before = seconds(volume_);
        model.seconds = best.stages.empty() ? model.seconds_before : seconds(chosen);
        model.volume = std::move(chosen);
        tell_ends(model, best.stages);
        return model;
    }

private:
    /// Crops, resolutions and types, in any combination.
    std::vector<Candidate> list() {
        Header const& header = volume_.header();
        std::vector<std::vector<Words>> crops{{}}, scales{{}};
        if (header.kind == Kind::structured) {
            for (Box const& box : draws_ ? visible() : read()) crops.push_back({{"crop", "--roi", to_text(box)}});
            bool const any_scale = draws_ || keeps_its_lattice();
            for (char const* const scale : {"0.25", "0.375", "0.5", "0.625", "0.75"})
                if (any_scale) scales.push_back({{"resample", "--scale", scale}});
        }
        std::vector<std::vector<Words>> const types = conversions();
        std::vector<Candidate> result;
        for (auto const& crop : crops)
            for (auto const& scale : scales)
                for (auto const& type : types) {
                    Candidate candidate;
                    candidate.stages = crop;
                    candidate.stages.insert(candidate.stages.end(), scale.begin(), scale.end());
                    candidate.stages.insert(candidate.stages.end(), type.begin(), type.end());
                    if (candidate.stages.empty()) continue;
                    candidate.bytes = planned_bytes(candidate.stages);
                    result.push_back(std::move(candidate));
                }
        return result;
    }

    /// Types, with the values as they are, or with the range that matters spread over integers.
    std::vector<std::vector<Words>> conversions() {
        std::vector<std::vector<Words>> result{{}};
        DataType const type = volume_.header().dtype;
        Extremes const extremes = extremes_of(volume_);
        double const width = std::abs(volume_.header().values.slope) * (extremes.high - extremes.low);
        auto const smallest = [&](double tolerance) {
            result.push_back({{"convert", "--dtype", "auto", "--tolerance", to_text(tolerance)}});
        };
        smallest(0);
        for (double const codes : {255.0, 65535.0})
            if (size_of(type) > (codes > 255 ? 2U : 1U) && width > 0) smallest(width / codes * 0.500001);
        for (char const* const range : {"p0.1:p99.9", "p0.01:p99.99"})
            if (size_of(type) > 1 && width > 0) result.push_back({{"convert", "--dtype", "uint8", "--range", range}});
        if (auto const domain = domain_of_colours(); domain && size_of(type) > 1)
            for (char const* const name : {"uint8", "uint16"})
                if (size_of(type) > size_of(parse_data_type(name)))
                    result.push_back({{"convert", "--dtype", name, "--range", *domain}});
        if (size_of(type) > 1 && width > 0)
            if (auto const kept = values_needed(extremes))
                for (char const* const name : {"uint8", "uint16"})
                    if (size_of(type) > size_of(parse_data_type(name)))
                        result.push_back({{"convert", "--dtype", name, "--range", range_of(*kept, name)}});
        if (size_of(type) > 2) result.push_back({{"convert", "--dtype", "float16"}});
        return result;
    }

    /// Physical values.
    struct ValueRange {
        double low = 0, high = 0;
        friend bool operator==(ValueRange const&, ValueRange const&) = default;
    };

    /// The values that the picture, or the result, is made of: each end is moved inwards as far as it may. None if that
    /// is all of them.
    std::optional<ValueRange> values_needed(Extremes const& stored) {
        ValueMap const& map = volume_.header().values;
        double const a = map.slope * stored.low + map.intercept, b = map.slope * stored.high + map.intercept;
        ValueRange const all{std::min(a, b), std::max(a, b)};
        ValueRange kept = all;
        // What is kept above decides how closely one has to look below, once more.
        // A range is left also where nothing depends on the values.
        double const least = (all.high - all.low) / 4096;
        for (bool const upper : {false, true, false}) narrow(kept, upper, least);
        if (!(kept.low < kept.high)) return {};
        // What a preview leaves out may be made of more.
        for (double const part : {0.0, 1.0 / 16, 0.25, 1.0}) {
            double const margin = part * (kept.high - kept.low);
            ValueRange const wider{std::max(kept.low - margin, all.low), std::min(kept.high + margin, all.high)};
            if (wider == all) return {};
            if (compared(reference_, chain_.run(clamped(wider), request_.execution)).max_abs <=
                share_of_cut * request_.within)
                return wider;
        }
        return {};
    }

    /// Moves one end inwards until what more could be cut off is little of what is kept, which is `least` at least.
    void narrow(ValueRange& kept, bool upper, double least) {
        constexpr double little = 1.0 / 256;
        double const sign = upper ? -1 : 1, start = upper ? kept.high : kept.low, width = kept.high - kept.low;
        double good = 0, bad = width - least; // to cut off
        for (double cut = little * width; cut < bad && bad - good > little * (width - good);
             cut = good + (bad - good) / 2) {
            ValueRange part = kept;
            (upper ? part.high : part.low) = start + sign * cut;
            bool const unseen = difference_in_preview(clamped(part)) <= share_of_cut * request_.within;
            (unseen ? good : bad) = cut;
        }
        (upper ? kept.high : kept.low) = start + sign * good;
    }

    Volume clamped(ValueRange const& range) const {
        return vkt::apply({"arith", "clamp", "-", to_text(range.low), to_text(range.high)}, {volume_});
    }

    /// As a word. Of integers that are no more than the type tells apart, every one is kept as it is.
    std::string range_of(ValueRange range, char const* type) const {
        Header const& header = volume_.header();
        double const step = std::abs(header.values.slope), codes = highest_of(parse_data_type(type));
        if (is_integer(header.dtype)) {
            double const first = std::floor((range.low - header.values.intercept) / step),
                         last = std::ceil((range.high - header.values.intercept) / step);
            if (last - first <= codes)
                range = {header.values.intercept + step * first, header.values.intercept + step * (first + codes)};
        }
        return text(to_text(range.low), ":", to_text(range.high));
    }

    /// Of the values in the model's part of the volume, what its integers do not hold but for their rounding.
    void tell_ends(SlimModel& model, std::vector<Words> const& stages) const {
        Header const& header = model.volume.header();
        if (!is_integer(header.dtype)) return;
        double const slope = header.values.slope;
        double const a = slope * lowest_of(header.dtype) + header.values.intercept,
                     b = slope * highest_of(header.dtype) + header.values.intercept;
        double const low = std::min(a, b), high = std::max(a, b), rounding = 0.501 * std::abs(slope);
        bool const part = !stages.empty() && stages.front().front() == "crop";
        Volume const wide = in_float64(part ? made(volume_, {stages.front()}) : volume_);
        auto const* const values = reinterpret_cast<double const*>(wide.view().data);
        std::int64_t const voxels = wide.header().voxels();
        ValueMap const& map = wide.header().values;
        std::int64_t below = 0, above = 0;
        for (std::int64_t i = 0; i < voxels; ++i) {
            double const value = map.slope * values[i] + map.intercept;
            below += value < low - rounding ? 1 : 0;
            above += value > high + rounding ? 1 : 0;
        }
        auto const share = [&](std::int64_t n) { return static_cast<double>(n) / static_cast<double>(voxels); };
        if (below > 0) model.below = CutEnd{low, share(below)};
        if (above > 0) model.above = CutEnd{high, share(above)};
    }

    /// The values that the colours of a picture span, if they are named as two numbers.
    std::optional<std::string> domain_of_colours() const {
        if (!draws_) return {};
        auto& parameters = const_cast<Chain&>(chain_).stages().back().own_parameters();
        Parameter const* const domain = parameters.find("domain");
        if (domain == nullptr || !domain->given) return {};
        std::string const word = domain->get().front();
        std::size_t const colon = word.find(':');
        if (colon == std::string::npos || !is_number(word.substr(0, colon)) || !is_number(word.substr(colon + 1)))
            return {};
        return word;
    }

    /// Bytes of what stages would make; types that a scan finds are made for that.
    std::size_t planned_bytes(std::vector<Words> const& stages) {
        Header header = volume_.header();
        for (auto const& words : stages) {
            if (words.front() == "convert" && words[2] == "auto") {
                DataType const type = type_within(words);
                header.dtype = type;
                continue;
            }
            auto const operation = make_operation(words.front());
            Parameters parameters;
            operation->parameters(parameters);
            for (std::size_t i = 1; i + 1 < words.size(); i += 2) parameters.set(words[i].substr(2), {words[i + 1]});
            operation->check();
            header = operation->plan({&header, 1}).output;
        }
        bool const tree = header.kind == Kind::hierarchical; // which keeps its bricks
        return header.bytes() + (tree ? volume_.bricks().bytes() : 0);
    }

    /// What a tolerance leads to does not depend much on resolution and crop, and is looked at once.
    DataType type_within(Words const& words) {
        for (auto const& [known, type] : types_)
            if (known == words) return type;
        DataType const type = vkt::apply(words, {volume_}).header().dtype;
        types_.emplace_back(words, type);
        return type;
    }

    /// The box outside of which nothing changes the picture by more than a part of what is allowed: every face is
    /// moved inwards as far as it may. None if that is the whole, or the picture follows the volume's extent.
    std::vector<Box> visible() {
        Header const& header = volume_.header();
        Box box = box_of(header.dims);
        auto const unseen = [&](Box const& part) {
            return difference_in_preview(cropped(part)) <= share_of_cut * request_.within;
        };
        for (int axis = 0; axis < 3; ++axis)
            for (bool const upper : {false, true}) {
                std::int64_t good = 0, bad = box.dims()[axis]; // slices to cut off
                if (bad < 4) continue;
                for (std::int64_t tried = bad / 2; bad - good > std::max<std::int64_t>(1, header.dims[axis] / 64);
                     tried = good + (bad - good) / 2) {
                    Box part = box;
                    (upper ? part.upper : part.lower)[axis] += upper ? -tried : tried;
                    (unseen(part) ? good : bad) = tried;
                }
                (upper ? box.upper : box.lower)[axis] += upper ? -good : good;
            }
        // What a preview leaves out, and what interpolates between voxels, may reach further.
        for (std::int64_t margin = 1; margin <= 8; margin *= 2) {
            Box const wider = intersect(grow(box, {margin, margin, margin}), box_of(header.dims));
            if (wider == box_of(header.dims)) return {};
            if (compared(reference_, chain_.run(cropped(wider), request_.execution)).max_abs <=
                share_of_cut * request_.within)
                return {wider};
        }
        return {};
    }

    /// The box that the operations read, for those that name places in the world; for those that count voxels with all
    /// that lies before it. None if that is the whole.
    std::vector<Box> read() {
        Box const whole = box_of(volume_.header().dims), box = chain_.part_read(volume_, request_.execution);
        std::vector<Box> boxes;
        for (Box const& part : {box, Box{whole.lower, box.upper}})
            if (!(part == whole) && (boxes.empty() || !(part == boxes.back()))) boxes.push_back(part);
        return boxes;
    }

    /// Whether the result of the operations has the same voxels at another resolution of the volume, so that it can be
    /// compared.
    bool keeps_its_lattice() {
        try {
            Volume const coarse = made(volume_, {{"resample", "--scale", "0.5"}});
            return same_place(chain_.output(coarse, request_.execution), reference_.header());
        } catch (Error const& e) {
            if (e.kind() != ErrorKind::usage) throw;
            return false;
        }
    }

    Volume cropped(Box const& part) const { return vkt::apply({"crop", "--roi", to_text(part)}, {volume_}); }

    /// Of volumes there is no preview but the whole.
    double difference_in_preview(Volume const& model) {
        if (!draws_) return compared(reference_, chain_.run(model, request_.execution)).max_abs;
        return compared(preview_, chain_.run(model, request_.execution, {false, preview_share})).max_abs;
    }

    DifferenceResult compared(Volume const& a, Volume const& b) const {
        auto const first = volume_source({a}), second = volume_source({b});
        first->next_volume();
        second->next_volume();
        return compare(*first, *second, request_.execution);
    }

    Found test(Volume const& model, Candidate const& candidate) {
        ++tried_;
        Found found;
        std::string said;
        try {
            DifferenceResult all;
            Volume result;
            if (draws_) all = compared(preview_, chain_.run(model, request_.execution, {false, preview_share}));
            if (!draws_ || all.max_abs <= hopeless * request_.within)
                all = compared(reference_, result = chain_.run(model, request_.execution));
            else
                said = " in a preview";
            bool const comparable = all.same_dims && (draws_ || all.same_geometry);
            found = {comparable && said.empty() && all.max_abs <= request_.within, all.max_abs, all.rmse, 0};
            if (draws_ && found.holds) found.flip = largest_flip(reference_, result);
            said = comparable ? text(short_number(all.max_abs), said) : std::string("of another extent");
        } catch (Error const& e) {
            if (e.kind() != ErrorKind::usage) throw;
            said = text("refused: ", e.what()); // what the pipeline cannot take is no model for it
        }
        if (request_.detail)
            request_.detail(text(bytes_text(static_cast<double>(candidate.bytes)), ": ", line_of(candidate.stages),
                                 ": ", found.holds ? "holds, " : "", said));
        return found;
    }

    /// The best model as bricks that are fine only where they have to be.
    void refine(Candidate& best, Volume& chosen, Found& measured) {
        Extremes const extremes = extremes_of(chosen);
        double const width = std::abs(chosen.header().values.slope) * (extremes.high - extremes.low);
        if (!(width > 0)) return;
        Candidate const grid = best;
        Volume const voxels = chosen;
        for (char const* const block : {"4", "8"})
            for (double tolerance = width / 8; tolerance >= width / 2048; tolerance /= 2) {
                Candidate candidate = grid;
                candidate.stages.push_back({"refine", "--tolerance", to_text(tolerance), "--block-size", block});
                Volume const tree = vkt::apply(candidate.stages.back(), {voxels});
                candidate.bytes = model_bytes(tree);
                if (candidate.bytes >= best.bytes) break; // finer ones are larger
                Found const found = test(tree, candidate);
                if (!found.holds) continue;
                best = candidate;
                chosen = tree;
                measured = found;
                break;
            }
    }

    double seconds(Volume const& volume) {
        std::array<double, 3> times{};
        for (double& time : times) {
            auto const start = std::chrono::steady_clock::now();
            chain_.run(volume, request_.execution);
            time = draws_ ? chain_.drawing()
                          : std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        }
        std::sort(times.begin(), times.end());
        return times[1];
    }

    Volume const& volume_;
    SlimRequest const& request_;
    Chain chain_;
    bool draws_;
    Volume reference_, preview_;
    std::vector<std::pair<Words, DataType>> types_;
    int tried_ = 0;
};

} // namespace

std::size_t model_bytes(Volume const& volume) {
    bool const tree = volume.header().kind == Kind::hierarchical;
    return volume.header().bytes() + (tree ? volume.bricks().bytes() : 0);
}

SlimModel slim(Volume const& volume, SlimRequest const& request) {
    if (6 * volume.header().bytes() > request.execution.memory)
        throw Error(ErrorKind::resources,
                    text("models are compared in memory: the volume takes ",
                         bytes_text(static_cast<double>(volume.header().bytes())), ", and a sixth of --memory is less"),
                    "raise --memory");
    return Search(volume, request).run();
}

} // namespace vkt::shell
