// A runner: stages that several GPUs work on at once, each on instances of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/divided.h"
#include "shell/named_files.h"
#include "shell/run/runner.h"
#include "shell/run/stage_error.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <utility>

namespace vkt::shell {
namespace {

/// The stage once more, with what was chosen for it since it was parsed.
void repeat(Invocation& stage, std::deque<Invocation>& to) {
    Invocation& twin =
        to.emplace_back(stage.verb(), stage.label().empty() ? Invocation::Place::process : Invocation::Place::pipeline);
    twin.parse();
    for (Parameter const& parameter : stage.own_parameters().all()) {
        Parameter const* const same = twin.own_parameters().find(parameter.name);
        if (same != nullptr && same->get() != parameter.get())
            twin.own_parameters().set(parameter.name, parameter.flag ? std::vector<std::string>{} : parameter.get());
    }
}

/// Files can be read by several at once; what arrives through a pipe comes once.
bool can_be_opened_again(Invocation& stage) {
    auto const names = input_names(stage);
    return !names.empty() && std::ranges::all_of(names, [](std::string const& name) {
        std::error_code error;
        auto const status = std::filesystem::status(name, error);
        return std::filesystem::is_regular_file(status) || std::filesystem::is_directory(status);
    });
}

} // namespace

int Runner::gpus() const {
    int least = std::numeric_limits<int>::max();
    bool computes = false;
    for (Invocation const& stage : stages_) {
        if (stage.consumer() != nullptr) break;
        if (stage.operation() == nullptr) continue;
        computes = true;
        least = std::min(least, stage.common().execution().gpus);
    }
    return computes && !dry_run_ ? least : 1;
}

std::unique_ptr<Source> Runner::build_divided() {
    shares_ = gpus();
    if (shares_ == 1) return nullptr;
    std::unique_ptr<SharedInput> shared;
    std::vector<Share> shares;
    for (share_ = 0; share_ < shares_; ++share_) {
        if (share_ > 0) twins_.emplace_back();
        Share share;
        for (Invocation& stage : stages_) {
            if (stage.consumer() != nullptr) break;
            refuse_unread(stage);
            if (share_ > 0) repeat(stage, twins_.back());
            Invocation& own = share_ > 0 ? twins_.back().back() : stage;
            bool const begins = &stage == &stages_.front();
            bool const arrives =
                begins && (own.opener() != nullptr || !own.inputs().empty()) && !can_be_opened_again(own);
            in_stage(stage.label(), [&] {
                if (!arrives) {
                    share.source = build(own, std::move(share.source));
                    return;
                }
                if (own.operation() != nullptr && own.inputs().size() > 1)
                    throw Error(ErrorKind::usage, "--device gpu:all: of several inputs all have to be files",
                                "write what arrives through a pipe to a file first, or use --device gpu");
                if (!shared) {
                    auto source = own.opener() != nullptr ? build(own, nullptr) : open(own, own.inputs().front());
                    shared = std::make_unique<SharedInput>(std::move(source), stage.common().execution());
                }
                share.source = own.opener() != nullptr ? shared->reader() : build(own, shared->reader());
            });
            if (own.operation() != nullptr) share.operations.push_back(own.operation());
        }
        shares.push_back(std::move(share));
    }
    Execution const all = last_.common().execution();
    shares_ = 1;
    share_ = 0;
    return divided(std::move(shares), all);
}

} // namespace vkt::shell
