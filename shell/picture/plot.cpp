// Plots: a script for gnuplot, which reads it from memory and writes to memory.
// SPDX-License-Identifier: MIT
#include "shell/picture/plot.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <spawn.h>
#include <string_view>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

namespace vkt::shell {
namespace {

/// Memory that another process reads or writes as a file.
class MemoryFile {
public:
    MemoryFile() : descriptor_(::memfd_create("plot", MFD_CLOEXEC)) {
        if (descriptor_ < 0) throw Error(ErrorKind::resources, "no memory for a plot");
    }
    ~MemoryFile() { ::close(descriptor_); }
    MemoryFile(MemoryFile const&) = delete;
    MemoryFile& operator=(MemoryFile const&) = delete;
    int descriptor() const { return descriptor_; }
    void put(std::string_view words) {
        for (std::size_t done = 0; done < words.size();) {
            ssize_t const n = ::write(descriptor_, words.data() + done, words.size() - done);
            if (n < 0) throw Error(ErrorKind::resources, "no memory for a plot");
            done += static_cast<std::size_t>(n);
        }
        ::lseek(descriptor_, 0, SEEK_SET);
    }
    std::string content() const {
        std::string bytes(static_cast<std::size_t>(::lseek(descriptor_, 0, SEEK_END)), '\0');
        std::size_t done = 0;
        while (done < bytes.size()) {
            ssize_t const n = ::pread(descriptor_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
            if (n <= 0) throw Error(ErrorKind::io, "a plot in memory cannot be read");
            done += static_cast<std::size_t>(n);
        }
        return bytes;
    }

private:
    int descriptor_;
};

std::string path_of_gnuplot() {
    char const* const path = std::getenv("PATH");
    for (auto const& folder : split(path != nullptr ? path : "/usr/bin", ':')) {
        std::string const file = text(folder.empty() ? "." : folder, "/gnuplot");
        std::error_code ignored;
        if (::access(file.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(file, ignored)) return file;
    }
    return {};
}

std::string run_gnuplot(std::string const& script) {
    std::string const program = path_of_gnuplot();
    if (program.empty())
        throw Error(ErrorKind::resources, "gnuplot, which draws charts, is not installed",
                    "install it (on Debian: gnuplot-nox), or write a table: -o chart.csv");
    MemoryFile in, out, errors;
    in.put(script);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, in.descriptor(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, out.descriptor(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, errors.descriptor(), STDERR_FILENO);
    std::string name = "gnuplot", plain = "--default-settings";
    char* const arguments[] = {name.data(), plain.data(), nullptr};
    pid_t child = 0;
    int const failed = ::posix_spawn(&child, program.c_str(), &actions, nullptr, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed != 0) throw Error(ErrorKind::resources, text("'", printable(program), "' cannot be started"));
    int status = 0;
    while (::waitpid(child, &status, 0) < 0)
        if (errno != EINTR) throw Error(ErrorKind::resources, "gnuplot was lost");
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        auto const lines = split(errors.content(), '\n');
        auto const last = std::find_if(lines.rbegin(), lines.rend(), [](auto const& line) { return !line.empty(); });
        throw Error(ErrorKind::resources,
                    text("gnuplot failed", last != lines.rend() ? text(": ", printable(*last)) : std::string()));
    }
    return out.content();
}

/// As gnuplot takes it literally.
std::string quoted(std::string const& words) {
    std::string result = "'";
    for (char const c : printable(words)) result += c == '\'' ? "''" : std::string(1, c);
    return result + "'";
}

/// Where values lie on a logarithmic axis: zeros and infinities a step beyond all others.
class Heights {
public:
    explicit Heights(std::vector<PlotPoint> const& points) {
        double least = std::numeric_limits<double>::infinity(), most = 0;
        auto const meet = [&](double y) {
            zeros_ = zeros_ || !(y > 0);
            if (!(y > 0) || !std::isfinite(y)) return;
            least = std::min(least, y);
            most = std::max(most, y);
        };
        for (auto const& p : points) {
            meet(p.y);
            if (p.predicted_y) meet(*p.predicted_y);
        }
        if (!(most > 0)) least = most = 1;
        floor_ = std::pow(10, std::floor(std::log10(least)) - 1);
        ceiling_ = std::min(10 * most, 1e300);
    }
    double at(double y) const { return !(y > 0) ? floor_ : std::isfinite(y) ? y : ceiling_; }
    bool zeros() const { return zeros_; }
    double floor() const { return floor_; }

private:
    bool zeros_ = false;
    double floor_ = 0, ceiling_ = 0;
};

/// Where labels stand, in letters and lines of a plot; the axes go from decade to decade.
class Page {
public:
    Page(std::vector<PlotPoint> const& points, Heights const& heights) {
        auto const meet = [](Range& range, double value) {
            range.low = std::min(range.low, std::floor(std::log10(value)));
            range.high = std::max(range.high, std::ceil(std::log10(value)));
        };
        for (auto const& p : points) {
            meet(x_, p.x);
            meet(y_, heights.at(p.y));
            if (p.predicted_x) meet(x_, *p.predicted_x);
            if (p.predicted_y) meet(y_, heights.at(*p.predicted_y));
        }
    }
    /// False if a label would lie over one before.
    bool takes(double x, double y, std::size_t letters, bool ends_there) {
        double const column = x_.share(x) * 130, line = y_.share(y) * 36, wide = static_cast<double>(letters);
        Label const label{ends_there ? column - wide : column, ends_there ? column : column + wide, line};
        for (auto const& other : labels_)
            if (std::abs(other.line - line) < 1 && label.begin < other.end + 1 && other.begin < label.end + 1)
                return false;
        labels_.push_back(label);
        return true;
    }

private:
    struct Range {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        double share(double value) const { return (std::log10(value) - low) / std::max(1.0, high - low); }
    };
    struct Label {
        double begin, end, line;
    };
    Range x_, y_;
    std::vector<Label> labels_;
};

constexpr char const* blue = "'#3361a6'";
constexpr char const* grey = "'#a0a0a0'";
constexpr char const* red = "'#cc261f'";

/// Points of a kind, and how they are drawn.
struct Series {
    std::string name, rows, style;
};

std::string script_of(Plot const& plot, PlotFormat format) {
    bool const letters = format == PlotFormat::terminal;
    Heights const heights(plot.points);
    Series front{"front", "", text("with points pt ", letters ? "'*'" : "7", " lc rgb ", blue, " title 'front'")};
    Series wrong{"wrong", "",
                 text("with points pt ", letters ? "'!'" : "7", " lc rgb ", red, " title 'error above its bound'")};
    Series other{"other", "",
                 text("with points pt ", letters ? "'o'" : "7", " lc rgb ", grey, " title 'other settings'")};
    Series predicted{"predicted", "", text("using 3:4 with points pt 6 lc rgb ", grey, " title 'predicted'")};
    Series links{"links", "", text("using 1:2:($3-$1):($4-$2) with vectors nohead lc rgb ", grey, " notitle")};
    Series steps{"steps", "", text("with steps lw 1.5 lc rgb ", blue, " notitle")};

    std::string labels;
    std::vector<PlotPoint> sorted = plot.points;
    std::stable_sort(sorted.begin(), sorted.end(), [](auto const& a, auto const& b) { return a.x < b.x; });
    Page page(sorted, heights);
    double const middle = std::sqrt(sorted.front().x * sorted.back().x);
    for (auto const& p : sorted) {
        std::string const row = text(p.x, " ", heights.at(p.y));
        (p.wrong ? wrong : p.front ? front : other).rows += row + "\n";
        if (p.front) {
            steps.rows += row + "\n";
            bool const right = p.x > middle;
            if (!page.takes(p.x, heights.at(p.y), p.label.size(), right)) continue;
            labels += text("set label ", quoted(p.label), " at ", p.x, ",", heights.at(p.y), right ? " right" : " left",
                           " offset char ", right ? "-0.8" : "0.8", ",0.6 font ',9'\n");
        }
        if (p.predicted_x || p.predicted_y) {
            std::string const ends =
                text(row, " ", p.predicted_x.value_or(p.x), " ", heights.at(p.predicted_y.value_or(p.y)), "\n");
            links.rows += ends;
            predicted.rows += ends;
        }
    }

    std::string script = format == PlotFormat::svg
                             ? "set terminal svg size 900,560 noenhanced font 'sans,12' background '#ffffff'\n"
                         : format == PlotFormat::png
                             ? "set terminal pngcairo size 900,560 noenhanced font 'sans,11' background '#ffffff'\n"
                             : "set terminal dumb size 79,22 noenhanced\n";
    script += text("set logscale xy\nset format x ", quoted(text("%.0s %c", plot.x_unit)), "\nset format y '%g'\n",
                   "set border 3\nset tics nomirror\nset key below samplen 1\nset title ", quoted(plot.title), "\n",
                   "set xlabel ", quoted(plot.x_label), "\nset ylabel ", quoted(plot.y_label), "\n");
    if (!letters) script += text("set grid lt 1 lc rgb '#e0e0e0'\n", labels);
    if (heights.zeros()) script += text("set ytics add ('0' ", heights.floor(), ")\n");
    std::string plotted;
    for (auto const* const series : {&steps, &links, &predicted, &other, &front, &wrong}) {
        if (series->rows.empty() || (letters && (series == &steps || series == &links || series == &predicted)))
            continue;
        script += text("$", series->name, " << EOD\n", series->rows, "EOD\n");
        plotted += text(plotted.empty() ? "plot $" : ", $", series->name, " ", series->style);
    }
    return text(script, plotted, "\n");
}

} // namespace

bool can_plot() { return !path_of_gnuplot().empty(); }

std::string drawn(Plot const& plot, PlotFormat format) {
    std::string const picture = run_gnuplot(script_of(plot, format));
    if (picture.empty()) throw Error(ErrorKind::resources, "gnuplot drew nothing");
    return picture;
}

} // namespace vkt::shell
