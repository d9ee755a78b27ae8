// Both ends of the conversation about structured volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/parsed_grids.h"

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/chunk_part.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/tree_file.h"
#include "libvkt/io/module.h"
#include "libvkt/io/parser.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <omp.h>
#include <unistd.h>

namespace vkt {
namespace {

constexpr std::size_t least_half = std::size_t{4} << 20, most_half = std::size_t{64} << 20;
constexpr std::size_t copy_block = std::size_t{1} << 20;

void put(Message& message, ParsedGrids const& grids) {
    message.put(to_json(grids.header));
    message.put(grids.volumes);
    message.put(static_cast<std::int64_t>(grids.attributes.size()));
    for (auto const& attributes : grids.attributes) message.put(attributes_text(attributes));
    message.put(static_cast<std::int64_t>(grids.choices.size()));
    for (auto const& [name, about] : grids.choices) {
        message.put(name);
        message.put(about);
    }
    message.put(static_cast<std::int64_t>(grids.not_read.size()));
    for (auto const& what : grids.not_read) message.put(what);
    message.put_table(std::span<std::int64_t const>(grids.places));
    message.put_table(std::span<std::int64_t const>(grids.chunk_places));
    for (int a = 0; a < 3; ++a) message.put(grids.chunk[a]);
    message.put(std::int64_t{grids.big_endian});
    message.put(grids.slab);
}

ParsedGrids grids_in(Message& message) {
    ParsedGrids grids;
    grids.header = header_from_json(message.text());
    grids.volumes = message.number();
    for (std::int64_t n = message.number(); n > 0; --n) grids.attributes.push_back(parse_attributes(message.text()));
    for (std::int64_t n = message.number(); n > 0; --n) {
        std::string name = message.text();
        grids.choices.emplace_back(std::move(name), message.text());
    }
    for (std::int64_t n = message.number(); n > 0; --n) grids.not_read.push_back(message.text());
    grids.places = message.table<std::int64_t>();
    grids.chunk_places = message.table<std::int64_t>();
    for (int a = 0; a < 3; ++a) grids.chunk[a] = message.number();
    grids.big_endian = message.number() != 0;
    grids.slab = message.number();
    return grids;
}

void put(Message& message, Box const& box) {
    for (int a = 0; a < 3; ++a) {
        message.put(box.lower[a]);
        message.put(box.upper[a]);
    }
}

Box box_in(Message& message) {
    Box box;
    for (int a = 0; a < 3; ++a) {
        box.lower[a] = message.number();
        box.upper[a] = message.number();
    }
    return box;
}

/// Chunks along each axis.
Index3 chunks_of(ParsedGrids const& grids) {
    Index3 n;
    for (int a = 0; a < 3; ++a) n[a] = (grids.header.dims[a] + grids.chunk[a] - 1) / grids.chunk[a];
    return n;
}

class GridsSource : public Source {
public:
    GridsSource(std::string module, std::string what, std::shared_ptr<ByteSource const> bytes, std::int64_t size,
                ReadOptions const& options)
        : module_(std::move(module)), what_(std::move(what)), bytes_(std::move(bytes)), size_(size), options_(options) {
    }

    bool next_volume() override;
    Header const& header() const override { return grids_.header; }
    Access access() const override { return Access::random; }
    void read(AnyView out) override;
    std::int64_t natural_slab() const override;
    std::vector<std::string> not_read() const override { return grids_.not_read; }
    void finish() override {}

private:
    void open();
    void check_answer() const;
    void read_in_place(AnyView const& out);
    void read_chunks(AnyView const& out);
    void to_own_order(AnyView const& out) const;
    void read_through_child(AnyView const& out);

    std::string module_, what_;
    std::shared_ptr<ByteSource const> bytes_;
    std::int64_t size_;
    ReadOptions options_;
    std::unique_ptr<Parser> child_;
    ParsedGrids grids_;
    std::map<std::string, std::string> shared_attributes_;
    std::int64_t index_ = -1;
    std::size_t half_ = least_half;
    std::span<std::byte const> window_;
    std::vector<std::byte> scratch_;
    std::vector<std::vector<std::byte>> chunk_scratch_; ///< one a thread
};

void GridsSource::open() {
    child_ = std::make_unique<Parser>(parser_program(module_, what_), module_, bytes_->descriptor(), bytes_->name(),
                                      parser_limits(options_.memory.value_or(default_memory()), size_));
    Message request;
    request.put(open_grids_request);
    request.put(options_.variable);
    request.put(std::int64_t{options_.force_uniform});
    request.put(std::int64_t{options_.personal});
    request.put(std::int64_t{options_.trust_paths});
    request.put(static_cast<std::int64_t>(options_.together.size()));
    for (std::string const& file : options_.together) request.put(file);
    Message answer = child_->ask(request);
    grids_ = grids_in(answer);
    check_answer();
    if (!grids_.places.empty() || !grids_.chunk_places.empty()) child_->dismiss(); // the voxels are read from the file
    if (!grids_.choices.empty()) {
        std::vector<std::string> names;
        for (auto const& [name, about] : grids_.choices) {
            names.push_back(name);
            grids_.header.attributes["variable " + name] = about;
        }
        grids_.header.attributes["variables"] = join(names, " ");
    }
    mark_as_given(grids_.header);
    shared_attributes_ = grids_.header.attributes;
    auto const slice =
        static_cast<std::size_t>(grids_.header.dims.x * grids_.header.dims.y) * size_of(grids_.header.dtype);
    half_ = std::clamp(slice * static_cast<std::size_t>(grids_.slab), least_half, most_half);
    // One voxel of a row must fit in any case; rows are cut.
}

/// The child may have lost its mind.
void GridsSource::check_answer() const {
    check(grids_.header);
    std::int64_t const slices = grids_.header.dims.z;
    bool const sound =
        grids_.header.kind == Kind::structured && grids_.volumes >= 1 && grids_.volumes <= max_extent &&
        grids_.slab >= 1 && (grids_.attributes.empty() || std::ssize(grids_.attributes) == grids_.volumes) &&
        (grids_.places.empty() ||
         (std::ssize(grids_.places) / slices == grids_.volumes && std::ssize(grids_.places) % slices == 0));
    if (!sound) throw Error(ErrorKind::data, text("'", bytes_->name(), "': its reader contradicts itself"));
    for (int a = 0; a < 3; ++a)
        if (grids_.chunk[a] < 1 || grids_.chunk[a] > max_extent)
            throw Error(ErrorKind::data, text("'", bytes_->name(), "': chunks without an extent"));
    if (!grids_.chunk_places.empty()) {
        Index3 const n = chunks_of(grids_);
        double const all = volume_of(n) * static_cast<double>(grids_.volumes);
        if (all != static_cast<double>(grids_.chunk_places.size()))
            throw Error(ErrorKind::data, text("'", bytes_->name(), "': its chunks do not cover it"));
    }
    for (auto const* const places : {&grids_.places, &grids_.chunk_places})
        if (std::any_of(places->begin(), places->end(), [](std::int64_t place) { return place < 0; }))
            throw Error(ErrorKind::data, text("'", bytes_->name(), "': voxels before its first byte"));
}

bool GridsSource::next_volume() {
    if (!child_) open();
    if (index_ + 1 >= grids_.volumes) {
        index_ = grids_.volumes;
        return false;
    }
    ++index_;
    if (!grids_.attributes.empty()) {
        grids_.header.attributes = shared_attributes_;
        for (auto const& [key, value] : grids_.attributes[static_cast<std::size_t>(index_)])
            grids_.header.attributes[key] = value;
    }
    return true;
}

void GridsSource::read(AnyView out) {
    if (out.box.empty()) return;
    if (!box_of(grids_.header.dims).contains(out.box) || index_ < 0 || index_ >= grids_.volumes)
        throw Error(ErrorKind::failure, text("region ", out.box, " is outside of '", bytes_->name(), "'"));
    if (!grids_.choices.empty()) {
        std::vector<AmrVariable> variables;
        for (auto const& [name, about] : grids_.choices) {
            variables.emplace_back();
            variables.back().name = name;
        }
        choose_variable(variables, "", bytes_->name());
    }
    if (!grids_.places.empty())
        read_in_place(out);
    else if (!grids_.chunk_places.empty())
        read_chunks(out);
    else
        read_through_child(out);
}

std::int64_t GridsSource::natural_slab() const {
    auto const slice =
        grids_.header.dims.x * grids_.header.dims.y * static_cast<std::int64_t>(size_of(grids_.header.dtype));
    std::int64_t const slab = grids_.chunk_places.empty() ? grids_.slab : slices_together(grids_.slab, slice);
    return slab > 1 ? slab : 0;
}

/// Chunk by chunk, several at a time: each is copied out of the file and then to its rows.
void GridsSource::read_chunks(AnyView const& out) {
    Index3 const chunk = grids_.chunk, n = chunks_of(grids_);
    Box chunks;
    for (int a = 0; a < 3; ++a) {
        chunks.lower[a] = out.box.lower[a] / chunk[a];
        chunks.upper[a] = (out.box.upper[a] - 1) / chunk[a] + 1;
    }
    Index3 const count = chunks.dims();
    int const threads = static_cast<int>(std::min<std::int64_t>(default_threads(), chunks.voxels()));
    chunk_scratch_.resize(static_cast<std::size_t>(threads));
    FirstFailure failure;
#pragma omp parallel for num_threads(threads) schedule(dynamic)
    for (std::int64_t i = 0; i < chunks.voxels(); ++i) {
        failure.catch_from([&] {
            Index3 const at = chunks.lower + Index3{i % count.x, i / count.x % count.y, i / count.x / count.y};
            std::int64_t const place =
                grids_.chunk_places[static_cast<std::size_t>(((index_ * n.z + at.z) * n.y + at.y) * n.x + at.x)];
            read_chunk_part(
                {at.x * chunk.x, at.y * chunk.y, at.z * chunk.z}, chunk, out,
                chunk_scratch_[static_cast<std::size_t>(omp_get_thread_num())],
                [&](std::int64_t from, std::byte* to, std::size_t bytes) { bytes_->read_at(place + from, to, bytes); });
        });
    }
    failure.rethrow();
    to_own_order(out);
}

void GridsSource::read_in_place(AnyView const& out) {
    auto const element = static_cast<std::int64_t>(size_of(out.type));
    Index3 const dims = grids_.header.dims, size = out.dims();
    std::int64_t const row = dims.x * element;
    bool const whole_rows = size.x == dims.x && out.row == size.x;
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z) {
        std::int64_t const place = grids_.places[static_cast<std::size_t>(index_ * dims.z + z)];
        if (whole_rows) {
            // Slices that follow one another are one read.
            std::int64_t slices = 1;
            bool const dense = size.y == dims.y && out.slice == size.x * size.y;
            while (dense && z + slices < out.box.upper.z &&
                   grids_.places[static_cast<std::size_t>(index_ * dims.z + z + slices)] ==
                       place + slices * row * dims.y)
                ++slices;
            bytes_->read_at(place + out.box.lower.y * row, out.at(0, out.box.lower.y, z),
                            static_cast<std::size_t>(row * size.y * slices));
            z += slices - 1;
            continue;
        }
        // One read of everything between the first and the last row wanted, piece by piece.
        std::int64_t const rows = std::clamp<std::int64_t>((std::int64_t{256} << 10) / row, 1, size.y);
        for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; y += rows) {
            std::int64_t const count = std::min(rows, out.box.upper.y - y);
            std::int64_t const span = (count - 1) * row + size.x * element;
            scratch_.resize(static_cast<std::size_t>(span));
            bytes_->read_at(place + y * row + out.box.lower.x * element, scratch_.data(),
                            static_cast<std::size_t>(span));
            for (std::int64_t i = 0; i < count; ++i)
                std::memcpy(out.at(out.box.lower.x, y + i, z), scratch_.data() + i * row,
                            static_cast<std::size_t>(size.x * element));
        }
    }
    to_own_order(out);
}

void GridsSource::to_own_order(AnyView const& out) const {
    auto const element = static_cast<std::int64_t>(size_of(out.type));
    Index3 const size = out.dims();
    if (element == 1 || grids_.big_endian == (std::endian::native == std::endian::big)) return;
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
        for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y)
            swap_bytes(out.at(out.box.lower.x, y, z), static_cast<std::size_t>(size.x),
                       static_cast<std::size_t>(element));
}

/// A portion is filled in one half of the shared memory while the one before it is copied out of the other.
void GridsSource::read_through_child(AnyView const& out) {
    if (window_.empty()) window_ = child_->share(2 * half_);
    std::size_t const element = size_of(out.type);
    Index3 const size = out.dims();
    auto const most = static_cast<std::int64_t>(half_ / element);
    Index3 portion = size;
    portion.x = std::min(size.x, most);
    portion.y = std::clamp<std::int64_t>(most / portion.x, 1, size.y);
    portion.z = portion.y < size.y || portion.x < size.x
                    ? 1
                    : std::clamp<std::int64_t>(most / (portion.x * portion.y), 1, size.z);
    // Whole groups of slices that the reader would decode together.
    if (portion.z > grids_.slab && portion.z < size.z) portion.z -= portion.z % grids_.slab;
    std::optional<Box> pending;
    std::size_t half = 0;
    auto const receive = [&] {
        child_->receive();
        copy(dense_view(window_.data() + (1 - half) * half_, out.type, *pending), out.part(*pending));
        pending.reset();
    };
    auto const send = [&](Box const& box) {
        Message request;
        request.put(read_grids_request);
        request.put(index_);
        put(request, box);
        request.put(static_cast<std::int64_t>(half * half_));
        child_->send(request);
    };
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; z += portion.z)
        for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; y += portion.y)
            for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; x += portion.x) {
                Box const box = intersect(out.box, {{x, y, z}, Index3{x, y, z} + portion});
                send(box);
                if (pending) receive();
                pending = box;
                half = 1 - half;
            }
    receive();
}

} // namespace

ParserHandler answer_about_grids(std::function<std::unique_ptr<GridsParser>()> make) {
    std::shared_ptr<GridsParser> file;
    return [make = std::move(make), file](Message& request, std::span<std::byte> window, Message& answer) mutable {
        if (!file) file = make();
        if (request.number() == open_grids_request) {
            GridsChoice choice;
            choice.variable = request.text();
            choice.force_uniform = request.number() != 0;
            choice.personal = request.number() != 0;
            choice.trust_paths = request.number() != 0;
            for (std::int64_t n = request.number(); n > 0; --n) choice.together.push_back(request.text());
            put(answer, file->open(choice));
            return;
        }
        std::int64_t const volume = request.number();
        Box const box = box_in(request);
        file->read(volume, box, window.data() + request.number());
    };
}

std::unique_ptr<Source> parsed_grids(std::string module, std::string what, std::shared_ptr<ByteSource const> bytes,
                                     std::int64_t size, ReadOptions const& options) {
    return std::make_unique<GridsSource>(std::move(module), std::move(what), std::move(bytes), size, options);
}

std::unique_ptr<ByteSource> seekable_bytes(std::unique_ptr<ByteSource> bytes) {
    if (bytes->seekable() && bytes->position() == 0) return bytes;
    std::string const directory = default_execution().temporary_directory;
    int file = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file < 0) {
        std::string name = directory + "/.vkt-bytes-XXXXXX";
        file = ::mkostemp(name.data(), O_CLOEXEC);
        if (file < 0)
            throw Error(ErrorKind::io,
                        text("'", bytes->name(), "': cannot keep it in ", directory, ": ", std::strerror(errno)),
                        "set TMPDIR to a writable directory");
        ::unlink(name.c_str());
    }
    std::vector<std::byte> block(copy_block);
    try {
        while (std::size_t const got = bytes->read(block.data(), block.size()))
            for (std::size_t done = 0; done < got;) {
                ssize_t const n = ::write(file, block.data() + done, got - done);
                if (n < 0 && errno == EINTR) continue;
                if (n <= 0)
                    throw Error(
                        ErrorKind::io,
                        text("'", bytes->name(), "': cannot keep it in ", directory, ": ", std::strerror(errno)),
                        "set TMPDIR to a larger file system, or save it to a file first");
                done += static_cast<std::size_t>(n);
            }
    } catch (...) {
        ::close(file);
        throw;
    }
    ::lseek(file, 0, SEEK_SET);
    return std::make_unique<ByteSource>(file, bytes->name());
}

} // namespace vkt
