// Rows of a PNG file: filters by the sum of their bytes, and zlib blocks of strips that know nothing of each other.
// SPDX-License-Identifier: MIT
#include "libvkt/render/png_rows.h"

#include "libvkt/core/error.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <omp.h>
#include <utility>

namespace vkt::render {

namespace {

using Bytes = std::vector<unsigned char>;

unsigned char paeth(int left, int above, int corner) {
    int const a = std::abs(above - corner), b = std::abs(left - corner), c = std::abs(left + above - 2 * corner);
    return static_cast<unsigned char>(a <= b && a <= c ? left : b <= c ? above : corner);
}

/// A row behind the number of its filter: of five the one whose bytes, as signed numbers, are least in sum.
class Filter {
public:
    Filter(std::size_t row_bytes, std::size_t pixel_bytes) : pixel_(pixel_bytes), none_(row_bytes) {
        for (Bytes& filtered : filtered_) filtered.resize(row_bytes + 1);
    }
    /// `above`: null for the first row of a strip, which is to depend on none.
    void add(unsigned char const* row, unsigned char const* above, Bytes& to) {
        std::size_t const n = none_.size();
        bool const first = above == nullptr;
        unsigned char const* const up = first ? none_.data() : above;
        int const filters = first ? 2 : 5;
        std::size_t best = 0;
        std::uint64_t least = ~std::uint64_t{0};
        for (int f = 0; f < filters; ++f) {
            Bytes& out = filtered_[static_cast<std::size_t>(f)];
            out[0] = static_cast<unsigned char>(f);
            apply(f, row, up, out.data() + 1);
            std::uint64_t sum = 0;
            for (std::size_t i = 1; i <= n; ++i) sum += std::min<unsigned>(out[i], 256U - out[i]);
            if (sum < least) least = sum, best = static_cast<std::size_t>(f);
        }
        to.insert(to.end(), filtered_[best].begin(), filtered_[best].end());
    }

private:
    void apply(int filter, unsigned char const* row, unsigned char const* up, unsigned char* out) const {
        std::size_t const n = none_.size();
        auto const each = [&](auto const& expected) {
            for (std::size_t i = 0; i < std::min(pixel_, n); ++i)
                out[i] = static_cast<unsigned char>(row[i] - expected(0, up[i], 0));
            for (std::size_t i = pixel_; i < n; ++i)
                out[i] = static_cast<unsigned char>(row[i] - expected(row[i - pixel_], up[i], up[i - pixel_]));
        };
        switch (filter) {
        case 0:
            return each([](int, int, int) { return 0; });
        case 1:
            return each([](int left, int, int) { return left; });
        case 2:
            return each([](int, int above, int) { return above; });
        case 3:
            return each([](int left, int above, int) { return (left + above) / 2; });
        default:
            return each([](int left, int above, int corner) { return paeth(left, above, corner); });
        }
    }

    std::size_t pixel_;
    Bytes none_;
    std::array<Bytes, 5> filtered_;
};

/// A block of a zlib stream without what is around it; `last` ends the stream.
Bytes deflated(Bytes const& bytes, int level, bool last) {
    z_stream stream{};
    constexpr int raw = -15, memory = 8;
    if (deflateInit2(&stream, level, Z_DEFLATED, raw, memory, Z_FILTERED) != Z_OK)
        throw Error(ErrorKind::resources, "no memory for the PNG encoder");
    Bytes out(deflateBound(&stream, bytes.size()) + 16);
    stream.next_in = const_cast<unsigned char*>(bytes.data());
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = out.data();
    stream.avail_out = static_cast<uInt>(out.size());
    int const result = deflate(&stream, last ? Z_FINISH : Z_FULL_FLUSH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    if (result != (last ? Z_STREAM_END : Z_OK)) throw Error(ErrorKind::failure, "cannot encode PNG");
    return out;
}

/// One strip after the other, of which the last one is remembered.
class Packer {
public:
    Packer(PngRows const& rows, int level) : rows_(rows), level_(level), filter_(rows.row_bytes, rows.pixel_bytes) {}

    /// Rows [first, last).
    void pack(int first, int last) {
        Bytes plain(static_cast<std::size_t>(last - first) * rows_.row_bytes);
        auto const row = [&](int y) { return plain.data() + static_cast<std::size_t>(y - first) * rows_.row_bytes; };
        for (int y = first; y < last; ++y) rows_.fill(y, row(y));
        bool const ends = last == rows_.height;
        if (ends == ends_ && plain == plain_) return;
        Bytes filtered;
        filtered.reserve(plain.size() + static_cast<std::size_t>(last - first));
        for (int y = first; y < last; ++y) filter_.add(row(y), y > first ? row(y - 1) : nullptr, filtered);
        size_ = filtered.size();
        sum_ = adler32(1, filtered.data(), static_cast<uInt>(size_));
        packed_ = deflated(filtered, level_, ends);
        plain_ = std::move(plain), ends_ = ends;
    }
    Bytes const& packed() const { return packed_; }
    std::size_t size() const { return size_; }
    uLong sum() const { return sum_; }

private:
    PngRows const& rows_;
    int level_;
    Filter filter_;
    Bytes plain_, packed_;
    bool ends_ = false;
    std::size_t size_ = 0;
    uLong sum_ = 1;
};

} // namespace

std::vector<std::vector<unsigned char>> packed_rows(PngRows const& rows, int level, int threads) {
    constexpr std::size_t strip_bytes = 1 << 20;
    int const per_strip = static_cast<int>(std::clamp<std::size_t>(strip_bytes / rows.row_bytes, 1, 1 << 16));
    int const count = (rows.height + per_strip - 1) / per_strip;
    std::vector<Bytes> strips(static_cast<std::size_t>(count));
    std::vector<std::pair<uLong, std::size_t>> sums(strips.size());
    std::exception_ptr failure;
    int const crew = std::clamp(threads, 1, count);
    std::vector<Packer> packers; // made here, where it may be said that there is no memory
    packers.reserve(static_cast<std::size_t>(crew));
    for (int t = 0; t < crew; ++t) packers.emplace_back(rows, level);
#pragma omp parallel for num_threads(crew) schedule(dynamic, 4)
    for (int i = 0; i < count; ++i) {
        try {
            Packer& packer = packers[static_cast<std::size_t>(omp_get_thread_num())];
            packer.pack(i * per_strip, std::min((i + 1) * per_strip, rows.height));
            auto const at = static_cast<std::size_t>(i);
            strips[at] = packer.packed();
            sums[at] = {packer.sum(), packer.size()};
        } catch (...) {
#pragma omp critical
            failure = std::current_exception();
        }
    }
    if (failure) std::rethrow_exception(failure);
    // What makes a zlib stream of the blocks.
    Bytes& first = strips.front();
    unsigned char const speed = level < 2 ? 0x01 : level < 6 ? 0x5e : 0x9c;
    first.insert(first.begin(), {0x78, speed});
    uLong sum = 1;
    for (auto const& [part, size] : sums) sum = adler32_combine(sum, part, static_cast<z_off_t>(size));
    for (int shift = 24; shift >= 0; shift -= 8)
        strips.back().push_back(static_cast<unsigned char>(sum >> shift & 255U));
    return strips;
}

} // namespace vkt::render
