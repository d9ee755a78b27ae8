// vkt view: vkt render in a window, and nothing else.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace vkt::shell {

Command render_command(); // commands/render.cpp

namespace {

class View : public Consumer {
public:
    explicit View(std::unique_ptr<Consumer> render) : render_(std::move(render)) {}

    void parameters(Parameters& list) override {
        render_->parameters(list);
        std::erase_if(list.all(), [](Parameter const& p) { return std::ranges::count(of_files, p.name) > 0; });
    }
    void check() const override { render_->check(); }
    bool shows() const override { return true; }
    bool needs_whole() const override { return render_->needs_whole(); }
    bool runs_on_gpu() const override { return render_->runs_on_gpu(); }
    std::size_t bytes_held(Header const& header, std::string const& output) const override {
        return render_->bytes_held(header, output);
    }
    std::vector<std::string> explain(Header const& header, std::string const& output) const override {
        return render_->explain(header, output);
    }
    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        return render_->consume(inputs, context);
    }

private:
    /// What is for pictures that are written. There is a window without asking for one.
    static constexpr std::array<std::string_view, 12> of_files{"window",   "tolerance", "noise", "time",
                                                               "annotate", "caption",   "font",  "keyframes",
                                                               "frames",   "orbit",     "depth", "tiles"};

    std::unique_ptr<Consumer> render_;
};

} // namespace

Command view_command() {
    Command command;
    command.texts = {"Show a volume in a window: vkt render --window.",
                     "With the options of vkt render. Drag to turn it, h shows the keys, s saves the picture, p prints "
                     "the command that draws it.",
                     {{"What would be drawn", "vkt view volume.nrrd --explain -n"}}};
    command.consumer = [] { return std::make_unique<View>(render_command().consumer()); };
    return command;
}

} // namespace vkt::shell
