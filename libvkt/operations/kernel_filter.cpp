// Kernels from files: reading them, and finding their factors.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernel_filter.h"

#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"
#include "libvkt/operations/row_values.h"

#include <cmath>

namespace vkt {

VKT_OPERATION(KernelFilter, "filter kernel")

namespace {

constexpr std::int64_t most_extent = 129;

[[noreturn]] void refuse(std::string const& path, std::string const& why) {
    throw Error(ErrorKind::data, text("the kernel ", path, ": ", why),
                "a kernel is a volume of odd extents, or text: NX NY NZ and the weights, x fastest");
}

void check_dims(std::string const& path, Index3 dims) {
    for (int axis = 0; axis < 3; ++axis)
        if (dims[axis] < 1 || dims[axis] > most_extent || dims[axis] % 2 == 0)
            refuse(path, text("its extents ", dims.x, " x ", dims.y, " x ", dims.z, " are not odd numbers up to ",
                              most_extent, ", so that it has no middle or is too large"));
}

/// Text begins with a number or a comment, and has no bytes that text has not.
bool looks_like_text(ByteSource& bytes) {
    std::string_view const extension = std::string_view(bytes.name()).substr(bytes.name().find_last_of('.') + 1);
    if (extension == "raw") return false;
    auto const head = bytes.peek(256);
    std::string_view const allowed = "0123456789+-.eE# \t\r\n";
    bool comment = false;
    for (std::byte const byte : head) {
        auto const c = static_cast<char>(byte);
        if (c == '#') comment = true;
        if (c == '\n') comment = false;
        if (comment ? static_cast<unsigned char>(c) < 9 : allowed.find(c) == std::string_view::npos) return false;
    }
    return !head.empty();
}

Kernel read_text(ByteSource& bytes) {
    Kernel kernel;
    std::vector<double> numbers;
    std::size_t wanted = 3;
    while (auto const line = bytes.read_line()) {
        std::string_view rest(*line);
        rest = rest.substr(0, rest.find('#'));
        while (true) {
            std::size_t const begin = rest.find_first_not_of(" \t\r");
            if (begin == std::string_view::npos) break;
            std::size_t const end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
            std::string_view const word = rest.substr(begin, end - begin);
            if (!is_number(word)) refuse(bytes.name(), text("'", word, "' is not a number"));
            numbers.push_back(parse_double(word));
            rest = rest.substr(end);
            if (numbers.size() == 3) {
                for (int axis = 0; axis < 3; ++axis) {
                    double const n = numbers[static_cast<std::size_t>(axis)];
                    kernel.dims[axis] = n >= 1 && n <= 1e6 ? static_cast<std::int64_t>(n) : 0;
                    if (static_cast<double>(kernel.dims[axis]) != n) kernel.dims[axis] = 0;
                }
                check_dims(bytes.name(), kernel.dims);
                wanted = 3 + static_cast<std::size_t>(kernel.dims.x * kernel.dims.y * kernel.dims.z);
            }
            if (numbers.size() > wanted) refuse(bytes.name(), text("it has more than ", wanted - 3, " weights"));
        }
    }
    if (numbers.size() < wanted)
        refuse(bytes.name(), text("it ends after ", numbers.size(), " of ", wanted, " numbers"));
    kernel.weights.assign(numbers.begin() + 3, numbers.end());
    return kernel;
}

Kernel read_volume(std::unique_ptr<ByteSource> bytes, std::string const& path) {
    auto const source = open_volume(std::move(bytes), {});
    if (!source->next_volume()) refuse(path, "it holds no volume");
    Header const header = source->header();
    if (header.kind != Kind::structured) refuse(path, "it is a hierarchical volume");
    check_dims(path, header.dims);
    Execution const execution;
    Volume const volume = load(*source, execution);
    ConstView const view = volume.view();
    Kernel kernel{header.dims, std::vector<double>(static_cast<std::size_t>(header.voxels()))};
    double* to = kernel.weights.data();
    for (std::int64_t z = 0; z < header.dims.z; ++z)
        for (std::int64_t y = 0; y < header.dims.y; ++y, to += header.dims.x) read_row(view, y, z, to);
    for (double& weight : kernel.weights) weight = header.values.physical(weight);
    return kernel;
}

} // namespace

Kernel read_kernel(std::string const& path) {
    auto bytes = open_bytes(path);
    if (bytes->directory()) refuse(path, "it is a directory");
    Kernel kernel = looks_like_text(*bytes) ? read_text(*bytes) : read_volume(std::move(bytes), path);
    for (double const weight : kernel.weights)
        if (!std::isfinite(weight)) refuse(path, "not all of its weights are finite numbers");
    return kernel;
}

std::optional<std::array<std::vector<double>, 3>> factors_of(Kernel const& kernel, double tolerance) {
    Index3 const n = kernel.dims;
    auto const& k = kernel.weights;
    std::size_t peak = 0;
    double sum = 0;
    for (std::size_t i = 0; i < k.size(); ++i) {
        if (std::abs(k[i]) > std::abs(k[peak])) peak = i;
        sum += std::abs(k[i]);
    }
    if (sum == 0) return std::nullopt;
    // The tensor has rank one if it is the product of the rows through its largest element.
    auto const at = static_cast<std::int64_t>(peak);
    std::int64_t const px = at % n.x, py = at / n.x % n.y, pz = at / n.x / n.y;
    auto const value = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        return k[static_cast<std::size_t>((z * n.y + y) * n.x + x)];
    };
    std::array<std::vector<double>, 3> factors;
    for (std::int64_t i = 0; i < n.x; ++i) factors[0].push_back(value(i, py, pz));
    for (std::int64_t i = 0; i < n.y; ++i) factors[1].push_back(value(px, i, pz) / k[peak]);
    for (std::int64_t i = 0; i < n.z; ++i) factors[2].push_back(value(px, py, i) / k[peak]);
    double off = 0;
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x)
                off += std::abs(value(x, y, z) - factors[0][static_cast<std::size_t>(x)] *
                                                     factors[1][static_cast<std::size_t>(y)] *
                                                     factors[2][static_cast<std::size_t>(z)]);
    if (off <= tolerance * sum) return factors;
    return std::nullopt;
}

Texts KernelFilter::texts() const {
    return {
        "Weighted sums of neighbours, with the weights of a file.",
        "Correlation: the weight at (x, y, z) belongs to the neighbour on the same side of the middle; --convolve "
        "mirrors the kernel. The file is text, NX NY NZ and as many weights, x fastest, or a volume; its extents are "
        "odd. Kernels that are products of three factors run along one axis after the other."
        "\n\n"
        "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
        "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
        {{"A mean of the six neighbours and the voxel",
          "printf '3 3 3  0 0 0 0 1 0 0 0 0  0 1 0 1 1 1 0 1 0  0 0 0 0 1 0 0 0 0' >mean.txt; vkt filter kernel "
          "mean.txt volume.nrrd -o sums.nrrd"}}};
}

void KernelFilter::parameters(Parameters& parameters) {
    parameters.positional("file", file_, "the kernel: text (NX NY NZ and the weights) or a volume");
    parameters.flag("convolve", convolve_, "convolve: mirror the kernel in its middle");
    LinearFilter::parameters(parameters);
}

void KernelFilter::check() const {
    LinearFilter::check();
    if (file_.empty()) throw Error(ErrorKind::usage, "no kernel is given");
    if (file_ == "-")
        throw Error(ErrorKind::usage, "the kernel cannot come from standard input, where the volume comes from",
                    "name a file, or <(command)");
}

void KernelFilter::describe(Header const& in, Plan& plan) {
    if (!kernel_) kernel_ = read_kernel(file_);
    Kernel kernel = *kernel_;
    if (convolve_) std::reverse(kernel.weights.begin(), kernel.weights.end());
    Index3 const n = kernel.dims, r{n.x / 2, n.y / 2, n.z / 2};
    auto const size = text(n.x, "x", n.y, "x", n.z);
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                double const weight = kernel.weights[static_cast<std::size_t>((z * n.y + y) * n.x + x)];
                if (weight != 0) dense_.taps.push_back({{x - r.x, y - r.y, z - r.z}, weight});
            }
    dense_.radius = r;
    bool const wide = in.dtype == DataType::float64 || (is_integer(in.dtype) && size_of(in.dtype) >= 4);
    auto const factors = factors_of(kernel, wide ? 0x1p-50 : 0x1p-24);
    if (factors && static_cast<std::int64_t>(dense_.taps.size()) > n.x + n.y + n.z) {
        auto const taps = [&](int axis) {
            return AxisTaps{AxisTaps::Kind::plain, (*factors)[static_cast<std::size_t>(axis)]};
        };
        sum_.x = {taps(0)};
        sum_.y = {taps(1)};
        sum_.z = {taps(2)};
        sum_.planes = {{}};
        sum_.terms = {{}};
        plan.method = text("separable kernel, ", size);
    } else {
        plan.method = text("direct, kernel ", size, ", ", dense_.taps.size(), " weights");
    }
}

} // namespace vkt
