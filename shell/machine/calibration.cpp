// Measuring, keeping and using rates.
// SPDX-License-Identifier: MIT
#include "shell/machine/calibration.h"

#include "ipc/frame.h"
#include "libvkt/core/error.h"
#include "libvkt/core/own_processors.h"
#include "libvkt/core/text.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/registry.h"
#include "libvkt/io/output_file.h"
#include "shell/machine/measured_pass.h"
#include "shell/machine/typical_rates.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>
#include <spawn.h>
#include <sstream>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace vkt::shell {
namespace {

constexpr char first_line[] = "vkt calibration 5";

double wall_seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Of one thread the time of the processor, which others on the machine do not make longer.
auto clock_of(int threads) { return threads == 1 ? processor_seconds : wall_seconds; }

/// The least of several, after one that warms up: what others do on the machine makes all but the least longer.
double least_seconds(std::function<void()> const& work, int tries = 6, double (*clock)() = wall_seconds) {
    auto const seconds_of = [&] {
        double const start = clock();
        work();
        return std::max(1e-9, clock() - start);
    };
    double least = seconds_of(), all = 0;
    for (int i = 0; i < tries && (i < 2 || all < 0.02); ++i) {
        double const seconds = seconds_of();
        least = std::min(least, seconds);
        all += seconds;
    }
    return least;
}

/// What is measured: two settings where one does not tell how the cost enters.
struct Case {
    std::string operation;
    std::vector<std::vector<std::string>> settings;
};

std::vector<Case> cases() {
    return {
        {"arith", {{"arith", "mul", "-", "2"}}},
        {"convert", {{"convert", "--dtype", "float32"}, {"convert", "--dtype", "uint8"}}},
        {"filter gaussian", {{"filter", "gaussian", "--sigma", "0.7"}, {"filter", "gaussian", "--sigma", "2.5"}}},
        {"filter median", {{"filter", "median", "--radius", "1"}}},
        {"resample", {{"resample", "--scale", "0.5"}, {"resample", "--scale", "0.7"}, {"resample", "--scale", "1.25"}}},
        {"rotate", {{"rotate", "--angle", "30"}}},
        {"flip", {{"flip", "x"}}},
        {"stats", {{"stats"}}}};
}

/// Of the volume that is measured with: rows as long as those of real ones, and few voxels.
constexpr Index3 measured_dims{256, 96, 64};

Volume noise(char const* type) {
    auto const [x, y, z] = measured_dims;
    return vkt::apply({"make", "noise", "--dims", to_text(x), to_text(y), to_text(z), "--dtype", type, "--low", "0",
                       "--high", "1000"},
                      {});
}

double copy_rate(int threads) {
    constexpr std::size_t bytes = std::size_t{32} << 20;
    std::vector<char> from(bytes * static_cast<std::size_t>(threads), 1), to(from.size());
    auto const work = [&] {
        std::vector<std::thread> all;
        all.reserve(static_cast<std::size_t>(threads));
        for (int t = 0; t < threads; ++t)
            all.emplace_back([&, t] {
                std::size_t const at = static_cast<std::size_t>(t) * bytes;
                std::memcpy(to.data() + at, from.data() + at, bytes);
            });
        for (auto& thread : all) thread.join();
    };
    return static_cast<double>(from.size()) / least_seconds(work, 6, clock_of(threads));
}

double scan_rate(int threads) {
    constexpr std::size_t words = std::size_t{4} << 20; // of 8 bytes
    std::vector<std::uint64_t> from(words * static_cast<std::size_t>(threads), 3);
    std::vector<std::uint64_t> sums(static_cast<std::size_t>(threads));
    auto const work = [&] {
        std::vector<std::thread> all;
        all.reserve(static_cast<std::size_t>(threads));
        for (int t = 0; t < threads; ++t)
            all.emplace_back([&, t] {
                auto const at = static_cast<std::ptrdiff_t>(static_cast<std::size_t>(t) * words);
                std::uint64_t sum = 0;
                std::for_each(from.begin() + at, from.begin() + at + static_cast<std::ptrdiff_t>(words),
                              [&](std::uint64_t v) { sum += v; });
                sums[static_cast<std::size_t>(t)] = sum;
            });
        for (auto& thread : all) thread.join();
    };
    double const rate = static_cast<double>(8 * from.size()) / least_seconds(work, 6, clock_of(threads));
    return sums.front() == 0 ? 0 : rate; // the sums are needed, so nobody leaves them out
}

/// A file that has no name, where temporary ones lie, or else in memory.
int nameless_file() {
    std::error_code error;
    std::string const folder = std::filesystem::temp_directory_path(error).string();
    int const file = error ? -1 : ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    return file >= 0 ? file : ::memfd_create("vkt-calibration", MFD_CLOEXEC);
}

/// Of a file in the page cache, with the checksums of streams.
void file_rates(Calibration& to) {
    constexpr std::size_t bytes = std::size_t{32} << 20, piece = std::size_t{1} << 20;
    int const file = nameless_file();
    std::vector<char> buffer(bytes, 1);
    auto const all = [&](auto const& move) {
        ipc::StreamHash hash(0);
        for (std::size_t done = 0; done < bytes;) {
            auto const n = move(buffer.data() + done, std::min(piece, bytes - done), static_cast<off_t>(done));
            if (n <= 0) throw Error(ErrorKind::resources, text("no temporary file can be had: ", std::strerror(errno)));
            hash.add(std::as_bytes(std::span(buffer.data() + done, static_cast<std::size_t>(n))));
            done += static_cast<std::size_t>(n);
        }
    };
    auto const put = [&] {
        if (::ftruncate(file, 0) != 0) throw Error(ErrorKind::resources, std::strerror(errno));
        all([&](char* from, std::size_t n, off_t at) { return ::pwrite(file, from, n, at); });
    };
    try {
        to.file_write = static_cast<double>(bytes) / least_seconds(put, 6, processor_seconds);
        to.file_read =
            static_cast<double>(bytes) /
            least_seconds([&] { all([&](char* into, std::size_t n, off_t at) { return ::pread(file, into, n, at); }); },
                          6, processor_seconds);
    } catch (...) {
        ::close(file);
        throw;
    }
    ::close(file);
}

/// What this program needs to do little: to begin, to start its threads, to take its buffers, to end. Its output goes
/// nowhere.
double start_seconds() {
    char name[] = "vkt", verb[] = "pipe", line[] = "make constant --dims 256 256 4 | arith mul - 2 | stats";
    char* const words[] = {name, verb, line, nullptr};
    return least_seconds([&] {
        posix_spawn_file_actions_t actions;
        posix_spawn_file_actions_init(&actions);
        posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDWR, 0);
        posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDOUT_FILENO);
        posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
        pid_t process = 0;
        int const error = ::posix_spawn(&process, "/proc/self/exe", &actions, nullptr, words, environ);
        posix_spawn_file_actions_destroy(&actions);
        int status = 0;
        while (error == 0 && ::waitpid(process, &status, 0) < 0 && errno == EINTR) {
        }
        if (error != 0 || status != 0)
            throw Error(ErrorKind::resources, text("this program cannot be started: ", std::strerror(error)));
    });
}

OperationRate rate_of(std::string const& name, std::vector<std::string> const& setting, Volume const& volume,
                      int all_threads) {
    auto const operation = configured(name, setting);
    Plan const plan = operation->plan({&volume.header(), 1});
    OperationRate rate{name, method_of(plan), static_cast<int>(size_of(volume.header().dtype)), plan.cost, {}};
    Header const& counted = operation->shape() == Shape::reduction ? volume.header() : plan.output;
    for (std::size_t many = 2; many-- > 0;) {
        int const threads = many == 0 ? 1 : all_threads;
        // Twice, since what is done once is little beside that: buffers are taken, threads begin.
        constexpr std::size_t times = 2;
        double const seconds =
            least_seconds([&] { pass_through(*operation, {volume}, times, threads); }, 6, clock_of(threads));
        rate.seconds[many] = seconds / (times * static_cast<double>(counted.voxels()));
    }
    return rate;
}

double between(ByThreads const& rate, int threads, int all) {
    if (all <= 1 || threads <= 1) return rate[0];
    double const share = std::min(1.0, static_cast<double>(threads - 1) / static_cast<double>(all - 1));
    // Speeds, not seconds, grow with the threads.
    if (!(rate[0] > 0) || !(rate[1] > 0)) return rate[0];
    return 1 / ((1 - share) / rate[0] + share / rate[1]);
}

struct Typical {
    double seconds = 0; ///< a voxel
    double shared = 1;
};

/// What a row says of voxels of 2^size bytes; 0 where it says nothing, or, if any size will do, what it says of the
/// next one.
double nanoseconds(TypicalRate const& rate, std::size_t size, bool any_size) {
    double found = rate.nanoseconds[size];
    for (std::size_t away = 1; any_size && !(found > 0) && away < rate.nanoseconds.size(); ++away) {
        if (size >= away) found = rate.nanoseconds[size - away];
        if (!(found > 0) && size + away < rate.nanoseconds.size()) found = rate.nanoseconds[size + away];
    }
    return found;
}

/// Of the settings with this method, or else of the operation: between those whose costs are next to it, and in
/// proportion beyond the last of them.
std::optional<Typical> typical_rate(std::string const& operation, std::string const& method, double cost,
                                    std::size_t bytes) {
    auto const size = static_cast<std::size_t>(std::countr_zero(bytes));
    for (bool const any_method : {false, true})
        for (bool const any_size : {false, true}) {
            TypicalRate const *below = nullptr, *above = nullptr;
            for (auto const& rate : typical_rates()) {
                if (rate.operation != operation || (!any_method && rate.method != method) ||
                    !(nanoseconds(rate, size, any_size) > 0))
                    continue;
                if (rate.cost <= cost && (below == nullptr || rate.cost > below->cost)) below = &rate;
                if (rate.cost >= cost && (above == nullptr || rate.cost < above->cost)) above = &rate;
            }
            if (below == nullptr && above == nullptr) continue;
            auto const at = [&](TypicalRate const& rate) { return 1e-9 * nanoseconds(rate, size, any_size); };
            if (below == nullptr || above == nullptr) {
                TypicalRate const& end = below == nullptr ? *above : *below;
                return Typical{at(end) * (end.cost > 0 ? cost / end.cost : 1), end.shared};
            }
            double const between = above->cost - below->cost, share = between > 0 ? (cost - below->cost) / between : 0;
            return Typical{at(*below) + share * (at(*above) - at(*below)), below->shared};
        }
    return {};
}

std::string file_mark(std::filesystem::path const& path) {
    struct stat s {};
    if (::stat(path.c_str(), &s) != 0) return "?";
    return text(static_cast<std::int64_t>(s.st_size), ":", static_cast<std::int64_t>(s.st_mtim.tv_sec), ".",
                static_cast<std::int64_t>(s.st_mtim.tv_nsec));
}

bool only_ours(std::string const& path) {
    struct stat s {};
    return ::lstat(path.c_str(), &s) == 0 && !S_ISLNK(s.st_mode) && s.st_uid == ::geteuid() &&
           (s.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

} // namespace

std::string method_of(Plan const& plan) { return plan.method.substr(0, plan.method.find_first_of("0123456789")); }

std::string processor_name() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("model name") && line.find(": ") != std::string::npos)
            return printable(line.substr(line.find(": ") + 2));
    return "unknown processor";
}

std::string machine_and_build() {
    Dl_info library{};
    ::dladdr(reinterpret_cast<void const*>(static_cast<std::vector<RegisteredOperation> const& (*)()>(&operations)),
             &library);
    std::string const lib = library.dli_fname != nullptr ? library.dli_fname : "";
    return text(processor_name(), ", ", default_threads(), " threads, ", name_of(best_instruction_set()),
                ", vkt " VKT_VERSION ", program ", file_mark("/proc/self/exe"), ", library ", file_mark(lib));
}

std::string calibration_path() {
    char const* const cache = std::getenv("XDG_CACHE_HOME");
    if (cache != nullptr && *cache == '/') return text(cache, "/vkt/calibration");
    char const* const home = std::getenv("HOME");
    return home != nullptr && *home == '/' ? text(home, "/.cache/vkt/calibration") : "";
}

void Prediction::read(double seconds) {
    reading_ += seconds;
    busy_ += seconds;
}

void Prediction::compute(double seconds, int threads, bool waits) {
    if (waits) *this = Prediction(processors_, this->seconds());
    computing_ += seconds;
    busy_ += seconds * std::clamp(threads, 1, processors_);
    all_ = all_ || threads >= processors_;
}

void Prediction::write(double seconds) {
    writing_ += seconds;
    busy_ += seconds;
}

double Prediction::seconds() const {
    // Where every processor computes, its threads wait for the one that shares its processor with who reads or writes;
    // at times both do so at once.
    double const hindered = all_ ? 0.75 * (reading_ + writing_) : 0;
    return ended_ + std::max({reading_, computing_ > 0 ? computing_ + hindered : 0, writing_, busy_ / processors_});
}

Calibration calibrate_computing() {
    Calibration result;
    result.threads = default_threads();
    for (std::size_t many = 0; many < 2; ++many) {
        result.copy[many] = copy_rate(many == 0 ? 1 : result.threads);
        result.scan[many] = scan_rate(many == 0 ? 1 : result.threads);
    }
    OwnProcessors const own(result.threads);
    for (char const* const type : {"uint16", "float32"}) {
        Volume const volume = noise(type);
        for (auto const& one : cases())
            for (auto const& setting : one.settings)
                result.rates.push_back(rate_of(one.operation, setting, volume, result.threads));
    }
    return result;
}

Calibration calibrate() {
    Calibration result = calibrate_computing();
    file_rates(result);
    result.start = start_seconds();
    return result;
}

std::optional<double> Calibration::seconds(std::string const& verb, Plan const& plan, std::vector<Header> const& inputs,
                                           bool reduction, int count) const {
    if (plan.shift && plan.cost == 0) return 0; // nothing is touched
    Header const& counted = reduction && !inputs.empty() ? inputs.front() : plan.output;
    Header const& read = inputs.empty() ? plan.output : inputs.front();
    std::string const operation(operation_name(verb)), method = method_of(plan);
    auto const rate = typical_rate(operation, method, plan.cost, size_of(read.dtype));
    if (!rate) return {};
    double const alone =
        static_cast<double>(counted.voxels()) * rate->seconds * slower(operation, method, size_of(read.dtype));
    return alone * ((1 - rate->shared) + rate->shared / speedup(operation, count));
}

double Calibration::slower(std::string const& operation, std::string const& method, std::size_t bytes) const {
    int const of_bytes = bytes > 2 ? 4 : 2;
    std::vector<double> all, own, same;
    for (auto const& then : typical_calibration())
        for (auto const& now : rates) {
            if (now.bytes != of_bytes || then.bytes != of_bytes || now.operation != then.operation ||
                now.method != then.method || std::abs(now.cost - then.cost) > 0.01 * then.cost)
                continue;
            double const ratio = 1e9 * now.seconds[0] / then.nanoseconds;
            all.push_back(ratio);
            if (now.operation != operation) continue;
            own.push_back(ratio);
            if (now.method == method) same.push_back(ratio);
        }
    std::vector<double>& of = !same.empty() ? same : !own.empty() ? own : all;
    if (of.empty()) return 1;
    auto const middle = of.begin() + static_cast<std::ptrdiff_t>(of.size() / 2);
    std::nth_element(of.begin(), middle, of.end());
    return *middle;
}

double Calibration::speedup(std::string const& operation, int count) const {
    bool const known = std::ranges::any_of(rates, [&](auto const& rate) { return rate.operation == operation; });
    double sum = 0, n = 0;
    for (auto const& rate : rates)
        if (rate.operation == (known ? operation : "filter gaussian")) {
            sum += std::log(rate.seconds[0] / between(rate.seconds, count, threads));
            ++n;
        }
    return n > 0 ? std::max(1.0, std::exp(sum / n)) : 1;
}

double Calibration::reading(Header const& header) const { return static_cast<double>(header.bytes()) / file_read; }
double Calibration::writing(Header const& header) const { return static_cast<double>(header.bytes()) / file_write; }

void save(Calibration const& c) {
    std::string const path = calibration_path();
    if (path.empty())
        throw Error(ErrorKind::io, "no place for the calibration: neither XDG_CACHE_HOME nor HOME is a directory");
    std::filesystem::path const folder = std::filesystem::path(path).parent_path();
    std::error_code error;
    std::filesystem::create_directories(folder.parent_path(), error);
    if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST)
        throw Error(ErrorKind::io, text("cannot make '", folder.string(), "': ", std::strerror(errno)));
    if (!only_ours(folder))
        throw Error(ErrorKind::io, text("'", folder.string(), "' belongs to somebody else, or others may write to it"),
                    "remove it, or name another place: XDG_CACHE_HOME");
    std::string content = text(first_line, "\n", machine_and_build(), "\nthreads ", c.threads, "\ncopy ", c.copy[0],
                               " ", c.copy[1], "\nscan ", c.scan[0], " ", c.scan[1], "\nfile ", c.file_read, " ",
                               c.file_write, "\nstart ", c.start, "\n");
    for (auto const& r : c.rates)
        content += text("rate ", r.bytes, " ", r.cost, " ", r.seconds[0], " ", r.seconds[1], " ", r.operation, ": ",
                        r.method, "\n");
    std::filesystem::remove(path, error); // what is replaced would hand on its mode
    OutputFile file(path, true);
    file.write(content.data(), content.size());
    ::fchmod(file.descriptor(), 0600);
    file.commit();
}

std::optional<Calibration> load_calibration() {
    std::string const path = calibration_path();
    if (path.empty() || !only_ours(path) || !only_ours(std::filesystem::path(path).parent_path())) return {};
    std::ifstream file(path);
    std::string line;
    if (!std::getline(file, line) || line != first_line || !std::getline(file, line) || line != machine_and_build())
        return {};
    Calibration c;
    bool sound = true;
    auto const number = [&](std::istream& in) {
        std::string word;
        in >> word;
        double const value = is_number(word) ? parse_double(word) : -1;
        sound = sound && std::isfinite(value) && value >= 0;
        return value;
    };
    while (std::getline(file, line)) {
        std::istringstream in(line);
        std::string what;
        in >> what;
        if (what == "threads") c.threads = static_cast<int>(std::min(number(in), 4096.0));
        if (what == "copy") c.copy = {number(in), number(in)};
        if (what == "scan") c.scan = {number(in), number(in)};
        if (what == "file") {
            c.file_read = number(in);
            c.file_write = number(in);
        }
        if (what == "start") c.start = number(in);
        if (what != "rate") continue;
        OperationRate rate;
        rate.bytes = number(in) > 2 ? 4 : 2;
        rate.cost = number(in);
        rate.seconds = {number(in), number(in)};
        std::getline(in >> std::ws, rate.operation);
        std::size_t const colon = rate.operation.find(": ");
        sound = sound && colon != std::string::npos;
        if (!sound) break;
        rate.method = rate.operation.substr(colon + 2);
        rate.operation.resize(colon);
        c.rates.push_back(std::move(rate));
    }
    for (double const rate : {c.copy[0], c.copy[1], c.scan[0], c.scan[1], c.file_read, c.file_write, c.start})
        sound = sound && rate > 0;
    if (!sound || c.threads < 1 || c.rates.empty()) return {};
    return c;
}

} // namespace vkt::shell
