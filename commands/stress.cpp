// vkt stress: a pipeline on volumes that are made to break it.
// SPDX-License-Identifier: MIT
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "shell/command.h"
#include "shell/hard_volumes.h"
#include "shell/terminal.h"
#include "shell/trial.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <unistd.h>

namespace vkt::shell {
namespace {

namespace fs = std::filesystem;

struct Finding {
    std::string kind, what, repeat;
};

/// A folder that goes away with its contents.
class ScratchFolder {
public:
    ScratchFolder(std::string const& parent) {
        std::string name = parent + "/vkt-stress-XXXXXX";
        if (::mkdtemp(name.data()) == nullptr)
            throw Error(ErrorKind::io, text("cannot make a folder in '", parent, "'"));
        path_ = name;
    }
    ~ScratchFolder() {
        std::error_code ignored;
        fs::remove_all(path_, ignored);
    }
    ScratchFolder(ScratchFolder const&) = delete;
    ScratchFolder& operator=(ScratchFolder const&) = delete;
    std::string const& path() const { return path_; }

private:
    std::string path_;
};

void write_stream(Volume const& volume, Sink& sink, Execution const& execution) {
    auto const source = volume_source({volume});
    drain(*source, sink, execution);
}

class Stress : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.positional("pipeline", pipeline_, "stages from a volume on standard input on, quoted as one word").optional();
        p.option("volume", volume_, "NAME",
                 "write this volume of those that are tried to standard output, as a stream");
        p.flag("list", list_, "list the volumes");
        p.option("vkt", program_, "PROGRAM", "run this instead of the vkt that is running");
        p.option("timeout", timeout_, "SECONDS", "what takes longer hangs (20)");
    }
    void check() const override {
        int const asked = (pipeline_.empty() ? 0 : 1) + (volume_.empty() ? 0 : 1) + (list_ ? 1 : 0);
        if (asked != 1)
            throw Error(ErrorKind::usage, "one of a pipeline, --volume and --list is needed",
                        "e.g. vkt stress 'filter gaussian --sigma 2'");
        if (!(timeout_ > 0)) throw Error(ErrorKind::usage, text("--timeout ", timeout_, " is no time"));
    }
    int inputs() const override { return 0; }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>&, Context& context) override {
        context_ = &context;
        if (list_) {
            std::string names;
            for (auto const& name : hard_volume_names()) names += name + "\n";
            context.print(names);
            return 0;
        }
        if (!volume_.empty()) {
            if (output_is_terminal())
                throw Error(ErrorKind::usage, "refusing to write a binary volume to the terminal");
            ipc::StreamSink sink(STDOUT_FILENO, {});
            write_stream(hard_volume(volume_), sink, context.execution());
            return 0;
        }
        return stress();
    }

private:
    int stress() {
        for (auto& words : shell_stages(pipeline_)) {
            if (!words.empty() && words.front() == "vkt") words.erase(words.begin());
            if (words.empty()) throw Error(ErrorKind::usage, text("an empty stage in '", pipeline_, "'"));
            std::vector<std::string> quoted;
            for (auto const& word : words) quoted.push_back(shell_quoted(word));
            stages_.push_back(join(quoted, " "));
        }
        ScratchFolder const scratch(context_->execution().temporary_directory);
        folder_ = scratch.path();
        fs::create_directory(folder_ + "/out");
        fs::create_directory(folder_ + "/tmp");
        here_ = fs::current_path().string();
        std::string own = "vkt";
        if (program_.empty())
            program_ = fs::read_symlink("/proc/self/exe").string();
        else
            own = shell_quoted(program_);
        told_program_ = own;
        for (auto const& name : hard_volume_names()) try_volume(name);
        try_damaged("noise-uint16");
        try_full("noise-uint16");
        return tell();
    }

    std::string stages(std::string const& program, std::string const& options, std::string const& last) const {
        std::vector<std::string> parts;
        for (std::size_t i = 0; i < stages_.size(); ++i)
            parts.push_back(text(program, " ", stages_[i], options.empty() ? "" : " ", options,
                                 i + 1 == stages_.size() ? last : std::string()));
        return join(parts, " | ");
    }
    std::string repeat(std::string const& volume, std::string const& between, std::string const& options,
                       std::string const& last) const {
        return text("vkt stress --volume ", volume, " | ", between, stages(told_program_, options, last));
    }

    TrialResult run(std::string const& input, std::string const& options, std::string const& last,
                    std::optional<std::int64_t> limit = std::nullopt) {
        ++trials_;
        TrialOptions trial;
        trial.folder = here_; // files that the pipeline names are found
        trial.stdout_file = folder_ + "/stdout";
        trial.stderr_file = folder_ + "/stderr";
        trial.seconds = timeout_;
        trial.file_limit = limit;
        std::string const first = text("export TMPDIR=", shell_quoted(folder_ + "/tmp"), "; ");
        std::string line = stages(shell_quoted(program_), options, last);
        // The first stage reads the file; nothing else of the line changes.
        return try_line(text(first, "cat ", shell_quoted(input), " | ", line), trial);
    }

    void find(std::string kind, std::string what, std::string line) {
        // One of a kind and cause is enough: the first volume that shows it.
        findings_.push_back({std::move(kind), std::move(what), std::move(line)});
    }

    static std::string bytes_of(std::string const& path) {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    }

    /// What came out: voxels and what is needed to read them, or the text; nothing if it is not whole.
    std::optional<std::string> result_of(std::string const& path, std::optional<Volume>& volume) const {
        volume.reset();
        std::string bytes = bytes_of(path);
        if (!ipc::is_stream({reinterpret_cast<std::byte const*>(bytes.data()), bytes.size()})) return bytes;
        try {
            auto const source = context_->open(path);
            std::string all;
            while (source->next_volume()) {
                Volume const one = load(*source, context_->execution());
                Header const& h = one.header();
                all += text(to_text(h.dims), " ", h.dtype, " ", h.values.slope, " ", h.values.intercept, "\n");
                if (h.kind == Kind::structured) {
                    auto const view = one.view();
                    all.append(reinterpret_cast<char const*>(view.data), h.bytes());
                } else {
                    all.append(reinterpret_cast<char const*>(one.buffer().read(Space::host)), h.bytes());
                }
                volume = one;
            }
            return all;
        } catch (Error const&) {
            return std::nullopt;
        }
    }

    bool judge(std::string const& volume, TrialResult const& result, std::string const& options) {
        std::string const line = repeat(volume, "", options, " >out.vkt");
        if (result.hung) {
            find("hangs", text("no end after ", timeout_, " s"), line);
            return false;
        }
        if (auto const code = result.crash()) {
            find("crashes", *code > 128 ? text("killed by signal ", *code - 128) : text("exit code ", *code), line);
            return false;
        }
        return true;
    }

    void look_for_remains(std::string const& line, std::string const& after) {
        for (char const* const name : {"/out", "/tmp"}) {
            std::vector<std::string> left;
            for (auto const& entry : fs::directory_iterator(folder_ + name))
                left.push_back(entry.path().filename().string());
            if (left.empty()) continue;
            find("leaves files", text(after, ": '", printable(join(left, "', '")), "'"), line);
            for (auto const& one : left) fs::remove_all(folder_ + name + "/" + one);
        }
    }

    void try_volume(std::string const& name) {
        std::string const input = folder_ + "/in.vkt", out = folder_ + "/stdout";
        Volume const volume = hard_volume(name);
        {
            auto const sink = ipc::create_stream_file(input, true, true);
            write_stream(volume, *sink, context_->execution());
        }
        TrialResult const plain = run(input, "", "");
        if (!judge(name, plain, "")) return;
        std::optional<Volume> made, other;
        std::optional<std::string> const expected = result_of(out, made);
        if (plain.ok() && !expected)
            find("not whole", "exit code 0, but the output is cut", repeat(name, "", "", " | vkt info"));
        look_for_remains(repeat(name, "", "", " >out.vkt"), "temporary files after the end");
        if (plain.ok() && made) look_for_wraps(name, volume, *made);
        for (char const* const options :
             {"--slab 1", "--threads 1", "--threads 5", "--transport shm", "--memory 1MiB"}) {
            TrialResult const varied = run(input, options, "");
            bool const understood = varied.codes.empty() || varied.codes.back() != 2 || plain.codes.back() == 2;
            if (!understood) continue; // the stage has no such option
            if (!judge(name, varied, options)) continue;
            bool const refused =
                !varied.codes.empty() && *std::max_element(varied.codes.begin(), varied.codes.end()) == 5;
            if (std::string_view(options) == "--memory 1MiB" && refused) continue;
            if (varied.ok() != plain.ok())
                find("changes", varied.ok() ? text("fails, but not with ", options) : text("fails with ", options),
                     repeat(name, "", options, " >out.vkt"));
            else if (varied.ok() && result_of(out, other) != expected)
                find("changes", text("another result with ", options), repeat(name, "", options, " >out.vkt"));
        }
    }

    /// Integers beside the same in float64: half of a type's range away is no rounding.
    void look_for_wraps(std::string const& name, Volume const& input, Volume const& made) {
        Header const& h = made.header();
        if (!is_integer(input.header().dtype) || !is_integer(h.dtype) || h.kind != Kind::structured) return;
        std::string const wide = folder_ + "/wide.vkt";
        {
            auto const sink = ipc::create_stream_file(wide, true, true);
            write_stream(vkt::apply({"convert", "--dtype", "float64"}, {input}), *sink, context_->execution());
        }
        std::optional<Volume> exact;
        if (!run(wide, "", "").ok() || !result_of(folder_ + "/stdout", exact) || !exact) return;
        if (!(exact->header().dims == h.dims) || exact->header().kind != Kind::structured) return;
        Volume const a = vkt::apply({"convert", "--dtype", "float64"}, {made}),
                     b = vkt::apply({"convert", "--dtype", "float64"}, {*exact});
        auto const* const found = reinterpret_cast<double const*>(a.view().data);
        auto const* const wanted = reinterpret_cast<double const*>(b.view().data);
        double const low = lowest_of(h.dtype), high = highest_of(h.dtype);
        for (std::int64_t i = 0; i < h.voxels(); ++i) {
            double const stored = h.values.stored(exact->header().values.physical(wanted[i]));
            if (!std::isfinite(stored)) continue;
            double const nearest = std::clamp(stored, low, high);
            if (std::abs(nearest - found[i]) <= 0.5 * (high - low)) continue;
            find("wraps", text("voxel ", i, " is ", found[i], " in ", h.dtype, ", ", stored, " in float64"),
                 text(repeat(name, "", "", " | vkt dump"), "  # beside: vkt convert --dtype float64 before"));
            return;
        }
    }

    void try_damaged(std::string const& name) {
        std::string const whole = folder_ + "/whole.vkt", cut = folder_ + "/cut.vkt";
        {
            auto const sink = ipc::create_stream_file(whole, true, true);
            write_stream(hard_volume(name), *sink, context_->execution());
        }
        if (!run(whole, "", "").ok()) return;
        std::optional<Volume> volume;
        std::string const good = bytes_of(folder_ + "/stdout");
        bool const streams = ipc::is_stream({reinterpret_cast<std::byte const*>(good.data()), good.size()});
        std::string const bytes = bytes_of(whole);
        std::string const last = streams ? " -o " + shell_quoted(folder_ + "/out/out.vkt") : "";
        auto const attempt = [&](std::string const& damaged, std::string const& how, std::string const& between) {
            std::ofstream(cut, std::ios::binary) << damaged;
            TrialResult const result = run(cut, "", last);
            std::string const line = repeat(name, between, "", streams ? " -o out.vkt" : "");
            if (result.hung)
                find("hangs", how, line);
            else if (result.crash())
                find("crashes", how, line);
            else if (result.codes.back() == 0)
                find("takes damaged input", text("exit code 0 for ", how), line);
            look_for_remains(line, text("after ", how));
        };
        for (double const share : {0.0, 0.1, 0.5, 0.9, 0.999}) {
            auto const n = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
            attempt(bytes.substr(0, n), text("a stream cut at byte ", static_cast<std::uint64_t>(n)),
                    text("head -c ", static_cast<std::uint64_t>(n), " | "));
        }
        std::string flipped = bytes;
        std::size_t const middle = bytes.size() / 2;
        flipped[middle] = static_cast<char>(flipped[middle] ^ 16);
        attempt(flipped, "a stream with a flipped bit",
                text("perl -0777 -pe 'substr($_, ", static_cast<std::uint64_t>(middle), ", 1) ^= chr 16' | "));
    }

    void try_full(std::string const& name) {
        std::string const whole = folder_ + "/whole.vkt";
        if (!run(whole, "", "").ok()) return;
        auto const attempt = [&](std::string const& last, std::string const& told, std::string const& how,
                                 std::optional<std::int64_t> limit) {
            TrialResult const result = run(whole, "", last, limit);
            std::string const line = text(limit ? "ulimit -f 1; " : "", repeat(name, "", "", told));
            if (result.hung)
                find("hangs", how, line);
            else if (result.crash())
                find("crashes", how, line);
            else if (result.codes.back() == 0)
                find("ignores a full disk", how, line);
            look_for_remains(line, how);
        };
        attempt(" >/dev/full", " >/dev/full", "standard output is full", std::nullopt);
        std::string const bytes = bytes_of(folder_ + "/stdout");
        std::optional<Volume> made;
        if (!run(whole, "", "").ok() || !result_of(folder_ + "/stdout", made) || !made) return;
        if (made->header().bytes() > 1024)
            attempt(" -o " + shell_quoted(folder_ + "/out/out.vkt"), " -o out.vkt", "files of 1 KiB at most", 1024);
    }

    int tell() const {
        if (context_->json()) {
            std::vector<Report> rows;
            for (auto const& f : findings_)
                rows.push_back(Report().add("kind", f.kind).add("what", f.what).add("repeat", f.repeat));
            Report report;
            report.add("pipeline", pipeline_).add("volumes", static_cast<std::int64_t>(hard_volume_names().size()));
            report.add("trials", trials_).add("findings", std::move(rows));
            context_->print(report.json() + "\n");
        } else {
            std::string all;
            for (auto const& f : findings_) all += text(f.kind, ": ", f.what, "\n  ", f.repeat, "\n");
            all += text(trials_, " runs on ", static_cast<std::int64_t>(hard_volume_names().size()), " volumes: ",
                        findings_.empty() ? std::string("nothing found")
                                          : text(static_cast<std::int64_t>(findings_.size()), " found"),
                        "\n");
            context_->print(all);
        }
        return findings_.empty() ? 0 : 1;
    }

    std::string pipeline_, volume_, program_;
    bool list_ = false;
    double timeout_ = 20;
    Context* context_ = nullptr;
    std::string folder_, here_, told_program_;
    std::vector<std::string> stages_;
    std::vector<Finding> findings_;
    std::int64_t trials_ = 0;
};

} // namespace

Command stress_command() {
    return consumer_command<Stress>(
        {"Run a pipeline on volumes made to break it.",
         "Constants, single voxels, NaN, infinities, offsets, denormals, extremes of every type, mirrored and oblique "
         "frames; slabs of one slice, one and five threads, both transports, little memory; cut and damaged streams, a "
         "full disk. What changes, crashes, hangs, wraps, takes damage for data or leaves files is told with the "
         "command "
         "that repeats it, and makes exit code 1.",
         {{"A filter", "vkt stress 'filter gaussian --sigma 1'"},
          {"A pipeline of one's own", "vkt stress 'flip x | resample --scale 0.5' --json"},
          {"One of its volumes", "vkt stress --volume nan-float32 | vkt stats"}}});
}

} // namespace vkt::shell
