// Decoders of binary encodings: plain, deflate, bzip2, hexadecimal. Text is in decode_text.cpp.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/decode.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/decode_text.h"

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#ifdef VKT_HAVE_BZIP2
#include <bzlib.h>
#endif
#include <zlib.h>

namespace vkt {

namespace {

constexpr std::size_t block = std::size_t{128} << 10;

class PlainStream : public ByteStream {
public:
    explicit PlainStream(ByteSource& bytes) : bytes_(bytes) {}
    std::size_t read(std::byte* to, std::size_t n) override { return bytes_.read(to, n); }

private:
    ByteSource& bytes_;
};

/// A block of encoded input for the decoders that are fed.
class Input {
public:
    explicit Input(ByteSource& bytes) : bytes_(bytes), data_(block) {}

    std::string const& name() const { return bytes_.name(); }
    bool refill() {
        count_ = bytes_.read(data_.data(), data_.size());
        return count_ > 0;
    }
    std::byte* data() { return data_.data(); }
    std::size_t count() const { return count_; }

private:
    ByteSource& bytes_;
    std::vector<std::byte> data_;
    std::size_t count_ = 0;
};

class DeflateStream : public ByteStream {
public:
    explicit DeflateStream(ByteSource& bytes) : input_(bytes) {
        // 32 asks zlib to tell gzip from zlib by the first bytes.
        if (inflateInit2(&state_, MAX_WBITS + 32) != Z_OK) throw Error(ErrorKind::resources, "no memory for inflate");
    }
    ~DeflateStream() override { inflateEnd(&state_); }
    DeflateStream(DeflateStream const&) = delete;
    DeflateStream& operator=(DeflateStream const&) = delete;

    std::size_t read(std::byte* to, std::size_t n) override {
        std::size_t done = 0;
        while (done < n && !ended_) {
            if (state_.avail_in == 0) refill();
            uInt const want = static_cast<uInt>(std::min<std::size_t>(n - done, std::numeric_limits<uInt>::max()));
            state_.next_out = reinterpret_cast<Bytef*>(to + done);
            state_.avail_out = want;
            int const result = inflate(&state_, Z_NO_FLUSH);
            done += want - state_.avail_out;
            if (result == Z_STREAM_END)
                ended_ = !next_member();
            else if (result != Z_OK && result != Z_BUF_ERROR)
                throw Error(ErrorKind::data, text("'", input_.name(), "': damaged compressed data",
                                                  state_.msg ? text(" (", state_.msg, ")") : ""));
        }
        return done;
    }

private:
    void refill() {
        if (!input_.refill())
            throw Error(ErrorKind::data, text("'", input_.name(), "' ended early: its compressed data is incomplete"));
        feed();
    }
    void feed() {
        state_.next_in = reinterpret_cast<Bytef*>(input_.data());
        state_.avail_in = static_cast<uInt>(input_.count());
    }
    /// gzip files may be concatenated; anything else behind the end is padding, which gzip ignores as well.
    bool next_member() {
        if (state_.avail_in == 0) {
            if (!input_.refill()) return false;
            feed();
        }
        if (state_.next_in[0] != 0x1f) return false;
        return inflateReset(&state_) == Z_OK;
    }

    Input input_;
    z_stream state_{};
    bool ended_ = false;
};

#ifdef VKT_HAVE_BZIP2
class Bzip2Stream : public ByteStream {
public:
    explicit Bzip2Stream(ByteSource& bytes) : input_(bytes) { start(); }
    ~Bzip2Stream() override { BZ2_bzDecompressEnd(&state_); }
    Bzip2Stream(Bzip2Stream const&) = delete;
    Bzip2Stream& operator=(Bzip2Stream const&) = delete;

    std::size_t read(std::byte* to, std::size_t n) override {
        std::size_t done = 0;
        while (done < n && !ended_) {
            if (state_.avail_in == 0) refill();
            unsigned const want =
                static_cast<unsigned>(std::min<std::size_t>(n - done, std::numeric_limits<unsigned>::max()));
            state_.next_out = reinterpret_cast<char*>(to + done);
            state_.avail_out = want;
            int const result = BZ2_bzDecompress(&state_);
            done += want - state_.avail_out;
            if (result == BZ_STREAM_END)
                ended_ = !next_member();
            else if (result != BZ_OK)
                throw Error(ErrorKind::data, text("'", input_.name(), "': damaged bzip2 data"));
        }
        return done;
    }

private:
    void start() {
        if (BZ2_bzDecompressInit(&state_, 0, 0) != BZ_OK) throw Error(ErrorKind::resources, "no memory for bzip2");
    }
    void refill() {
        if (!input_.refill())
            throw Error(ErrorKind::data, text("'", input_.name(), "' ended early: its compressed data is incomplete"));
        feed();
    }
    void feed() {
        state_.next_in = reinterpret_cast<char*>(input_.data());
        state_.avail_in = static_cast<unsigned>(input_.count());
    }
    bool next_member() {
        if (state_.avail_in == 0) {
            if (!input_.refill()) return false;
            feed();
        }
        if (state_.next_in[0] != 'B') return false;
        char* const next = state_.next_in;
        unsigned const left = state_.avail_in;
        BZ2_bzDecompressEnd(&state_);
        state_ = {};
        start();
        state_.next_in = next;
        state_.avail_in = left;
        return true;
    }

    Input input_;
    bz_stream state_{};
    bool ended_ = false;
};
#endif

/// Two hexadecimal digits a byte; blanks and line ends anywhere.
class HexStream : public ByteStream {
public:
    explicit HexStream(ByteSource& bytes) : input_(bytes) {}

    std::size_t read(std::byte* to, std::size_t n) override {
        std::size_t done = 0;
        while (done < n) {
            if (next_ == input_.count()) {
                next_ = 0;
                if (!input_.refill()) break;
            }
            unsigned const c = std::to_integer<unsigned>(input_.data()[next_++]);
            int const digit = value_of(c);
            if (digit < 0) continue;
            if (half_ < 0) {
                half_ = digit;
            } else {
                to[done++] = static_cast<std::byte>(half_ * 16 + digit);
                half_ = -1;
            }
        }
        return done;
    }

private:
    int value_of(unsigned c) const {
        if (c >= '0' && c <= '9') return static_cast<int>(c - '0');
        unsigned const lower = c | 0x20u;
        if (lower >= 'a' && lower <= 'f') return static_cast<int>(lower - 'a') + 10;
        if (c == ' ' || (c >= '\t' && c <= '\r')) return -1;
        throw Error(ErrorKind::data,
                    text("'", input_.name(), "': byte ", static_cast<int>(c), " is no hexadecimal digit"));
    }

    Input input_;
    std::size_t next_ = 0;
    int half_ = -1;
};

} // namespace

std::unique_ptr<ByteStream> decode(ByteSource& bytes, Encoding encoding, DataType type) {
    switch (encoding) {
    case Encoding::raw:
        return std::make_unique<PlainStream>(bytes);
    case Encoding::deflate:
        return std::make_unique<DeflateStream>(bytes);
    case Encoding::bzip2:
#ifdef VKT_HAVE_BZIP2
        return std::make_unique<Bzip2Stream>(bytes);
#else
        throw Error(ErrorKind::data, text("'", bytes.name(), "' is compressed with bzip2, which is not built in"),
                    "build with libbz2, or convert it: unu save -f nrrd -e gzip");
#endif
    case Encoding::hex:
        return std::make_unique<HexStream>(bytes);
    case Encoding::text:
        return decode_text(bytes, type);
    }
    return nullptr;
}

bool is_gzip(std::span<std::byte const> head) {
    return head.size() >= 2 && head[0] == std::byte{0x1f} && head[1] == std::byte{0x8b};
}

std::vector<std::byte> decoded_head(std::span<std::byte const> head, std::size_t n) {
    std::vector<std::byte> result(n);
    z_stream state{};
    if (inflateInit2(&state, MAX_WBITS + 16) != Z_OK) throw Error(ErrorKind::resources, "no memory for inflate");
    state.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(head.data()));
    state.avail_in = static_cast<uInt>(head.size());
    state.next_out = reinterpret_cast<Bytef*>(result.data());
    state.avail_out = static_cast<uInt>(n);
    while (state.avail_in > 0 && state.avail_out > 0) {
        int const code = inflate(&state, Z_NO_FLUSH);
        // Who compresses in parallel may begin with members of a few bytes.
        if (code == Z_STREAM_END ? inflateReset(&state) != Z_OK : code != Z_OK) break;
    }
    result.resize(n - state.avail_out);
    inflateEnd(&state);
    return result;
}

std::unique_ptr<ByteSource> gunzip(std::unique_ptr<ByteSource> bytes) {
    std::string name = bytes->name();
    std::shared_ptr<ByteSource> const packed = std::move(bytes);
    std::shared_ptr<ByteStream> const stream = decode(*packed, Encoding::deflate, DataType::uint8);
    return std::make_unique<ByteSource>(std::move(name),
                                        [packed, stream](std::byte* to, std::size_t n) { return stream->read(to, n); });
}

std::int64_t least_encoded_bytes(Encoding encoding, std::int64_t n, DataType type) {
    switch (encoding) {
    case Encoding::raw:
        return n;
    case Encoding::deflate:
        return n / 1032; // the densest deflate stream: 258 bytes for two bits
    case Encoding::bzip2:
        return std::min<std::int64_t>(n, 14);
    case Encoding::hex:
        return n > std::numeric_limits<std::int64_t>::max() / 2 ? n : 2 * n;
    case Encoding::text:
        return n / static_cast<std::int64_t>(size_of(type)) * 2 - 1; // a digit and a blank
    }
    return 0;
}

} // namespace vkt
