// What stands at the ends: terminals are refused for voxels, progress is drawn on them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <chrono>
#include <memory>
#include <string>

namespace vkt::shell {

bool input_is_terminal();
bool output_is_terminal();
bool errors_are_terminal();

/// Lines of prose and of two columns broken at spaces where they are wider; indented lines of one column, which are
/// commands, stay whole.
std::string wrapped(std::string const& text, std::size_t width);
/// Prints on standard output, wrapped to the terminal if it is one.
void print_text(std::string const& text);

/// One line on standard error that says how far a stage is: from half a second on, ten times a second at most; wiped in
/// the end. For one thread.
class ProgressLine {
public:
    explicit ProgressLine(std::string stage) : stage_(std::move(stage)) {}
    ProgressLine(ProgressLine const&) = delete;
    ProgressLine& operator=(ProgressLine const&) = delete;
    ~ProgressLine() { wipe(); }
    void show(std::string const& how_far);
    void wipe();

private:
    std::string stage_;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now(), last_ = begin_;
    bool drawn_ = false;
};

/// Draws how far the current volume is read on standard error, after half a second, and wipes it in the end.
std::unique_ptr<Source> with_progress(std::unique_ptr<Source> source, std::string stage);

} // namespace vkt::shell
