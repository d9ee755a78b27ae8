// Trials: the plain run first, then the same with other slabs, threads, transports and budgets, damage and full disks.
// SPDX-License-Identifier: MIT
#include "shell/stress/stress.h"

#include "ipc/stream.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/verifiable.h"
#include "libvkt/io/temporaries.h"
#include "shell/chart/chain.h"
#include "shell/stress/damage.h"
#include "shell/stress/hard_volumes.h"
#include "shell/stress/trial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>

namespace vkt::shell {
namespace {

namespace fs = std::filesystem;

/// A folder that goes away with its contents, however the process ends.
class ScratchFolder {
public:
    explicit ScratchFolder(std::string const& parent) : path_(parent + "/vkt-stress-XXXXXX") {
        if (::mkdtemp(path_.data()) == nullptr)
            throw Error(ErrorKind::io, text("cannot make a folder in '", parent, "'"));
        guard_.emplace(path_);
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
    std::optional<Guard> guard_{};
};

std::string bytes_of(std::string const& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

bool is_stream(std::string const& bytes) {
    return ipc::is_stream({reinterpret_cast<std::byte const*>(bytes.data()), bytes.size()});
}

/// A way of running that must not change the result: what feeds the pipeline, options of every stage, what follows.
struct Variation {
    char const* options;
    bool reads_again = false; ///< a last stage takes the stream in, so that its transport has two ends
    bool may_refuse = false;  ///< exit code 5 is in order

    bool piecemeal() const { return *options == '\0'; }
    std::string told() const { return piecemeal() ? "a stream that comes in pieces" : options; }
};

constexpr std::array<Variation, 6> variations{
    {{"--slab 1"}, {"--threads 1"}, {"--threads 5"}, {"--transport shm", true}, {"--memory 1MiB", false, true}, {""}}};

/// What feeds a stream of so many bytes in pieces: single bytes, where that takes no seconds.
std::string feeder_for(std::uintmax_t bytes) { return text("dd bs=", bytes < 65536 ? 1 : 4093, " status=none"); }

/// Largest magnitude whose sums and differences the type holds, too.
double most_of_sums(DataType type) { return type == DataType::float16 ? highest_of(type) : highest_of(type) * 0x1p-20; }

template <class Is> bool all_of_values(Volume const& volume, Is is) {
    Volume const wide = in_float64(volume);
    auto const* const values = reinterpret_cast<double const*>(wide.view().data);
    return std::all_of(values, values + wide.header().voxels(), is);
}

/// Bounds are about numbers, and of types of floats about those whose sums and differences the type holds, too.
bool has_bounded_sums(Volume const& volume) {
    DataType const type = volume.header().dtype;
    return is_integer(type) ||
           all_of_values(volume, [most = most_of_sums(type)](double v) { return std::abs(v) <= most; });
}

/// Some floats are no numbers; the others are as those of has_bounded_sums().
bool has_nan_alone(Volume const& volume) {
    double const most = most_of_sums(volume.header().dtype);
    return !has_bounded_sums(volume) &&
           all_of_values(volume, [&](double v) { return std::isnan(v) || std::abs(v) <= most; });
}

class Trials {
public:
    Trials(StressRequest const& request, Context& context)
        : request_(request), context_(context), scratch_(context.execution().temporary_directory),
          here_(fs::current_path().string()), in_(scratch_.path() + "/in.vkt"), out_(scratch_.path() + "/stdout") {
        for (auto& words : shell_stages(request.pipeline)) {
            if (!words.empty() && words.front() == "vkt") words.erase(words.begin());
            if (words.empty()) throw Error(ErrorKind::usage, text("an empty stage in '", request.pipeline, "'"));
            find_verb(words);
            for (auto const& word : words)
                if (word == "-o" || word.starts_with("--output"))
                    throw Error(ErrorKind::usage,
                                text("'", join(words, " "), "': vkt stress itself looks at the output"),
                                text("leave out ", word));
            stages_.push_back(join(collect(words, [](std::string const& word) { return shell_quoted(word); }), " "));
        }
        fs::create_directory(scratch_.path() + "/out");
        fs::create_directory(scratch_.path() + "/tmp");
        program_ = shell_quoted(request.program.empty() ? fs::read_symlink("/proc/self/exe").string()
                                                        : fs::absolute(request.program).string());
        told_program_ = request.program.empty() ? "vkt" : shell_quoted(request.program);
        try {
            chain_.emplace(request.pipeline);
        } catch (Error const&) {
            // No operations alone, or of several volumes: what runs beside it in float64 is not known.
        }
    }

    StressReport run() {
        for (auto const& name : request_.volumes) try_volume(name);
        if (worked_ == 0 && report_.refusals.empty()) return std::move(report_); // it crashes or hangs at all of them
        if (worked_ == 0) {
            // What never works has not been tried.
            Finding const& first = report_.refusals.front();
            find("never works", "", first.what, first.repeat, first.volume);
            return std::move(report_);
        }
        try_damaged(request_.volumes.front());
        try_full(request_.volumes.front());
        return std::move(report_);
    }

private:
    std::string stages(std::string const& program, std::string const& options, std::string const& last) const {
        std::vector<std::string> parts;
        for (auto const& stage : stages_)
            parts.push_back(text(program, " ", stage, options.empty() ? "" : " ", options));
        return join(parts, " | ") + last;
    }

    std::string line_for(std::string const& volume, std::string const& between, std::string const& options,
                         std::string const& last) const {
        return text("vkt stress --volume ", volume, " | ", between, stages(told_program_, options, last));
    }

    TrialResult run_line(std::string const& line, std::optional<std::int64_t> limit = std::nullopt) {
        ++report_.trials;
        TrialOptions trial;
        trial.folder = here_; // files that the pipeline names are found
        trial.stdout_file = out_;
        trial.stderr_file = scratch_.path() + "/stderr";
        trial.seconds = request_.seconds;
        trial.file_limit = limit;
        return try_line(text("export TMPDIR=", shell_quoted(scratch_.path() + "/tmp"), "; ", line), trial);
    }
    TrialResult run(std::string const& feeder, std::string const& options, std::string const& last,
                    std::optional<std::int64_t> limit = std::nullopt) {
        return run_line(text(feeder, " <", shell_quoted(in_), " | ", stages(program_, options, last)), limit);
    }

    /// One of a kind and cause is told: the first volume that shows it.
    void find(std::string const& kind, std::string const& cause, std::string what, std::string line,
              std::string const& volume) {
        tell(report_.findings, {kind, std::move(what), std::move(line), volume}, text(kind, " ", cause));
    }

    /// A volume that the pipeline refuses. Of the same message, but for its numbers, the first is told.
    void refuse(TrialResult const& result, std::string line, std::string const& volume) {
        std::ifstream errors(scratch_.path() + "/stderr");
        std::string said, cause;
        std::getline(errors, said);
        for (char const c : said)
            if (c < '0' || c > '9') cause += c;
        int const code = *std::find_if(result.codes.begin(), result.codes.end(), [](int c) { return c != 0; });
        tell(report_.refusals, {"refuses", text("exit code ", code, ", ", printable(said)), std::move(line), volume},
             text(code, " ", cause));
    }

    void tell(std::vector<Finding>& told, Finding finding, std::string const& cause) {
        auto const [place, fresh] = causes_.emplace(cause, told.size());
        if (fresh) return void(told.emplace_back(std::move(finding)));
        Finding& known = told[place->second];
        if (known.volume != finding.volume) ++known.more;
    }

    void write(Volume const& volume, std::string const& path) {
        auto const source = volume_source({volume});
        auto const sink = ipc::create_stream_file(path, true, true);
        drain(*source, *sink, context_.execution());
    }

    /// What came out: headers without their histories and voxels, or the text; nothing if it is not whole.
    std::optional<std::string> result(std::optional<Volume>& volume) const {
        volume.reset();
        std::string const bytes = bytes_of(out_);
        if (!is_stream(bytes)) return bytes;
        try {
            auto const source = context_.open(out_);
            std::string all;
            while (source->next_volume()) {
                Volume const one = load(*source, context_.execution());
                Header header = one.header();
                header.history.reset();
                all += to_json(header);
                all.append(reinterpret_cast<char const*>(one.buffer().read(Space::host)), header.bytes());
                volume = one;
            }
            return all;
        } catch (Error const&) {
            return std::nullopt;
        }
    }

    /// False if there is nothing to compare.
    bool ended_well(std::string const& volume, TrialResult const& result, std::string const& cause,
                    std::string const& line) {
        if (result.hung) {
            find("hangs", cause, text("no end after ", request_.seconds, " s"), line, volume);
            return false;
        }
        if (auto const code = result.crash()) {
            find("crashes", text(cause, *code),
                 *code > 128 ? text("killed by signal ", *code - 128) : text("exit code ", *code), line, volume);
            return false;
        }
        return true;
    }

    void look_for_remains(std::string const& volume, std::string const& line, std::string const& after) {
        for (char const* const name : {"/out", "/tmp"}) {
            std::vector<std::string> left;
            for (auto const& entry : fs::directory_iterator(scratch_.path() + name))
                left.push_back(entry.path().filename().string());
            if (left.empty()) continue;
            find("leaves files", text(name, after), text(after, ": '", printable(join(left, "', '")), "'"), line,
                 volume);
            for (auto const& one : left) fs::remove_all(scratch_.path() + name + "/" + one);
        }
    }

    void try_volume(std::string const& name) {
        Volume const volume = hard_volume(name);
        write(volume, in_);
        std::string const line = line_for(name, "", "", " >out.vkt");
        TrialResult const plain = run("cat", "", "");
        if (!ended_well(name, plain, "", line)) return;
        std::optional<Volume> made, other;
        std::optional<std::string> const expected = result(made);
        if (plain.ok() && !expected)
            find("not whole", "", "exit code 0, but the output is cut", line_for(name, "", "", " | vkt info"), name);
        look_for_remains(name, line, "temporary files after the end");
        if (plain.ok())
            ++worked_;
        else
            refuse(plain, line, name);
        if (plain.ok() && made && computes()) {
            compare(name, volume, *made, request_.pipeline, line_for(name, "", "", " | vkt dump"));
            if (stages_.size() > 1) try_stages(name, volume, *expected);
            write(volume, in_);
        }
        for (Variation const& variation : variations) {
            if (variation.reads_again && !made) continue;
            std::string const last = variation.reads_again ? text(" | ", program_, " read -") : "";
            std::string const feeder = variation.piecemeal() ? feeder_for(fs::file_size(in_)) : "cat";
            TrialResult const varied = run(feeder, variation.options, last);
            if (varied.says(2) && !plain.says(2)) continue; // a stage has no such option
            std::string const again = line_for(name, variation.piecemeal() ? feeder + " | " : "", variation.options,
                                               variation.reads_again ? " | vkt read - >out.vkt" : " >out.vkt");
            if (!ended_well(name, varied, variation.options, again)) continue;
            if (variation.may_refuse && varied.says(5)) continue;
            if (varied.ok() != plain.ok())
                find("changes", variation.told(),
                     text(varied.ok() ? "fails, but not with " : "fails with ", variation.told()), again, name);
            else if (varied.ok() && result(other) != expected)
                find("changes", variation.told(), text("another result with ", variation.told()), again, name);
            look_for_remains(name, again, "temporary files after the end");
        }
    }

    /// The pipeline is of operations on one volume, and one comes out.
    bool computes() const { return chain_ && chain_->picturing() == nullptr; }

    /// Stage by stage, each from a file that the one before has written: what each of them makes is looked at by
    /// itself, and in the end there is what the pipeline makes.
    void try_stages(std::string const& name, Volume const& volume, std::string const& expected) {
        std::optional<Volume> made;
        Volume input = volume;
        std::string lines, last = text("vkt stress --volume ", name);
        for (std::size_t i = 0; i < stages_.size(); ++i) {
            write(input, in_);
            TrialResult const one = run_line(text(program_, " ", stages_[i], " <", shell_quoted(in_)));
            std::string const file = text(i + 1, ".vkt");
            lines += text(i == 0 ? last + " | " : "", told_program_, " ", stages_[i],
                          i == 0 ? "" : text(" <", i, ".vkt"), " >", file, "; ");
            std::string const line = lines + "vkt dump " + file;
            if (!ended_well(name, one, "stage by stage", line)) return;
            std::optional<std::string> const found = result(made);
            if (!one.ok() || !made)
                return find("changes", "stage by stage", text("stage ", i + 1, " fails, but not in the pipeline"), line,
                            name);
            compare(name, input, *made, stages_[i], line);
            if (i + 1 == stages_.size() && found != expected)
                find("changes", "stage by stage", "another result stage by stage", line, name);
            input = *made;
        }
    }

    void compare(std::string const& name, Volume const& input, Volume const& made, std::string const& pipeline,
                 std::string const& line) {
        if (made.header().kind != Kind::structured || input.header().kind != Kind::structured) return;
        compare_with_promise(name, input, made, pipeline, line);
        compare_numbers(name, input, made, pipeline, line);
        compare_with_definition(name, input, made, pipeline, line);
    }

    /// Floats that are no numbers come out where they do by way of float64, and nowhere else.
    void compare_numbers(std::string const& name, Volume const& input, Volume const& made, std::string const& pipeline,
                         std::string const& line) {
        Header const& h = made.header();
        if (is_integer(input.header().dtype) || is_integer(h.dtype) || !has_nan_alone(input)) return;
        std::optional<Volume> wide;
        try {
            wide = Chain(pipeline).run(in_float64(input), context_.execution());
        } catch (Error const&) {
            return; // no such definition in float64
        }
        if (!(wide->header().dims == h.dims) || is_integer(wide->header().dtype)) return;
        Volume const a = in_float64(made), b = in_float64(*wide);
        auto const* const found = reinterpret_cast<double const*>(a.view().data);
        auto const* const wanted = reinterpret_cast<double const*>(b.view().data);
        for (std::int64_t i = 0; i < h.voxels(); ++i) {
            bool const lost = std::isnan(wanted[i]) && !std::isnan(found[i]);
            if (!lost && (std::isnan(wanted[i]) || !std::isnan(found[i]))) continue;
            find(lost ? "loses NaN" : "spreads NaN", "",
                 text("voxel ", i, " is ", found[i], " in ", h.dtype, ", but ", wanted[i], " by way of float64"),
                 text(line, "  # beside: vkt convert --dtype float64 before"), name);
        }
    }

    /// What came out of one operation beside what it works out by other means.
    void compare_with_definition(std::string const& name, Volume const& input, Volume const& made,
                                 std::string const& pipeline, std::string const& line) {
        std::optional<WrongVoxel> wrong;
        try {
            Chain chain(pipeline);
            auto const* const verifiable = dynamic_cast<Verifiable const*>(chain.stages().front().operation());
            if (chain.stages().size() != 1 || verifiable == nullptr) return;
            Header const planned = chain.output(input, context_.execution());
            if (!(planned.dims == made.header().dims && planned.dtype == made.header().dtype)) return;
            wrong = verifiable->wrong_voxel(input.view(), made.view());
        } catch (Error const&) {
            return; // refused beside
        }
        if (!wrong) return;
        find("is not as defined", "",
             text("voxel ", wrong->index, " is ", wrong->found, " in ", made.header().dtype, ", but ", wrong->expected,
                  " by definition", wrong->allowed > 0 ? text(", ", wrong->allowed, " off at most") : std::string()),
             line, name);
    }

    /// What came out beside the same operations on the same voxels as float64, saturated: no further away than the
    /// plan says.
    void compare_with_promise(std::string const& name, Volume const& input, Volume const& made,
                              std::string const& pipeline, std::string const& line) {
        Header const& h = made.header();
        if (!has_bounded_sums(input)) return;
        std::optional<double> bound;
        std::optional<Volume> exact;
        try {
            Chain chain(pipeline);
            Volume const out = chain.run(input, context_.execution());
            bound = chain.bound(input, out, context_.execution());
            if (!bound) return;
            chain.set_exact();
            exact = chain.run(in_float64(input), context_.execution());
        } catch (Error const&) {
            return; // refused beside, or no such definition in float64
        }
        Header const& e = exact->header();
        if (!(e.dims == h.dims)) return;
        Volume const a = in_float64(made), b = in_float64(*exact);
        auto const* const found = reinterpret_cast<double const*>(a.view().data);
        auto const* const wanted = reinterpret_cast<double const*>(b.view().data);
        double const low = lowest_of(h.dtype), high = highest_of(h.dtype);
        double worst = 0;
        std::int64_t where = -1;
        for (std::int64_t i = 0; i < h.voxels(); ++i) {
            double const stored = h.values.stored(e.values.physical(wanted[i]));
            if (!std::isfinite(stored) || (!is_integer(h.dtype) && !(stored >= low && stored <= high))) continue;
            double const error = std::abs(h.values.slope * (found[i] - std::clamp(stored, low, high)));
            if (error <= *bound || error <= worst) continue;
            worst = std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
            where = i;
        }
        if (where < 0) return;
        double const stored = std::clamp(h.values.stored(e.values.physical(wanted[where])), low, high);
        find("loses accuracy", "",
             text("voxel ", where, " is ", found[where], " in ", h.dtype, ", but ", stored,
                  " by way of float64: ", worst, " off, at most ", *bound, " was promised"),
             text(line, "  # beside: vkt convert --dtype float64 before"), name);
    }

    void try_damaged(std::string const& name) {
        std::string const whole = stream_of(hard_volume(name));
        std::ofstream(in_, std::ios::binary) << whole;
        if (!run("cat", "", "").ok()) return;
        bool const streams = is_stream(bytes_of(out_));
        std::optional<Volume> made;
        std::optional<std::string> const expected = result(made);
        std::string const last = streams ? " -o " + shell_quoted(scratch_.path() + "/out/out.vkt") : "";
        auto const attempt = [&](std::string const& stream, std::string const& damage) {
            std::ofstream(in_, std::ios::binary) << stream;
            TrialResult const result = run("cat", "", last);
            std::string const line = line_for(text(name, " --damage ", damage), "", "", streams ? " -o out.vkt" : "");
            // What looks at other voxels alone gives the same result.
            auto const same = [&] { return run("cat", "", "").ok() && this->result(made) == expected; };
            if (ended_well(name, result, damage, line) && result.codes.back() == 0 && !(only_voxels(damage) && same()))
                find("takes damaged input", damage, text("exit code 0 for ", damage), line, name);
            if (!result.codes.empty() && result.codes.back() == 0) fs::remove(scratch_.path() + "/out/out.vkt");
            look_for_remains(name, line, text("after ", damage));
        };
        for (auto const& damage : damage_names())
            if (auto const wrong = damaged(whole, damage)) attempt(*wrong, damage);
    }

    void try_full(std::string const& name) {
        write(hard_volume(name), in_);
        if (!run("cat", "", "").ok()) return;
        std::optional<Volume> made;
        result(made);
        auto const attempt = [&](std::string const& last, std::string const& told, std::string const& how,
                                 std::optional<std::int64_t> limit) {
            TrialResult const result = run("cat", "", last, limit);
            std::string const line = text(limit ? "ulimit -f 1; " : "", line_for(name, "", "", told));
            if (ended_well(name, result, how, line) && result.codes.back() == 0)
                find("ignores a full disk", how, text("exit code 0 where ", how), line, name);
            look_for_remains(name, line, text("where ", how));
        };
        attempt(" >/dev/full", " >/dev/full", "standard output is full", std::nullopt);
        if (made && made->header().bytes() > 1024)
            attempt(" -o " + shell_quoted(scratch_.path() + "/out/out.vkt"), " -o out.vkt", "files have 1 KiB at most",
                    1024);
    }

    StressRequest const& request_;
    Context& context_;
    ScratchFolder scratch_;
    std::string here_, in_, out_, program_, told_program_;
    std::vector<std::string> stages_;
    std::optional<Chain> chain_; ///< none: the pipeline is not of operations alone
    StressReport report_;
    std::int64_t worked_ = 0;                   ///< volumes
    std::map<std::string, std::size_t> causes_; ///< index of the finding, or refusal, that has it
};

} // namespace

StressReport stress(StressRequest const& request, Context& context) { return Trials(request, context).run(); }

} // namespace vkt::shell
