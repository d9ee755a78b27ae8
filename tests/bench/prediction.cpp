// What plans predict of every operation against the processor time that it takes, on one thread.
// SPDX-License-Identifier: MIT
//
// usage: vkt_prediction [SIDE [TYPES [WORD]]]   (128, uint8,uint16,float32; operations with this word in their line
// only), or vkt_prediction --table [SIDE], which prints shell/machine/typical_rates.cpp (with --calibration the end of
// it alone). Prints a line an operation, setting and data type, of a volume of SIDE³ voxels: nanoseconds a voxel as
// predicted and as measured, and how many times the one the other is. The machine is measured in the same run, before
// and after, as `vkt doctor --calibrate` does it. Exit code 1 if a prediction is further than a factor of 1.5 away,
// unless both are below twice what a copy takes, which nobody waits for.
#include "libvkt/core/text.h"
#include "libvkt/engine/registry.h"
#include "libvkt/operations/common/reference_volume.h"
#include "shell/machine/calibration.h"
#include "shell/machine/measured_pass.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <unistd.h>

using namespace vkt;

namespace {

/// What is done, and to what: the noise, a mask of blobs, their labels, the noise made smooth; several.
struct Setting {
    char const* line;
    char const* inputs = "noise";
};

constexpr Setting settings[] = {
    {"arith mul - 3"},
    {"arith add - -", "noise noise"},
    {"arith div - -", "noise noise"},
    {"arith gt - 500"},
    {"arith clamp - 100 200"},
    {"arith where - - 0", "mask noise"},
    {"arith sqrt -"},
    {"arith exp - --dtype float32", "unit"},
    {"arith log - --dtype float32"},
    {"arith pow - 2.5 --dtype float32"},
    {"transform 'v * 2 + 1'"},
    {"transform 'sqrt(v) + x'"},
    {"transform 'v - (v[-1,0,0] + v[1,0,0]) / 2'"},
    {"convert --dtype uint8"},
    {"convert --dtype float32"},
    {"convert --dtype float64"},
    {"convert --dtype uint8 --range 0:900"},
    {"convert --dtype uint8 --range minmax"},
    {"convert --dtype uint8 --range p1:p99"},
    {"convert --dtype auto --tolerance 1"},
    {"threshold --above 500"},
    {"threshold --otsu"},
    {"fill --value 3"},
    {"fill --value 3 --roi :,:,0:50%"},
    {"delete --roi :,:,0:50%"},
    {"copy - -", "noise noise"},
    {"pad --by 8"},
    {"pad --by 8 --boundary mirror"},
    {"permute zyx"},
    {"permute yxz"},
    {"flip x"},
    {"flip z"},
    {"crop --roi 10%:90%,10%:90%,10%:90%"},
    {"set --units HU"},
    {"slice --z 5"},
    {"slice --x 5"},
    {"slice --normal 1,1,1"},
    {"slice --normal 1,1,1 --thickness 20"},
    {"project max"},
    {"project mean"},
    {"project std"},
    {"project median"},
    {"project mean --axis x"},
    {"project median --axis x"},
    {"scan"},
    {"histogram"},
    {"histogram --bins 4096"},
    {"histogram --range 0:1000"},
    {"histogram --range p1:p99"},
    {"stats"},
    {"stats --percentiles 1,99"},
    {"stats - --labels -", "noise labels"},
    {"stats - --mask -", "noise mask"},
    {"stats --per z"},
    {"diff", "noise noise"},
    {"diff --ssim", "noise noise"},
    {"diff --mutual-information", "noise noise"},
    {"transform 'exp(v / 1000) * sin(x)'"},
    {"dump --roi 0:32,0:32,0:32"},
    {"filter gaussian --sigma 0.7"},
    {"filter gaussian --sigma 1"},
    {"filter gaussian --sigma 2 --method fir"},
    {"filter gaussian --sigma 4 --method fir"},
    {"filter gaussian --sigma 4 --method cascade --tolerance 1%"},
    {"filter gaussian --sigma 8"},
    {"filter gaussian --sigma 16"},
    {"filter box --radius 1"},
    {"filter box --radius 2"},
    {"filter box --radius 5"},
    {"filter box --radius 20"},
    {"filter median --radius 1"},
    {"filter median --radius 2"},
    {"filter median --radius 3"},
    {"filter median --radius 5"},
    {"filter median --radius 1,1,0"},
    {"filter gradient"},
    {"filter gradient --component x"},
    {"filter sobel"},
    {"filter sobel --component x"},
    {"filter laplacian"},
    {"filter log --sigma 2"},
    {"filter dog --sigma 2"},
    {"filter sharpen --sigma 1"},
    {"filter kernel line.txt"},
    {"filter kernel cross.txt"},
    {"filter kernel cube.txt --method direct"},
    {"filter kernel large.txt --method direct"},
    {"filter kernel large.txt --method fft"},
    {"filter kernel large.txt --method separable"},
    {"filter bilateral --range-sigma 100"},
    {"filter bilateral --range-sigma 100 --sigma 2"},
    {"filter nlmeans --strength 100 --search 2"},
    {"filter nlmeans --strength 100 --search 3 --patch 2"},
    {"filter nlmeans --noise auto --search 2"},
    {"clahe"},
    {"clahe --bricks 4,4,4 --bins 1024"},
    {"clahe --range 0:1000"},
    {"morphology erode"},
    {"morphology erode --radius 3"},
    {"morphology dilate --radius 5 --shape box"},
    {"morphology open --radius 2"},
    {"morphology gradient --shape box"},
    {"morphology tophat --radius 3 --shape box"},
    {"resample --scale 0.5"},
    {"resample --scale 0.7"},
    {"resample --scale 1.2"},
    {"resample --scale 0.7 --method nearest"},
    {"resample --scale 1.5 --method nearest"},
    {"resample --scale 0.7 --method linear"},
    {"resample --scale 1.2 --method cubic"},
    {"resample --scale 1.2 --method lanczos3"},
    {"resample --scale 1.2 --method bspline3"},
    {"resample --scale 1.2 --method bspline5"},
    {"resample --like -", "noise turned"},
    {"rotate --angle 20"},
    {"rotate --angle 20 --axis x"},
    {"rotate --angle 90 --expand"},
    {"rotate --angle 20 --method nearest"},
    {"rotate --angle 20 --method cubic"},
    {"rotate --angle 20 --method lanczos3"},
    {"rotate --angle 20 --method bspline3"},
    {"rotate --angle 20 --method bspline5"},
    {"rotate --euler 10,20,30"},
    {"scale --factor 1.5"},
    {"scale --factor 0.6"},
    {"affine '1 0.2 0 0  0 1 0 0  0 0 1 0' --unit voxel"},
    {"label", "mask"},
    {"label --connectivity 26", "mask"},
    {"label --by-value", "labels"},
    {"fill-holes", "mask"},
    {"distance", "mask"},
    {"distance --signed", "mask"},
    {"watershed", "smooth"},
    {"watershed --depth 20", "smooth"},
    {"watershed --on distance", "mask"},
    {"mesh --iso HALF", "smooth"},
    {"mesh --labels", "labels"},
    {"make constant --dims SIDE SIDE SIDE --dtype TYPE", ""},
    {"make ramp --dims SIDE SIDE SIDE --dtype TYPE", ""},
    {"make noise --dims SIDE SIDE SIDE --dtype TYPE --high 200", ""},
    {"make sphere --dims SIDE SIDE SIDE --dtype TYPE", ""},
    {"make checkerboard --dims SIDE SIDE SIDE --dtype TYPE", ""},
    {"make marschner-lobb --dims SIDE SIDE SIDE --dtype TYPE", ""},
};

/// Words as the shell parts them, in single quotes and out of them.
std::vector<std::string> words_of(std::string line, std::string const& side, std::string const& type) {
    auto const replace = [&](std::string const& what, std::string const& by) {
        for (std::size_t at = line.find(what); at != std::string::npos; at = line.find(what, at + by.size()))
            line.replace(at, what.size(), by);
    };
    replace("SIDE", side);
    replace("TYPE", type);
    replace("HALF", type == "uint8" ? "127" : "497");
    std::vector<std::string> words;
    std::string word;
    bool quoted = false, any = false;
    for (char const c : line + " ") {
        if (c == '\'') {
            quoted = !quoted, any = true;
        } else if (c != ' ' || quoted) {
            word += c, any = true;
        } else if (any) {
            words.push_back(word), word.clear(), any = false;
        }
    }
    return words;
}

void write_kernel(char const* name, int x, int y, int z, bool cross) {
    std::ofstream file(name);
    file << x << ' ' << y << ' ' << z << '\n';
    for (int k = 0; k < z; ++k)
        for (int j = 0; j < y; ++j)
            for (int i = 0; i < x; ++i) {
                int const off = (i != x / 2) + (j != y / 2) + (k != z / 2);
                int const weight = cross ? (off > 1 ? 0 : 1) : (i + 1) * (j + 2) * (k + 3) + (i * j + k) % 5;
                file << weight << ' ';
            }
}

double total(shell::Calibration const& c) {
    double sum = 0;
    for (auto const& rate : c.rates) sum += std::log(rate.seconds[0]);
    return sum;
}

/// What others do on the machine makes all but the least longer.
void keep_least(shell::Calibration& of, shell::Calibration const& more) {
    for (std::size_t i = 0; i < of.rates.size(); ++i)
        for (std::size_t many = 0; many < 2; ++many)
            of.rates[i].seconds[many] = std::min(of.rates[i].seconds[many], more.rates[i].seconds[many]);
    for (std::size_t many = 0; many < 2; ++many) {
        of.copy[many] = std::max(of.copy[many], more.copy[many]);
        of.scan[many] = std::max(of.scan[many], more.scan[many]);
    }
}

/// What settings are done to, of one data type.
class Volumes {
public:
    Volumes(std::string side, std::string type) : side_(std::move(side)), type_(std::move(type)) {
        std::string const high = type_ == "uint8" ? "255" : "1000";
        all_["noise"] = made("make noise --dims SIDE SIDE SIDE --dtype TYPE --high " + high, {});
        Volume const smooth = made("filter gaussian --sigma 4", {made("convert --dtype float32", {all_["noise"]})});
        all_["smooth"] = made("convert --dtype uint8 --range minmax", {smooth});
        if (type_ != "uint8")
            all_["smooth"] = made("convert --dtype TYPE", {made("arith mul - 3.9 --dtype float32", {all_["smooth"]})});
        all_["mask"] = made("threshold --otsu", {all_["smooth"]});
        all_["labels"] = made("label --dtype uint16", {all_["mask"]});
        all_["turned"] = made("rotate --angle 20", {all_["noise"]});
        all_["unit"] = made("arith div - " + high + " --dtype float32", {all_["noise"]});
    }
    std::vector<std::string> words(std::string const& line) const { return words_of(line, side_, type_); }
    std::vector<Volume> inputs(Setting const& setting) const {
        std::vector<Volume> result;
        std::istringstream names(setting.inputs);
        for (std::string name; names >> name;) result.push_back(all_.at(name));
        return result;
    }

private:
    Volume made(std::string const& line, std::vector<Volume> const& inputs) const {
        return vkt::apply(words(line), inputs);
    }
    std::string side_, type_;
    std::map<std::string, Volume> all_;
};

/// One setting, measured.
struct Measured {
    std::string operation;
    Plan plan;
    std::vector<Header> inputs;
    bool reduction = false;
    double voxels = 0, seconds = 0, shared = 1;
    double moved = 0; ///< bytes read and written
};

Measured measured(Setting const& setting, Volumes const& volumes, bool shares) {
    Measured result;
    auto const words = volumes.words(setting.line);
    auto inputs = volumes.inputs(setting);
    result.operation = words[0];
    if (words[0] == "filter" || words[0] == "make") result.operation += " " + words[1];
    auto const operation = shell::configured(result.operation, words);
    if (operation->like() != nullptr && inputs.size() > 1) {
        auto const like = volume_source({inputs.back()});
        operation->like()->file = "like";
        operation->like()->take(*like);
        inputs.pop_back();
    }
    StageInfo info;
    info.on_plan = [&](Plan const& plan, std::vector<Header> const& headers) {
        result.plan = plan;
        result.inputs = headers;
    };
    result.reduction = operation->shape() == Shape::reduction;
    double all = 0;
    result.seconds = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 7 && (i < 3 || all < 0.3) && all < 3; ++i) {
        double const start = shell::processor_seconds();
        shell::pass_through(*operation, inputs, 1, 1, info);
        double const seconds = shell::processor_seconds() - start;
        result.seconds = std::min(result.seconds, seconds);
        all += seconds;
    }
    if (shares) { // of two threads, this one does what is not shared and half of the rest
        auto const own = [] {
            timespec now{};
            ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
            return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
        };
        double const start = shell::processor_seconds(), own_start = own();
        for (int i = 0; i < 3; ++i) shell::pass_through(*operation, inputs, 1, 2, info);
        double const mine = own() - own_start, together = shell::processor_seconds() - start;
        result.shared = std::clamp(2 * (1 - mine / together), 0.0, 1.0);
    }
    result.voxels =
        static_cast<double>(result.reduction ? result.inputs.front().voxels() : result.plan.output.voxels());
    for (auto const& header : result.inputs) result.moved += static_cast<double>(header.bytes());
    if (!result.reduction) result.moved += static_cast<double>(result.plan.output.bytes());
    return result;
}

std::string quoted(std::string const& text) { return '"' + text + '"'; }

shell::Calibration least_of(int calibrations) {
    shell::Calibration machine = shell::calibrate_computing();
    for (int i = 1; i < calibrations; ++i) keep_least(machine, shell::calibrate_computing());
    return machine;
}

void print_calibration(shell::Calibration const& machine) {
    std::printf("std::span<TypicalCalibration const> typical_calibration() {\n"
                "    static constexpr TypicalCalibration rates[] = {\n");
    for (auto const& rate : machine.rates)
        std::printf("{%s, %s, %d, %.4g, %.3g},\n", quoted(rate.operation).c_str(), quoted(rate.method).c_str(),
                    rate.bytes, rate.cost, 1e9 * rate.seconds[0]);
    std::printf("    };\n    return rates;\n}\n\n} // namespace vkt::shell\n");
}

int print_table(std::string const& side) {
    shell::Calibration machine = least_of(5);
    struct Row {
        std::array<double, 4> logs{}, counts{};
        double shared = 0, shares = 0, cost = 0;
    };
    std::map<std::string, std::map<std::string, std::map<double, Row>>> rows;
    for (std::string const type : {"uint8", "uint16", "float32", "float64"}) {
        Volumes const volumes(side, type);
        for (auto const& setting : settings) {
            try {
                Measured const m = measured(setting, volumes, type == "uint16");
                if (m.plan.shift && m.plan.cost == 0) continue;
                double const rounded = m.plan.cost > 0 ? std::exp(std::round(std::log(m.plan.cost) * 20) / 20) : 0;
                auto& row = rows[m.operation][shell::method_of(m.plan)][rounded];
                Header const& read = m.inputs.empty() ? m.plan.output : m.inputs.front();
                auto const size = static_cast<std::size_t>(std::countr_zero(size_of(read.dtype)));
                row.logs[size] += std::log(1e9 * m.seconds / m.voxels);
                ++row.counts[size];
                row.cost = m.plan.cost;
                if (type == "uint16") row.shared += m.shared, ++row.shares;
                std::fprintf(stderr, "%-8s %-52s %9.3f ns, cost %.3g, shared %.2f\n", type.c_str(), setting.line,
                             1e9 * m.seconds / m.voxels, m.plan.cost, m.shared);
            } catch (Error const& e) {
                std::fprintf(stderr, "%-8s %-52s %s\n", type.c_str(), setting.line, e.what());
            }
        }
        keep_least(machine, shell::calibrate_computing());
    }
    std::printf("// Printed by vkt_prediction --table (tests/bench/prediction.cpp) on %s.\n"
                "// SPDX-License-Identifier: MIT\n#include \"shell/machine/typical_rates.h\"\n\n"
                "namespace vkt::shell {\n\nstd::span<TypicalRate const> typical_rates() {\n"
                "    static constexpr TypicalRate rates[] = {\n",
                shell::processor_name().c_str());
    for (auto const& [operation, methods] : rows)
        for (auto const& [method, costs] : methods)
            for (auto const& [rounded, row] : costs) {
                std::printf("{%s, %s, %.4g, {", quoted(operation).c_str(), quoted(method).c_str(), row.cost);
                for (std::size_t i = 0; i < 4; ++i)
                    std::printf("%s%.3g", i == 0 ? "" : ", ",
                                row.counts[i] > 0 ? std::exp(row.logs[i] / row.counts[i]) : 0);
                std::printf("}, %.2g},\n",
                            row.shares > 0 && row.shared / row.shares < 0.55 ? row.shared / row.shares : 1);
            }
    std::printf("    };\n    return rates;\n}\n\n");
    print_calibration(machine);
    return 0;
}

int compare(std::string const& side, std::string const& types, std::string const& only) {
    shell::Calibration const machine = least_of(4);
    int lines = 0, off = 0;
    std::printf("%-8s %-52s %9s %9s %7s  %s\n", "type", "operation", "predicted", "measured", "factor", "method");
    for (std::string const type : {"uint8", "uint16", "float32", "float64"}) {
        if (types.find(type) == std::string::npos) continue;
        Volumes const volumes(side, type);
        for (auto const& setting : settings) {
            std::string const line = setting.line;
            if (line.find(only) == std::string::npos) continue;
            try {
                Measured const m = measured(setting, volumes, false);
                auto const predicted = machine.seconds(m.operation, m.plan, m.inputs, m.reduction, 1);
                double const factor = m.seconds / predicted.value_or(0);
                bool const small = predicted && std::max(m.seconds, *predicted) < m.moved / machine.copy[0];
                bool const good = small || (factor < 1.5 && factor > 1 / 1.5);
                std::printf("%-8s %-52s %9.3f %9.3f %7.2f%c %s, %.3g\n", type.c_str(), line.c_str(),
                            1e9 * predicted.value_or(0) / m.voxels, 1e9 * m.seconds / m.voxels, factor,
                            good ? ' ' : '*', m.plan.method.c_str(), m.plan.cost);
                ++lines;
                if (!good) ++off;
            } catch (Error const& e) {
                std::printf("%-8s %-52s %s\n", type.c_str(), line.c_str(), e.what());
            }
            std::fflush(stdout);
        }
    }
    double const before = total(machine);
    shell::Calibration const after = shell::calibrate_computing();
    std::printf("%d of %d further than a factor of 1.5 away; at the end the machine took %.2f times as long\n", off,
                lines, std::exp((total(after) - before) / static_cast<double>(after.rates.size())));
    return off > 0 ? 1 : 0;
}

} // namespace

int main(int argc, char** argv) try {
    // Threads that wait must not count as if they worked; the runtime reads this as it begins.
    if (std::getenv("OMP_WAIT_POLICY") == nullptr) {
        ::setenv("OMP_WAIT_POLICY", "passive", 1);
        ::execv("/proc/self/exe", argv);
    }
    auto const argument = [&](int i, char const* otherwise) { return std::string(i < argc ? argv[i] : otherwise); };
    std::string folder = "/tmp/vkt-prediction-XXXXXX";
    if (::mkdtemp(folder.data()) == nullptr || ::chdir(folder.c_str()) != 0) return 2;
    write_kernel("line.txt", 5, 1, 1, false);
    write_kernel("cross.txt", 3, 3, 3, true);
    write_kernel("cube.txt", 3, 3, 3, false);
    write_kernel("large.txt", 9, 9, 9, false);
    if (argument(1, "") == "--calibration") {
        print_calibration(least_of(10));
        return 0;
    }
    int const code = argument(1, "") == "--table"
                         ? print_table(argument(2, "128"))
                         : compare(argument(1, "128"), argument(2, "uint8,uint16,float32"), argument(3, ""));
    std::filesystem::current_path("/");
    std::filesystem::remove_all(folder);
    return code;
} catch (std::exception const& e) {
    std::fprintf(stderr, "vkt_prediction: %s\n", e.what());
    return 2;
}
