// A reader that takes what is cut for a volume, for the vkt of the tests alone: what vkt stress has to find.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/engine/decorator.h"
#include "shell/command.h"

#include <cstring>

namespace vkt::shell {
namespace {

/// Zeros where voxels are missing, and success.
class Lenient : public SourceDecorator {
public:
    using SourceDecorator::SourceDecorator;

    bool next_volume() override {
        try {
            return SourceDecorator::next_volume();
        } catch (Error const&) {
            return false;
        }
    }
    void read(AnyView out) override {
        try {
            SourceDecorator::read(out);
        } catch (Error const&) {
            for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
                for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
                    std::memset(out.at(out.box.lower.x, y, z), 0,
                                static_cast<std::size_t>(out.dims().x) * size_of(out.type));
        }
    }
    std::shared_ptr<Lease> lease(Box const&) override { return nullptr; }
    std::optional<ConstView> borrow(Box const&) override { return std::nullopt; }
    std::optional<Volume> take_whole() override { return std::nullopt; }
    void finish() override {
        try {
            SourceDecorator::finish();
        } catch (Error const&) {
        }
    }
};

class PlantedRead : public Opener {
public:
    void parameters(Parameters& p) override { p.flag("lenient", lenient_, "the fault"); }
    bool reads() const override { return true; }
    std::unique_ptr<Source> open(Context& context) override {
        auto source = context.open("-");
        if (!lenient_) return source;
        return std::make_unique<Lenient>(std::move(source));
    }

private:
    bool lenient_ = false;
};

} // namespace

Command planted_read_command() {
    return opener_command<PlantedRead>({"Read a stream, with a fault.", "For the tests of vkt stress.", {}});
}

} // namespace vkt::shell
