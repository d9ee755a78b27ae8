// Selections of volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/volume_selection.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace vkt {

namespace {

class SelectedVolumes : public SourceDecorator {
public:
    SelectedVolumes(std::unique_ptr<Source> source, VolumeRange range)
        : SourceDecorator(std::move(source)), range_(range), wanted_(range.first) {}

    bool next_volume() override {
        if (range_.end && wanted_ >= *range_.end) {
            pass_over_rest();
            return false;
        }
        while (number_ < wanted_) {
            if (number_ >= 0 && !std::exchange(finished_, true)) inner().finish();
            if (!inner().next_volume()) return end();
            finished_ = false;
            ++number_;
        }
        wanted_ += range_.step;
        further_.reset();
        if (auto const step = step_of(inner().header()); step && range_.step > 1) {
            further_ = inner().header();
            further_->attributes["sequence step"] = to_text(*step * static_cast<double>(range_.step));
        }
        return true;
    }
    Header const& header() const override { return further_ ? *further_ : inner().header(); }
    bool rewind() override {
        if (!SourceDecorator::rewind()) return false;
        number_ = -1;
        wanted_ = range_.first;
        finished_ = true;
        return true;
    }
    std::optional<Volume> take_whole() override {
        if (further_) return std::nullopt; // it has the step of all volumes
        std::optional<Volume> whole = inner().take_whole();
        finished_ = finished_ || whole;
        return whole;
    }
    void finish() override {
        inner().finish();
        finished_ = true;
    }
    std::int64_t parts_to_come() const override { return 0; } // not all of them do

private:
    /// How far apart the volumes of the source lie in time, where it says so.
    static std::optional<double> step_of(Header const& header) {
        auto const found = header.attributes.find("sequence step");
        if (found == header.attributes.end() || !is_number(found->second)) return std::nullopt;
        return parse_double(found->second);
    }
    /// The source has ended: after volumes that were asked for, or before.
    bool end() {
        std::int64_t const count = number_ + 1, needed = range_.end.value_or(range_.first + 1);
        if (count >= needed) return false;
        throw Error(ErrorKind::usage,
                    text("--index ", ValueText<VolumeRange>::write(range_).front(), ": there ",
                         count == 1 ? "is 1 volume" : text("are ", count, " volumes"), ", counted from 0"));
    }
    void pass_over_rest() {
        if (number_ < 0 || inner().access() == Access::random) return;
        while (inner().next_volume()) inner().finish();
    }

    VolumeRange range_;
    std::optional<Header> further_; ///< of volumes that are further apart
    std::int64_t number_ = -1;      ///< of the source's current volume
    std::int64_t wanted_;           ///< that is next
    bool finished_ = true;          ///< the current one, or it was had whole
};

} // namespace

VolumeRange ValueText<VolumeRange>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> const parts = split(w.front(), ':');
    auto const refuse = [&](std::string const& what) {
        return Error(ErrorKind::usage, text(name, " '", w.front(), "' ", what), "N, A:B or A:B:S, counted from 0");
    };
    auto const number = [&](std::string const& part, std::int64_t otherwise) {
        if (part.empty()) return otherwise;
        std::int64_t const n = ValueText<std::int64_t>::read({part}, name);
        if (n < 0) throw refuse("counts from the end, which is not known before it is read");
        return n;
    };
    if (parts.size() > 3 || w.front().empty()) throw refuse("is no range of volumes");
    VolumeRange range;
    range.first = number(parts[0], 0);
    if (parts.size() == 1) {
        range.end = range.first + 1;
        return range;
    }
    if (!parts[1].empty()) range.end = number(parts[1], 0);
    if (parts.size() == 3) range.step = number(parts[2], 1);
    if (range.step < 1 || (range.end && *range.end <= range.first)) throw refuse("holds no volume");
    return range;
}

std::vector<std::string> ValueText<VolumeRange>::write(VolumeRange const& v) {
    if (v.end == v.first + 1) return {to_text(v.first)};
    return {text(v.first, ":", v.end ? to_text(*v.end) : "", v.step == 1 ? "" : text(":", v.step))};
}

std::unique_ptr<Source> selected(std::unique_ptr<Source> source, VolumeRange range) {
    return std::make_unique<SelectedVolumes>(std::move(source), range);
}

} // namespace vkt
