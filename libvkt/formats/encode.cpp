// Deflate in independent blocks, a few at a time.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/encode.h"

#include "libvkt/core/execution.h"

#include <algorithm>
#include <array>
#include <exception>

#include <zlib.h>

namespace vkt {

namespace {

constexpr std::size_t block = std::size_t{256} << 10;
constexpr std::size_t stored_block = 65535; // deflate's largest
constexpr std::size_t window = std::size_t{32} << 10;
constexpr std::size_t of_thread = std::size_t{1} << 20; ///< a block before and after, and zlib's own tables
/// No name, no time, system unknown, so that equal volumes give equal files.
constexpr std::array<unsigned char, 10> gzip_head{0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255};
constexpr int level = 4; // on volumes within 3 % of the size that level 6 gives, in half the time

int threads_within(WriteOptions const& options) {
    std::size_t const fitting = options.memory.value_or(default_memory()) / 8 / of_thread;
    int const asked = std::max(1, options.threads.value_or(default_threads()));
    return static_cast<int>(std::clamp<std::size_t>(fitting, 1, static_cast<std::size_t>(asked)));
}

struct Block {
    std::vector<Bytef> bytes;
    unsigned long checksum = 0;
};

/// One block as raw deflate that ends on a byte boundary; the last one ends the stream.
void deflate_block(std::byte const* data, std::size_t n, std::size_t dictionary, bool last, bool crc,
                   Block& block_out) {
    auto const* const bytes = reinterpret_cast<Bytef const*>(data);
    z_stream state{};
    if (deflateInit2(&state, level, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        throw Error(ErrorKind::resources, "no memory for deflate");
    if (dictionary > 0) deflateSetDictionary(&state, bytes - dictionary, static_cast<uInt>(dictionary));
    block_out.bytes.resize(deflateBound(&state, static_cast<uLong>(n)) + 16);
    state.next_in = const_cast<Bytef*>(bytes);
    state.avail_in = static_cast<uInt>(n);
    state.next_out = block_out.bytes.data();
    state.avail_out = static_cast<uInt>(block_out.bytes.size());
    int const result = deflate(&state, last ? Z_FINISH : Z_SYNC_FLUSH);
    block_out.bytes.resize(block_out.bytes.size() - state.avail_out);
    deflateEnd(&state);
    if (result != (last ? Z_STREAM_END : Z_OK)) throw Error(ErrorKind::failure, "deflate failed");
    block_out.checksum = crc ? crc32(0, bytes, static_cast<uInt>(n)) : adler32(1, bytes, static_cast<uInt>(n));
}

} // namespace

DeflateWriter::DeflateWriter(OutputFile& file, Wrapper wrapper, WriteOptions const& options, std::int64_t start)
    : file_(file), wrapper_(wrapper), start_(start), threads_(threads_within(options)),
      checksum_(wrapper == Wrapper::zlib ? adler32(0, nullptr, 0) : crc32(0, nullptr, 0)) {
    held_.reserve(window + block * static_cast<std::size_t>(threads_));
    constexpr std::array<unsigned char, 2> zlib_head{0x78, 0x5e};
    if (wrapper_ == Wrapper::gzip)
        put(gzip_head.data(), gzip_head.size());
    else if (wrapper_ == Wrapper::zlib)
        put(zlib_head.data(), zlib_head.size());
}

void DeflateWriter::put(void const* data, std::size_t n) {
    file_.write(data, n);
    written_ += static_cast<std::int64_t>(n);
}

void DeflateWriter::store(std::string_view head) {
    for (std::size_t done = 0; done < head.size(); done += stored_block) {
        std::size_t const n = std::min(stored_block, head.size() - done);
        auto const low = static_cast<unsigned char>(n), high = static_cast<unsigned char>(n >> 8);
        std::array<unsigned char, 5> const start{0, low, high, static_cast<unsigned char>(~low),
                                                 static_cast<unsigned char>(~high)};
        put(start.data(), start.size());
        put(head.data() + done, n);
    }
    stored_ = head.size();
    stored_checksum_ = crc32_z(0, reinterpret_cast<Bytef const*>(head.data()), stored_);
}

void DeflateWriter::restore(std::string_view head) {
    if (head.size() != stored_) throw Error(ErrorKind::failure, "a header of another length");
    std::size_t const before = static_cast<std::size_t>(start_) + (wrapper_ == Wrapper::gzip ? gzip_head.size() : 0);
    for (std::size_t done = 0; done < stored_; done += stored_block)
        file_.write_at(static_cast<std::int64_t>(before + done / stored_block * 5 + 5 + done), head.data() + done,
                       std::min(stored_block, stored_ - done));
    stored_checksum_ = crc32_z(0, reinterpret_cast<Bytef const*>(head.data()), stored_);
}

void DeflateWriter::write(std::byte const* data, std::size_t n) {
    std::size_t const batch = block * static_cast<std::size_t>(threads_);
    while (n > 0) {
        std::size_t const count = std::min(n, dictionary_ + batch - held_.size());
        held_.insert(held_.end(), data, data + count);
        data += count;
        n -= count;
        // A full batch waits until more comes, so that the last block of the stream is known as such.
        if (n > 0) compress(false);
    }
}

/// Compresses and writes all that is held; short blocks come only at the end of the stream.
void DeflateWriter::compress(bool last) {
    std::size_t const fresh = held_.size() - dictionary_;
    std::size_t const count = last ? std::max<std::size_t>(1, (fresh + block - 1) / block) : fresh / block;
    std::vector<Block> blocks(count);
    std::exception_ptr failure;
#pragma omp parallel for num_threads(threads_) schedule(dynamic)
    for (std::size_t i = 0; i < count; ++i) {
        std::size_t const begin = dictionary_ + i * block;
        std::size_t const size = std::min(block, held_.size() - begin);
        try {
            deflate_block(held_.data() + begin, size, std::min(begin, window), last && i + 1 == count,
                          wrapper_ != Wrapper::zlib, blocks[i]);
        } catch (...) {
#pragma omp critical
            failure = std::current_exception();
        }
    }
    if (failure) std::rethrow_exception(failure);
    for (std::size_t i = 0; i < count; ++i) {
        std::size_t const size = std::min(block, fresh - i * block);
        put(blocks[i].bytes.data(), blocks[i].bytes.size());
        auto const length = static_cast<z_off_t>(size);
        checksum_ = wrapper_ == Wrapper::zlib ? adler32_combine(checksum_, blocks[i].checksum, length)
                                              : crc32_combine(checksum_, blocks[i].checksum, length);
    }
    read_ += fresh;
    dictionary_ = std::min(held_.size(), window);
    held_.erase(held_.begin(), held_.end() - static_cast<std::ptrdiff_t>(dictionary_));
}

void DeflateWriter::finish() {
    compress(true);
    std::array<unsigned char, 8> tail{};
    if (stored_ > 0) checksum_ = crc32_combine(stored_checksum_, checksum_, static_cast<z_off_t>(read_));
    if (wrapper_ == Wrapper::gzip) {
        for (unsigned i = 0; i < 4; ++i) {
            tail[i] = static_cast<unsigned char>(checksum_ >> (8 * i));
            tail[4 + i] = static_cast<unsigned char>((read_ + stored_) >> (8 * i)); // modulo 2^32, as the format has it
        }
        put(tail.data(), 8);
    } else if (wrapper_ == Wrapper::zlib) {
        for (unsigned i = 0; i < 4; ++i) tail[i] = static_cast<unsigned char>(checksum_ >> (24 - 8 * i));
        put(tail.data(), 4);
    }
}

} // namespace vkt
