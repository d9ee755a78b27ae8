// Kernels from files: reading them, and finding their factors.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernel_filter.h"

#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/module.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/row_values.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

/// Text begins with a number, after comments, and has no bytes that text has not.
bool looks_like_text(ByteSource& bytes) {
    std::string_view const extension = std::string_view(bytes.name()).substr(bytes.name().find_last_of('.') + 1);
    if (extension == "raw" || extension == "vtk") return false; // whose second line may be any title
    auto const head = bytes.peek(256);
    bool comment = false, begun = false;
    for (std::byte const byte : head) {
        auto const c = static_cast<char>(byte);
        bool const space = c == ' ' || c == '\t' || c == '\r' || c == '\n';
        if (static_cast<unsigned char>(c) < ' ' && !space) return false;
        if (c == '#') comment = true;
        if (c == '\n') comment = false;
        if (begun || comment || space) continue;
        if (std::string_view("0123456789+-.").find(c) == std::string_view::npos) return false;
        begun = true;
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
                    kernel.dims[axis] = std::abs(n) < 1e15 && n == std::floor(n) ? static_cast<std::int64_t>(n) : 0;
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

Kernel read_volume(Source& source, std::string const& path) {
    if (!source.next_volume()) refuse(path, "it holds no volume");
    Header const header = source.header();
    if (header.kind != Kind::structured) refuse(path, "it is a hierarchical volume");
    check_dims(path, header.dims);
    Execution const execution;
    Volume const volume = load(source, execution);
    ConstView const view = volume.view();
    Kernel kernel{header.dims, std::vector<double>(static_cast<std::size_t>(header.voxels()))};
    double* to = kernel.weights.data();
    for (std::int64_t z = 0; z < header.dims.z; ++z)
        for (std::int64_t y = 0; y < header.dims.y; ++y, to += header.dims.x) read_row(view, y, z, to);
    for (double& weight : kernel.weights) weight = header.values.physical(weight);
    return kernel;
}

Kernel finite(Kernel kernel, std::string const& path) {
    for (double const weight : kernel.weights)
        if (!std::isfinite(weight)) refuse(path, "not all of its weights are finite numbers");
    return kernel;
}

} // namespace

Kernel read_kernel(std::string const& path) {
    auto bytes = open_bytes(path);
    bool const is_text = !bytes->directory() && looks_like_text(*bytes);
    return finite(is_text ? read_text(*bytes) : read_volume(*open_volume(std::move(bytes), {}), path), path);
}

namespace {

/// Multiply-adds of sums of several products that take as long as one of a dense kernel, which shares its loads.
constexpr double passes_per_tap = 4;

double sum_of_magnitudes(std::vector<double> const& values) {
    double sum = 0;
    for (double const v : values) sum += std::abs(v);
    return sum;
}

/// The cross through the largest element of a matrix, whose rows follow one another: the row, and the column divided by
/// that element. Takes their product from the matrix.
struct Cross {
    std::vector<double> row, column;
};
Cross take_cross(std::vector<double>& matrix, std::size_t width) {
    std::size_t peak = 0;
    for (std::size_t i = 0; i < matrix.size(); ++i)
        if (std::abs(matrix[i]) > std::abs(matrix[peak])) peak = i;
    std::size_t const height = matrix.size() / width, x = peak % width, y = peak / width;
    double const largest = matrix[peak];
    Cross cross;
    for (std::size_t i = 0; i < width; ++i) cross.row.push_back(matrix[y * width + i]);
    for (std::size_t i = 0; i < height; ++i) cross.column.push_back(matrix[i * width + x] / largest);
    for (std::size_t j = 0; j < height; ++j)
        for (std::size_t i = 0; i < width; ++i) matrix[j * width + i] -= cross.column[j] * cross.row[i];
    return cross;
}

bool all_integers(std::vector<double> const& values) {
    return std::all_of(values.begin(), values.end(), [](double v) { return v == std::nearbyint(v); });
}

} // namespace

std::optional<KernelProducts> products_of(Kernel const& kernel, double tolerance, double most) {
    auto const plain = [](std::vector<double> taps) { return AxisTaps{AxisTaps::Kind::plain, std::move(taps)}; };
    auto const width = static_cast<std::size_t>(kernel.dims.x), height = static_cast<std::size_t>(kernel.dims.y);
    double const sum = sum_of_magnitudes(kernel.weights);
    if (sum == 0) return std::nullopt;
    SeparableSum products;
    std::vector<double> left = kernel.weights;
    double magnitude = 0, off = 0;
    // Half of what may remain is for the crosses of x, the other half for those of y and z.
    while (sum_of_magnitudes(left) > 0.5 * tolerance * sum) {
        Cross const outer = take_cross(left, width);
        double const along_x = sum_of_magnitudes(outer.row);
        products.x.push_back(plain(outer.row));
        std::vector<double> rest = outer.column;
        double const share = sum_of_magnitudes(rest);
        while (sum_of_magnitudes(rest) > 0.25 * tolerance * share) {
            Cross const inner = take_cross(rest, height);
            products.y.push_back(plain(inner.row));
            products.z.push_back(plain(inner.column));
            auto const plane = static_cast<int>(products.planes.size());
            products.planes.push_back({static_cast<int>(products.x.size()) - 1, plane});
            products.terms.push_back({plane, plane});
            magnitude += along_x * sum_of_magnitudes(inner.row) * sum_of_magnitudes(inner.column);
            if (products.cost() > most || magnitude > 4 * sum) return std::nullopt;
        }
        off += along_x * sum_of_magnitudes(rest);
    }
    double const lacking = (off + sum_of_magnitudes(left)) / sum;
    if (lacking > tolerance) return std::nullopt;
    return KernelProducts{std::move(products), lacking};
}

Texts KernelFilter::texts() const {
    return {
        "Weighted sums of neighbours, with the weights of a file.",
        "Correlation: the weight at (x, y, z) belongs to the neighbour on the same side of the middle; --convolve "
        "mirrors the kernel. The file is text, NX NY NZ and as many weights, x fastest, or a volume; its extents are "
        "odd. Kernels that are products of three factors, or sums of a few of them, run along one axis after the other "
        "where that is less work."
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
    parameters.option(
        "method", method_, "M",
        "direct: weight by weight; separable: along one axis after the other; fft: by Fourier transforms; auto: the "
        "cheapest one");
    parameters.option("tolerance", tolerance_, "P%",
                      "what may be left out of the kernel, in percent of the sum of its weights' magnitudes (default: "
                      "what rounding costs anyway)");
    LinearFilter::parameters(parameters);
}

std::vector<Knob> KernelFilter::knobs() const {
    std::vector<Knob> result = LinearFilter::knobs();
    result.push_back({"tolerance", {"10%", "1%", "0.1%", "0.01%"}, "1e-10%"});
    return result;
}

void KernelFilter::take_volume(Source& opened) {
    kernel_.of(file_, [&](std::string const& path) { return finite(read_volume(opened, path), path); });
}

void KernelFilter::check() const {
    LinearFilter::check();
    if (tolerance_) check_tolerance(*tolerance_);
    if (file_.empty()) throw Error(ErrorKind::usage, "no kernel is given");
    if (file_ == "-")
        throw Error(ErrorKind::usage, "the kernel cannot come from standard input, where the volume comes from",
                    "name a file, or <(command)");
}

LinearFilter::Weights KernelFilter::weights(Header const& in, Index3 /*cell_width*/) const {
    Weights result;
    Kernel kernel = kernel_.of(file_, read_kernel);
    if (convolve_) std::reverse(kernel.weights.begin(), kernel.weights.end());
    Index3 const n = kernel.dims, r{n.x / 2, n.y / 2, n.z / 2};
    auto const size = text(n.x, "x", n.y, "x", n.z);
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                double const weight = kernel.weights[static_cast<std::size_t>((z * n.y + y) * n.x + x)];
                if (weight != 0) result.dense.taps.push_back({{x - r.x, y - r.y, z - r.z}, weight});
            }
    result.dense.radius = r;
    bool const wide = in.dtype == DataType::float64 || (is_integer(in.dtype) && size_of(in.dtype) >= 4);
    auto const taps = static_cast<double>(result.dense.taps.size());
    double total = 0;
    for (Tap const& tap : result.dense.taps) total += std::abs(tap.weight);
    double const largest = is_integer(in.dtype) ? std::max(-lowest_of(in.dtype), highest_of(in.dtype)) : 1;
    if (!wide && total * largest > static_cast<double>(std::numeric_limits<float>::max()))
        throw Error(ErrorKind::usage,
                    text("the weights of the kernel ", file_, " add up to ", total,
                         ", too much for the float32 in which ", in.dtype, " is filtered"),
                    "convert the volume first: vkt convert --dtype float64");
    bool const exact =
        is_integer(in.dtype) && all_integers(kernel.weights) && method_ == KernelMethod::automatic && !tolerance_;
    double const rounding = wide ? 0x1p-50 : 0x1p-24, allowed = tolerance_ ? tolerance_->share() : rounding;
    std::optional<KernelProducts> products;
    if (method_ == KernelMethod::automatic || method_ == KernelMethod::separable)
        products = products_of(kernel, std::max(allowed, rounding),
                               method_ == KernelMethod::separable
                                   ? 1e4
                                   : std::max(taps / passes_per_tap, static_cast<double>(n.x + n.y + n.z)));
    if (method_ == KernelMethod::separable && !products && taps > 0)
        throw Error(ErrorKind::usage, text("--method separable: the kernel ", file_, " is no sum of few products"),
                    "leave the choice to vkt (--method auto), or allow a larger --tolerance");
    FftSquares const squares(r, in.dims);
    double const transforms_error = squares.error(r);
    if (method_ == KernelMethod::fft && tolerance_ && transforms_error > allowed)
        throw Error(ErrorKind::usage,
                    text("--method fft: the error of its transforms is ", 100 * transforms_error, "%"),
                    "leave the choice to vkt (--method auto), or allow a larger --tolerance");
    bool const one = products && products->sum.terms.size() == 1;
    double const products_cost = products ? products->sum.cost() : 0;
    bool const cheaper = products && (one ? taps > products_cost : taps > passes_per_tap * products_cost);
    bool const transforms_allowed = tolerance_ ? transforms_error <= allowed : !wide && !exact;
    if (products && (method_ == KernelMethod::separable || (cheaper && (one || !exact)))) {
        result.sum = products->sum;
        result.more_error = products->left;
        result.method = one ? text("separable kernel, ", size)
                            : text("sum of ", result.sum.terms.size(), " separable kernels, ", size);
    } else if (taps > 0 && (method_ == KernelMethod::fft || (method_ == KernelMethod::automatic && transforms_allowed &&
                                                             taps > squares.cost && module_installed("kissfft")))) {
        if (!module_installed("kissfft")) module_functions("kissfft", "filter kernel --method fft");
        result.by_fft = true;
        result.more_error = transforms_error;
        result.cost = squares.cost;
        result.method = text("Fourier transforms, kernel ", size, ", squares of ", squares.edge,
                             "; directly on a GPU and around what is not finite");
    } else {
        result.method = text("direct, kernel ", size, ", ", result.dense.taps.size(), " weights");
    }
    return result;
}

void KernelFilter::prepare(Header const& in, Index3 cell_width) {
    LinearFilter::prepare(in, cell_width);
    fft_.reset();
    dims_ = in.dims;
}

Box KernelFilter::footprint(Box const& output, int input) const {
    Box box = LinearFilter::footprint(output, input);
    if (!weights_.by_fft) return box;
    // Squares are whole wherever the output begins.
    box.lower.x = -reach_.x;
    box.lower.y = -reach_.y;
    box.upper.x = dims_.x + reach_.x;
    box.upper.y = dims_.y + reach_.y;
    return box;
}

std::size_t KernelFilter::fit(Index3 largest, Execution const& execution) {
    if (!weights_.by_fft || execution.device == Device::gpu) return LinearFilter::fit(largest, execution);
    return FftSquares(reach_, dims_).bytes(reach_) * static_cast<std::size_t>(std::max(1, execution.threads) + 1) +
           static_cast<std::size_t>(largest.x * largest.y * largest.z) * sizeof(double);
}

void KernelFilter::filter(ConstView in, AnyView out, Execution const& execution) {
    if (!weights_.by_fft || execution.device == Device::gpu) {
        LinearFilter::filter(in, out, execution);
        return;
    }
    if (!fft_) fft_.emplace(weights_.dense, dims_);
    Index3 const n = out.box.dims();
    std::vector<double> sums(static_cast<std::size_t>(n.x * n.y * n.z));
    AnyView const wide = dense_view(reinterpret_cast<std::byte*>(sums.data()), DataType::float64, out.box);
    fft_->run(in, wide, execution);
    convert_values(wide, out, losses_, execution);
}

} // namespace vkt
