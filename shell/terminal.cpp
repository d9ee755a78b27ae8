// Terminals and progress.
// SPDX-License-Identifier: MIT
#include "shell/terminal.h"

#include "libvkt/core/text.h"

#include "libvkt/engine/decorator.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sys/ioctl.h>
#include <unistd.h>
#include <utility>

namespace vkt::shell {
namespace {

constexpr std::chrono::milliseconds before_first{500}, between{100};
constexpr std::size_t narrow_column = 20, narrow_indent = 6; ///< characters

class Progress : public SourceDecorator {
public:
    Progress(std::unique_ptr<Source> source, std::string stage)
        : SourceDecorator(std::move(source)), line_(std::move(stage)) {}

    bool next_volume() override {
        z_ = 0;
        ++volume_;
        return inner().next_volume();
    }
    void read(AnyView out) override {
        inner().read(out);
        show(out.box.upper.z);
    }
    std::optional<ConstView> borrow(Box const& region) override {
        show(region.upper.z);
        return inner().borrow(region);
    }
    std::shared_ptr<Lease> lease(Box const& region) override {
        show(region.upper.z);
        return inner().lease(region);
    }
    void finish() override {
        inner().finish();
        line_.wipe();
    }

private:
    void show(std::int64_t z) {
        z_ = std::max(z_, z);
        line_.show(text("volume ", volume_, ", ", std::lround(100.0 * static_cast<double>(z_) / depth()), " %"));
    }
    double depth() { return static_cast<double>(inner().header().dims.z); }

    ProgressLine line_;
    std::int64_t z_ = 0;
    int volume_ = 0;
};

} // namespace

void ProgressLine::show(std::string const& how_far) {
    auto const now = std::chrono::steady_clock::now();
    if (now - begin_ < before_first || now - last_ < between) return;
    last_ = now;
    std::fprintf(stderr, "\r%s: %s\033[K", stage_.c_str(), how_far.c_str());
    std::fflush(stderr);
    drawn_ = true;
}

void ProgressLine::wipe() {
    if (std::exchange(drawn_, false)) std::fputs("\r\033[K", stderr);
}

bool input_is_terminal() { return ::isatty(STDIN_FILENO) == 1; }
bool output_is_terminal() { return ::isatty(STDOUT_FILENO) == 1; }
bool errors_are_terminal() { return ::isatty(STDERR_FILENO) == 1; }

std::string wrapped(std::string const& text, std::size_t width) {
    std::string result;
    for (std::string line : split(text, '\n')) {
        // The second column begins after the first two spaces behind the first one's text.
        std::size_t const first = line.find_first_not_of(' ');
        std::size_t const gap = first == std::string::npos ? first : line.find("  ", first);
        std::size_t const second = gap == std::string::npos ? gap : line.find_first_not_of(' ', gap);
        bool const deep = first != std::string::npos && first > 8; // the second column alone
        bool const prose = first == 0, columns = deep || (!prose && second != std::string::npos);
        std::size_t indent = deep ? first : columns ? second : 0;
        if (indent + narrow_column >= width) { // no room beside the first column: the second goes on below it
            indent = std::min(indent, narrow_indent);
            if (deep) line.replace(0, first, indent, ' ');
        }
        while ((prose || columns) && line.size() > width) {
            std::size_t space = line.rfind(' ', width);
            if (space == std::string::npos || space <= indent) space = line.find(' ', indent + 1); // a long word
            std::size_t const rest = line.find_first_not_of(' ', space);
            if (space == std::string::npos || rest == std::string::npos) break;
            result += line.substr(0, line.find_last_not_of(' ', space) + 1) + "\n";
            line = std::string(indent, ' ') + line.substr(rest);
        }
        result += line + "\n";
    }
    result.pop_back(); // split() yields one piece more than there are line ends
    return result;
}

void print_text(std::string const& text) {
    winsize size{};
    bool const known = output_is_terminal() && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col >= 20;
    std::fputs(known ? wrapped(text, size.ws_col).c_str() : text.c_str(), stdout);
}

std::unique_ptr<Source> with_progress(std::unique_ptr<Source> source, std::string stage) {
    return std::make_unique<Progress>(std::move(source), std::move(stage));
}

} // namespace vkt::shell
