// Measuring, keeping and using rates.
// SPDX-License-Identifier: MIT
#include "shell/machine/calibration.h"

#include "ipc/frame.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/own_processors.h"
#include "libvkt/core/text.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/io/output_file.h"
#include "shell/options.h"

#include <algorithm>
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

constexpr char first_line[] = "vkt calibration 4";

double seconds_of(std::function<void()> const& work) {
    auto const start = std::chrono::steady_clock::now();
    work();
    return std::max(1e-9, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

/// The least of several, after one that warms up: what others do on the machine makes all but the least longer.
double least_seconds(std::function<void()> const& work, int tries = 6) {
    double least = seconds_of(work), all = 0;
    for (int i = 0; i < tries && (i < 2 || all < 0.02); ++i) {
        double const seconds = seconds_of(work);
        least = std::min(least, seconds);
        all += seconds;
    }
    return least;
}

/// What is measured: two settings where one does not tell how the cost enters.
struct Case {
    std::string operation;
    std::vector<std::vector<std::string>> settings;
    bool reduction = false;
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
        {"stats", {{"stats"}}, true}};
}

/// Of the volume that is measured with: rows as long as those of real ones, and few voxels.
constexpr Index3 measured_dims{256, 96, 64};

/// The operation of this name in the registry, its options read.
std::unique_ptr<Operation> made(std::string const& name, std::vector<std::string> const& words) {
    auto operation = make_operation(name);
    Parameters parameters;
    operation->parameters(parameters);
    auto const count = static_cast<std::size_t>(std::count(name.begin(), name.end(), ' ')) + 1;
    read_words({words.begin() + static_cast<std::ptrdiff_t>(std::min(count, words.size())), words.end()},
               {&parameters});
    operation->check();
    return operation;
}

/// Takes slabs into the same memory again and again, as the buffers of pipes and files do.
class Discard final : public Sink {
public:
    void begin(Header const& header) override { header_ = header; }
    AnyView acquire(Box const& slab) override {
        bytes_.resize(static_cast<std::size_t>(slab.voxels()) * size_of(header_.dtype));
        return dense_view(bytes_.data(), header_.dtype, slab);
    }
    void commit() override {}
    void end() override {}
    void close() override {}

private:
    Header header_;
    std::vector<std::byte> bytes_;
};

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
    return static_cast<double>(from.size()) / least_seconds(work);
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
    double const rate = static_cast<double>(8 * from.size()) / least_seconds(work);
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
        to.file_write = static_cast<double>(bytes) / least_seconds(put);
        to.file_read = static_cast<double>(bytes) / least_seconds([&] {
                           all([&](char* into, std::size_t n, off_t at) { return ::pread(file, into, n, at); });
                       });
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

/// A volume so many times through one operation slab by slab, as a pipeline does it.
void slabs_through(Case const& one, std::vector<std::string> const& words, Volume const& volume, std::size_t times,
                   int threads) {
    Execution execution = default_execution();
    execution.threads = threads;
    auto const operation = made(one.operation, words);
    auto source = volume_source(std::vector<Volume>(times, volume));
    std::vector<std::unique_ptr<Source>> inputs;
    inputs.push_back(std::move(source));
    if (one.reduction) {
        Measurement of{inputs, execution, {}, ReportForm::json, [](Report const&) {}, {}};
        operation->measure(of);
    } else {
        Discard nowhere;
        drain(*attach(std::move(inputs), *operation, execution, {}), nowhere, execution);
    }
}

/// What a plan's method is called, without its numbers.
std::string method_of(Plan const& plan) { return plan.method.substr(0, plan.method.find_first_of("0123456789")); }

OperationRate rate_of(Case const& one, std::vector<std::string> const& setting, Volume const& volume, int all_threads) {
    Plan const plan = made(one.operation, setting)->plan({&volume.header(), 1});
    OperationRate rate{one.operation, method_of(plan), static_cast<int>(size_of(volume.header().dtype)), plan.cost, {}};
    Header const& counted = one.reduction ? volume.header() : plan.output;
    for (std::size_t many = 2; many-- > 0;) {
        int const threads = many == 0 ? 1 : all_threads;
        // Without what is done once: buffers are taken, threads begin. Long pipelines do not feel it.
        auto const seconds_of_volumes = [&](std::size_t times) {
            return least_seconds([&] { slabs_through(one, setting, volume, times, threads); }, many == 0 ? 1 : 6);
        };
        double const once = seconds_of_volumes(1), more = seconds_of_volumes(3);
        // No less than half of what all of it took, should something have held up the first.
        rate.seconds[many] = std::max((more - once) / 2, more / 6) / static_cast<double>(counted.voxels());
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

Calibration calibrate() {
    Calibration result;
    result.threads = default_threads();
    for (std::size_t many = 0; many < 2; ++many) {
        result.copy[many] = copy_rate(many == 0 ? 1 : result.threads);
        result.scan[many] = scan_rate(many == 0 ? 1 : result.threads);
    }
    file_rates(result);
    result.start = start_seconds();
    OwnProcessors const own(result.threads);
    for (char const* const type : {"uint16", "float32"}) {
        Volume const volume = noise(type);
        for (auto const& one : cases())
            for (auto const& setting : one.settings)
                result.rates.push_back(rate_of(one, setting, volume, result.threads));
    }
    return result;
}

double Calibration::seconds(std::string const& operation, Plan const& plan, std::vector<Header> const& inputs,
                            bool reduction, int count) const {
    if (plan.shift && plan.cost == 0) return 0; // nothing is touched
    Header const& counted = reduction && !inputs.empty() ? inputs.front() : plan.output;
    Header const& read = inputs.empty() ? plan.output : inputs.front();
    auto const voxels = static_cast<double>(counted.voxels());
    auto const size = static_cast<double>(size_of(read.dtype));
    double const written = reduction ? 0 : static_cast<double>(plan.output.bytes());
    double const moved = (static_cast<double>(read.bytes()) + written) / (2 * between(copy, count, threads)) / voxels;
    double const scanned = plan.scans ? static_cast<double>(read.bytes()) / between(scan, count, threads) : 0;
    int const bytes = size > 2 ? 4 : 2;

    std::vector<OperationRate const*> measured;
    bool const known = std::ranges::any_of(rates, [&](auto const& rate) { return rate.operation == operation; });
    for (auto const& rate : rates)
        if (rate.bytes == bytes && rate.operation == (known ? operation : "filter gaussian")) measured.push_back(&rate);
    if (measured.empty()) return voxels * moved + scanned;
    std::string const method = method_of(plan);
    auto const same = [&](OperationRate const* rate) { return rate->method == method; };
    if (std::ranges::any_of(measured, same)) std::erase_if(measured, std::not_fn(same));
    // Two costs tell what does not grow with them; of one, it is what memory takes, where it computes more than that.
    auto const [low, high] = std::ranges::minmax(measured, {}, [](auto const* rate) { return rate->cost; });
    auto const mean_at = [&](double cost) {
        double sum = 0, n = 0;
        for (auto const* rate : measured)
            if (std::abs(rate->cost - cost) <= 0.5) sum += between(rate->seconds, count, threads), ++n;
        return sum / n;
    };
    double const least = mean_at(low->cost), most = mean_at(high->cost);
    double fixed = low->cost > 4 ? std::min(moved, least) : least;
    double per_cost = low->cost > 4 ? (least - fixed) / low->cost : 0;
    if (high->cost - low->cost > 0.5 && most > least) {
        per_cost = std::min((most - least) / (high->cost - low->cost), most / high->cost);
        fixed = std::max(0.0, least - per_cost * low->cost);
    }
    double const wider = std::max(1.0, size / bytes);
    if (known) return voxels * (fixed + per_cost * plan.cost) * wider + scanned;
    return voxels * std::max(moved, per_cost * plan.cost) + scanned;
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
