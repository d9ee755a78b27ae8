// Files that hold several arrays of which nobody chose one.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/choices.h"

#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"

#include <optional>

namespace vkt {
namespace {

class BesideOthers : public SourceDecorator {
public:
    BesideOthers(std::unique_ptr<Source> source, std::vector<std::string> others)
        : SourceDecorator(std::move(source)), others_(std::move(others)) {}

    std::vector<std::string> not_read() const override {
        std::vector<std::string> all = SourceDecorator::not_read();
        all.insert(all.end(), others_.begin(), others_.end());
        return all;
    }

private:
    std::vector<std::string> others_;
};

class Unchosen : public BesideOthers {
public:
    Unchosen(std::unique_ptr<Source> first, Choices choices, Error refusal)
        : BesideOthers(std::move(first), std::move(choices.not_read)), names_(std::move(choices.names)),
          refusal_(std::move(refusal)) {}

    bool next_volume() override {
        if (!BesideOthers::next_volume()) return false;
        header_ = inner().header();
        std::string all;
        for (auto const& [name, about] : names_) {
            all += text(all.empty() ? "" : " ", name);
            header_.attributes["variable " + name] = about;
        }
        header_.attributes["variables"] = all;
        return true;
    }
    Header const& header() const override { return header_; }
    void read(AnyView /*out*/) override { throw refusal_; }
    std::optional<ConstView> borrow(Box const& /*region*/) override { return std::nullopt; }
    std::shared_ptr<Lease> lease(Box const& /*region*/) override { return nullptr; }
    std::optional<Volume> take_whole() override { return std::nullopt; }
    void finish() override {}

private:
    std::vector<std::pair<std::string, std::string>> names_;
    Error refusal_;
    Header header_;
};

} // namespace

std::string about_array(DataType type, std::vector<std::int64_t> const& extents) {
    std::string shape;
    for (std::int64_t const n : extents) shape += text(shape.empty() ? "" : " x ", n);
    return text(type, ", ", shape);
}

std::unique_ptr<Source> unchosen(std::unique_ptr<Source> first, Choices choices, Error refusal) {
    return std::make_unique<Unchosen>(std::move(first), std::move(choices), std::move(refusal));
}

std::unique_ptr<Source> beside_others(std::unique_ptr<Source> source, std::vector<std::string> not_read) {
    if (not_read.empty()) return source;
    return std::make_unique<BesideOthers>(std::move(source), std::move(not_read));
}

} // namespace vkt
