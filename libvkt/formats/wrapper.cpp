// Whole files compressed: decoders that are fed, encoders that a finished file is put through.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/wrapper.h"

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/decode.h"
#include "libvkt/formats/encode.h"
#include "libvkt/io/temporaries.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <unistd.h>
#include <utility>

#ifdef VKT_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef VKT_HAVE_LZMA
#include <lzma.h>
#endif
#ifdef VKT_HAVE_ZSTD
#include <zstd.h>
#endif

namespace vkt {
namespace {

using namespace std::string_view_literals;

struct Recipe {
    Wrapper wrapper;
    std::string_view suffix, magic;
};

constexpr Recipe kinds[] = {
    {Wrapper::gzip, ".gz"sv, "\x1f\x8b"sv},
    {Wrapper::bzip2, ".bz2"sv, "BZh"sv},
    {Wrapper::xz, ".xz"sv, "\xfd\x37zXZ\0"sv},
    {Wrapper::zstd, ".zst"sv, "\x28\xb5\x2f\xfd"sv},
};

constexpr std::size_t block = std::size_t{128} << 10;

[[noreturn, maybe_unused]] void not_built(std::string const& name, char const* what, char const* package) {
    throw Error(ErrorKind::failure, text("'", name, "' is compressed with ", what, ", which this build lacks"),
                text("build vkt with ", package));
}
[[noreturn, maybe_unused]] void damaged(std::string const& name, char const* what) {
    throw Error(ErrorKind::data, text("'", name, "': damaged ", what, " data"));
}
[[noreturn, maybe_unused]] void ended_early(std::string const& name) {
    throw Error(ErrorKind::data, text("'", name, "' ended early: its compressed data is incomplete"));
}

#ifdef VKT_HAVE_LZMA
class XzStream : public ByteStream {
public:
    explicit XzStream(ByteSource& bytes) : bytes_(bytes), held_(block) {
        if (lzma_stream_decoder(&state_, default_memory(), LZMA_CONCATENATED) != LZMA_OK)
            throw Error(ErrorKind::resources, "no memory for xz");
    }
    ~XzStream() override { lzma_end(&state_); }
    XzStream(XzStream const&) = delete;
    XzStream& operator=(XzStream const&) = delete;

    std::size_t read(std::byte* to, std::size_t n) override {
        state_.next_out = reinterpret_cast<std::uint8_t*>(to);
        state_.avail_out = n;
        while (state_.avail_out > 0 && !ended_) {
            if (state_.avail_in == 0 && !at_end_) {
                state_.avail_in = bytes_.read(held_.data(), held_.size());
                state_.next_in = reinterpret_cast<std::uint8_t const*>(held_.data());
                at_end_ = state_.avail_in == 0;
            }
            lzma_ret const result = lzma_code(&state_, at_end_ ? LZMA_FINISH : LZMA_RUN);
            if (result == LZMA_STREAM_END)
                ended_ = true;
            else if (result == LZMA_MEM_ERROR || result == LZMA_MEMLIMIT_ERROR)
                throw Error(ErrorKind::resources, text("'", bytes_.name(), "': no memory to decode it"));
            else if (result == LZMA_BUF_ERROR && at_end_)
                ended_early(bytes_.name());
            else if (result != LZMA_OK)
                damaged(bytes_.name(), "xz");
        }
        return n - state_.avail_out;
    }

private:
    ByteSource& bytes_;
    std::vector<std::byte> held_;
    lzma_stream state_ = LZMA_STREAM_INIT;
    bool at_end_ = false, ended_ = false;
};
#endif

#ifdef VKT_HAVE_ZSTD
class ZstdStream : public ByteStream {
public:
    explicit ZstdStream(ByteSource& bytes) : bytes_(bytes), held_(block), state_(ZSTD_createDStream()) {
        if (state_ == nullptr) throw Error(ErrorKind::resources, "no memory for Zstandard");
    }
    ~ZstdStream() override { ZSTD_freeDStream(state_); }
    ZstdStream(ZstdStream const&) = delete;
    ZstdStream& operator=(ZstdStream const&) = delete;

    std::size_t read(std::byte* to, std::size_t n) override {
        ZSTD_outBuffer out{to, n, 0};
        while (out.pos < n) {
            if (in_.pos == in_.size) {
                in_ = {held_.data(), bytes_.read(held_.data(), held_.size()), 0};
                // What was fed may have more to give than was asked for so far.
                if (in_.size == 0 && !pending_) {
                    if (inside_) ended_early(bytes_.name());
                    break;
                }
            }
            std::size_t const before = out.pos;
            std::size_t const result = ZSTD_decompressStream(state_, &out, &in_);
            if (ZSTD_isError(result) != 0) damaged(bytes_.name(), "Zstandard");
            inside_ = result != 0;
            pending_ = inside_ && out.pos == n && out.pos > before;
        }
        return out.pos;
    }

private:
    ByteSource& bytes_;
    std::vector<std::byte> held_;
    ZSTD_DStream* state_;
    ZSTD_inBuffer in_{};
    bool inside_ = false; ///< a frame
    bool pending_ = false;
};
#endif

std::unique_ptr<ByteStream> decoder(ByteSource& bytes, Wrapper wrapper) {
    switch (wrapper) {
    case Wrapper::gzip:
        return decode(bytes, Encoding::deflate, DataType::uint8);
    case Wrapper::bzip2:
        return decode(bytes, Encoding::bzip2, DataType::uint8);
    case Wrapper::xz:
#ifdef VKT_HAVE_LZMA
        return std::make_unique<XzStream>(bytes);
#else
        not_built(bytes.name(), "xz", "liblzma-dev");
#endif
    case Wrapper::zstd:
#ifdef VKT_HAVE_ZSTD
        return std::make_unique<ZstdStream>(bytes);
#else
        not_built(bytes.name(), "Zstandard", "libzstd-dev");
#endif
    case Wrapper::none:
        break;
    }
    return decode(bytes, Encoding::raw, DataType::uint8);
}

/// Takes a file's bytes in order and writes others.
class Encoder {
public:
    virtual ~Encoder() = default;
    virtual void write(std::byte const* data, std::size_t n) = 0;
    virtual void finish() = 0;
};

class GzipEncoder : public Encoder {
public:
    GzipEncoder(OutputFile& file, WriteOptions const& options)
        : deflate_(file, DeflateWriter::Wrapper::gzip, options) {}
    void write(std::byte const* data, std::size_t n) override { deflate_.write(data, n); }
    void finish() override { deflate_.finish(); }

private:
    DeflateWriter deflate_;
};

#ifdef VKT_HAVE_BZIP2
class Bzip2Encoder : public Encoder {
public:
    explicit Bzip2Encoder(OutputFile& file) : file_(file), held_(block) {
        if (BZ2_bzCompressInit(&state_, 9, 0, 0) != BZ_OK) throw Error(ErrorKind::resources, "no memory for bzip2");
    }
    ~Bzip2Encoder() override { BZ2_bzCompressEnd(&state_); }
    Bzip2Encoder(Bzip2Encoder const&) = delete;
    Bzip2Encoder& operator=(Bzip2Encoder const&) = delete;
    void write(std::byte const* data, std::size_t n) override {
        state_.next_in = const_cast<char*>(reinterpret_cast<char const*>(data));
        state_.avail_in = static_cast<unsigned>(n);
        while (state_.avail_in > 0) step(BZ_RUN);
    }
    void finish() override {
        while (step(BZ_FINISH) != BZ_STREAM_END) {
        }
    }

private:
    int step(int action) {
        state_.next_out = reinterpret_cast<char*>(held_.data());
        state_.avail_out = static_cast<unsigned>(held_.size());
        int const result = BZ2_bzCompress(&state_, action);
        if (result < 0) throw Error(ErrorKind::failure, "bzip2 failed");
        file_.write(held_.data(), held_.size() - state_.avail_out);
        return result;
    }
    OutputFile& file_;
    std::vector<std::byte> held_;
    bz_stream state_{};
};
#endif

#ifdef VKT_HAVE_LZMA
class XzEncoder : public Encoder {
public:
    XzEncoder(OutputFile& file, WriteOptions const& options) : file_(file), held_(block) {
        lzma_mt settings{};
        settings.threads = static_cast<std::uint32_t>(std::clamp(options.threads.value_or(default_threads()), 1, 256));
        settings.block_size = std::uint64_t{8}
                              << 20; // of a fixed size: the bytes do not tell how many threads there were
        settings.preset = 3;
        settings.check = LZMA_CHECK_CRC64;
        // A thread holds three blocks or so.
        std::size_t const memory = options.memory.value_or(default_memory()) / 4;
        while (settings.threads > 1 && lzma_stream_encoder_mt_memusage(&settings) > memory) --settings.threads;
        if (lzma_stream_encoder_mt(&state_, &settings) != LZMA_OK)
            throw Error(ErrorKind::resources, "no memory for xz");
    }
    ~XzEncoder() override { lzma_end(&state_); }
    XzEncoder(XzEncoder const&) = delete;
    XzEncoder& operator=(XzEncoder const&) = delete;
    void write(std::byte const* data, std::size_t n) override {
        state_.next_in = reinterpret_cast<std::uint8_t const*>(data);
        state_.avail_in = n;
        while (state_.avail_in > 0) step(LZMA_RUN);
    }
    void finish() override {
        while (step(LZMA_FINISH) != LZMA_STREAM_END) {
        }
    }

private:
    lzma_ret step(lzma_action action) {
        state_.next_out = reinterpret_cast<std::uint8_t*>(held_.data());
        state_.avail_out = held_.size();
        lzma_ret const result = lzma_code(&state_, action);
        if (result != LZMA_OK && result != LZMA_STREAM_END) throw Error(ErrorKind::failure, "xz failed");
        file_.write(held_.data(), held_.size() - state_.avail_out);
        return result;
    }
    OutputFile& file_;
    std::vector<std::byte> held_;
    lzma_stream state_ = LZMA_STREAM_INIT;
};
#endif

#ifdef VKT_HAVE_ZSTD
class ZstdEncoder : public Encoder {
public:
    ZstdEncoder(OutputFile& file, WriteOptions const& options) : file_(file), held_(block), state_(ZSTD_createCCtx()) {
        if (state_ == nullptr) throw Error(ErrorKind::resources, "no memory for Zstandard");
        ZSTD_CCtx_setParameter(state_, ZSTD_c_compressionLevel, 3);
        ZSTD_CCtx_setParameter(state_, ZSTD_c_checksumFlag, 1);
        // One worker or several make the same bytes, none other ones; a library without threads refuses.
        int const threads = std::max(1, options.threads.value_or(default_threads()));
        ZSTD_CCtx_setParameter(state_, ZSTD_c_nbWorkers, threads);
    }
    ~ZstdEncoder() override { ZSTD_freeCCtx(state_); }
    ZstdEncoder(ZstdEncoder const&) = delete;
    ZstdEncoder& operator=(ZstdEncoder const&) = delete;
    void write(std::byte const* data, std::size_t n) override {
        ZSTD_inBuffer in{data, n, 0};
        while (in.pos < in.size) step(in, ZSTD_e_continue);
    }
    void finish() override {
        ZSTD_inBuffer in{};
        while (step(in, ZSTD_e_end) != 0) {
        }
    }

private:
    std::size_t step(ZSTD_inBuffer& in, ZSTD_EndDirective directive) {
        ZSTD_outBuffer out{held_.data(), held_.size(), 0};
        std::size_t const left = ZSTD_compressStream2(state_, &out, &in, directive);
        if (ZSTD_isError(left) != 0) throw Error(ErrorKind::failure, "Zstandard failed");
        file_.write(held_.data(), out.pos);
        return left;
    }
    OutputFile& file_;
    std::vector<std::byte> held_;
    ZSTD_CCtx* state_;
};
#endif

std::unique_ptr<Encoder> encoder(OutputFile& file, Wrapper wrapper, WriteOptions const& options) {
    switch (wrapper) {
    case Wrapper::bzip2:
#ifdef VKT_HAVE_BZIP2
        return std::make_unique<Bzip2Encoder>(file);
#else
        not_built(file.path(), "bzip2", "libbz2-dev");
#endif
    case Wrapper::xz:
#ifdef VKT_HAVE_LZMA
        return std::make_unique<XzEncoder>(file, options);
#else
        not_built(file.path(), "xz", "liblzma-dev");
#endif
    case Wrapper::zstd:
#ifdef VKT_HAVE_ZSTD
        return std::make_unique<ZstdEncoder>(file, options);
#else
        not_built(file.path(), "Zstandard", "libzstd-dev");
#endif
    case Wrapper::gzip:
    case Wrapper::none:
        break;
    }
    return std::make_unique<GzipEncoder>(file, options);
}

/// A file under a temporary name, removed however this ends.
class Temporary {
public:
    explicit Temporary(std::string const& beside) : path_(temporary_name(beside)), slot_(remember_temporary(path_)) {
        guard_.emplace(path_);
    }
    ~Temporary() {
        ::unlink(path_.c_str());
        forget_temporary(slot_);
    }
    Temporary(Temporary const&) = delete;
    Temporary& operator=(Temporary const&) = delete;
    std::string const& path() const { return path_; }

private:
    std::string path_;
    int slot_;
    std::optional<Guard> guard_;
};

class WrappingSink : public Sink {
public:
    WrappingSink(std::string const& path, Wrapper wrapper, WriteOptions const& options,
                 std::function<std::unique_ptr<Sink>(std::string const&)> const& create)
        : file_(path, options.force), encoder_(encoder(file_, wrapper, options)), temporary_(file_.target()),
          inner_(create(temporary_.path())) {}

    void begin(Header const& header) override { inner_->begin(header); }
    AnyView acquire(Box const& slab) override { return inner_->acquire(slab); }
    void commit() override { inner_->commit(); }
    bool pass_on(Box const& slab, std::shared_ptr<Lease> const& lease) override { return inner_->pass_on(slab, lease); }
    void put_bricks(BrickSequence bricks) override { inner_->put_bricks(std::move(bricks)); }
    void end() override { inner_->end(); }
    std::int64_t natural_slab() const override { return inner_->natural_slab(); }
    Space space() const override { return inner_->space(); }
    void close() override {
        inner_->close();
        inner_.reset();
        auto const bytes = open_bytes(temporary_.path());
        std::vector<std::byte> held(std::size_t{1} << 20);
        while (std::size_t const got = bytes->read(held.data(), held.size())) encoder_->write(held.data(), got);
        encoder_->finish();
        file_.commit();
    }

private:
    OutputFile file_;
    std::unique_ptr<Encoder> encoder_;
    Temporary temporary_;
    std::unique_ptr<Sink> inner_;
};

} // namespace

Wrapper wrapper_of(std::span<std::byte const> head) {
    for (Recipe const& kind : kinds) {
        if (head.size() < kind.magic.size() || std::memcmp(head.data(), kind.magic.data(), kind.magic.size()) != 0)
            continue;
        // Behind the level comes a block, or the end of an empty file.
        if (kind.wrapper == Wrapper::bzip2 &&
            (head.size() < 10 || (head[4] != std::byte{0x31} && head[4] != std::byte{0x17})))
            continue;
        return kind.wrapper;
    }
    return Wrapper::none;
}

Wrapper wrapper_of_name(std::string_view name) {
    std::string const lower = lower_case(name);
    for (Recipe const& kind : kinds)
        if (lower.size() > kind.suffix.size() && lower.ends_with(kind.suffix)) return kind.wrapper;
    return Wrapper::none;
}

std::string without_wrapper(std::string const& name) {
    std::string const lower = lower_case(name);
    for (Recipe const& kind : kinds)
        if (lower.size() > kind.suffix.size() && lower.ends_with(kind.suffix))
            return name.substr(0, name.size() - kind.suffix.size());
    return name;
}

std::vector<std::byte> unwrapped_head(std::span<std::byte const> head, std::size_t n) {
    Wrapper const wrapper = wrapper_of(head);
    if (wrapper == Wrapper::gzip) return decoded_head(head, n);
    std::vector<std::byte> result(n);
    std::size_t done = 0, given = 0;
    ByteSource bytes("", [&](std::byte* to, std::size_t most) {
        std::size_t const count = std::min(most, head.size() - given);
        std::memcpy(to, head.data() + given, count);
        given += count;
        return count;
    });
    try {
        auto const stream = decoder(bytes, wrapper);
        // A byte at a time: what there is before the damage, or the end of the head, is wanted.
        while (done < n && stream->read(result.data() + done, 1) == 1) ++done;
    } catch (Error const&) { // where the head ends
    }
    result.resize(done);
    return result;
}

std::unique_ptr<ByteSource> unwrapped(std::unique_ptr<ByteSource> bytes, Wrapper wrapper) {
    std::string name = bytes->name();
    std::shared_ptr<ByteSource> const packed = std::move(bytes);
    std::shared_ptr<ByteStream> const stream = decoder(*packed, wrapper);
    return std::make_unique<ByteSource>(std::move(name),
                                        [packed, stream](std::byte* to, std::size_t n) { return stream->read(to, n); });
}

std::unique_ptr<Sink> wrapping_sink(std::string const& path, Wrapper wrapper, WriteOptions const& options,
                                    std::function<std::unique_ptr<Sink>(std::string const&)> const& create) {
    if (options.compress)
        throw Error(ErrorKind::usage, text("--compress: '", path, "' is compressed as a whole already"));
    return std::make_unique<WrappingSink>(path, wrapper, options, create);
}

} // namespace vkt
