// How fast this machine is with this build: measured once, kept, and used to tell what a plan will take.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/engine/operation.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

/// A figure for one thread and for all of them.
using ByThreads = std::array<double, 2>;

/// Seconds that an operation under way takes a voxel, as it was measured with one setting.
struct OperationRate {
    std::string operation;
    std::string method; ///< of its plan, without what follows the first digit: "direct FIR, radius "
    int bytes = 4;      ///< of the voxels it was measured with: 2 (uint16) or 4 (float32)
    double cost = 0;    ///< of its plan
    ByThreads seconds{};
};

struct Calibration {
    int threads = 1;          ///< that "all" means
    ByThreads copy{}, scan{}; ///< bytes a second: from memory to memory, and read only
    double file_read = 0;     ///< bytes a second, of a file that lies in the page cache
    double file_write = 0;
    double start = 0; ///< seconds until the program has begun and ended, doing little
    std::vector<OperationRate> rates;

    /// Seconds that a stage computes: what is typical of its operation, method and cost (typical_rates.h), times how
    /// much slower than typical the operation was measured here, or else the median of those that were. None of what is
    /// not in that list.
    std::optional<double> seconds(std::string const& verb, Plan const& plan, std::vector<Header> const& inputs,
                                  bool reduction, int threads) const;
    /// Seconds to read a file of such a volume, or to write it.
    double reading(Header const& header) const;
    double writing(Header const& header) const;

private:
    double slower(std::string const& operation, std::string const& method, std::size_t bytes) const;
    double speedup(std::string const& operation, int threads) const;
};

/// What a plan's method is called, without its numbers.
std::string method_of(Plan const& plan);

/// Seconds of a pipeline within one process, of those of its stages. A thread reads ahead and one writes behind, so
/// that these overlap with what is computed, as far as there are processors.
class Prediction {
public:
    explicit Prediction(int processors) : processors_(std::max(1, processors)) {}

    void read(double seconds);
    /// `waits`: it needs all of its input, so that it begins when what comes before has ended.
    void compute(double seconds, int threads, bool waits);
    void write(double seconds);
    double seconds() const;

private:
    Prediction(int processors, double ended) : processors_(processors), ended_(ended) {}

    int processors_;
    double ended_ = 0; ///< what has ended before the rest begins
    double reading_ = 0, computing_ = 0, writing_ = 0;
    double busy_ = 0;  ///< of all processors together
    bool all_ = false; ///< what computes has a thread on each of them
};

/// Measures, in about two seconds.
Calibration calibrate();
/// What of it is about computing alone: nothing of files, nor of the program's start.
Calibration calibrate_computing();

/// Where calibrations are kept: $XDG_CACHE_HOME/vkt/calibration, or below ~/.cache. Empty if neither is known.
std::string calibration_path();
/// Keeps it, for the owner's eyes only. Throws Error{io}.
void save(Calibration const& calibration);
/// The one that was kept. None if there is none, if it is of another machine or build or cannot be understood, or if
/// it or its folder belongs to somebody else or may be written by others.
std::optional<Calibration> load_calibration();

/// Processor and number of threads, and program and library by size and time: what a calibration holds for.
std::string machine_and_build();
std::string processor_name();

} // namespace vkt::shell
