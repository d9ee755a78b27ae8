// Both ends of the conversation about a tree.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/parsed_tree.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module.h"
#include "libvkt/io/parser.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <mutex>
#include <utility>

namespace vkt {
namespace {

enum Request : std::int64_t { list_request, read_request, cells_request };

void put(Message& message, std::optional<double> value) {
    message.put(std::int64_t{value.has_value()});
    message.put(value.value_or(0));
}

std::optional<double> optional_real(Message& message) {
    bool const there = message.number() != 0;
    double const value = message.real();
    return there ? std::optional(value) : std::nullopt;
}

void put(Message& message, AmrListing const& listing) {
    message.put(listing.format);
    message.put(std::int64_t{listing.dimensions});
    message.put(static_cast<std::int64_t>(listing.variables.size()));
    for (AmrVariable const& variable : listing.variables) {
        message.put(variable.name);
        message.put(static_cast<std::int64_t>(variable.dtype));
        put(message, variable.minimum);
        put(message, variable.maximum);
        message.put(variable.extent);
    }
    message.put(static_cast<std::int64_t>(listing.not_read.size()));
    for (std::string const& what : listing.not_read) message.put(what);
    message.put(to_json(listing.header));
    message.put_table(std::span<Brick const>(listing.bricks));
    message.put(listing.blocks_in_file);
}

DataType data_type(std::int64_t number) {
    if (number < 0 || number > static_cast<std::int64_t>(DataType::float64))
        throw Error(ErrorKind::data, "its reader named a type that there is not");
    return static_cast<DataType>(number);
}

AmrListing listing_in(Message& message) {
    AmrListing listing;
    listing.format = message.text();
    listing.dimensions = static_cast<int>(message.number());
    for (std::int64_t n = message.number(); n > 0; --n) {
        AmrVariable variable;
        variable.name = message.text();
        variable.dtype = data_type(message.number());
        variable.minimum = optional_real(message);
        variable.maximum = optional_real(message);
        variable.extent = message.text();
        listing.variables.push_back(std::move(variable));
    }
    for (std::int64_t n = message.number(); n > 0; --n) listing.not_read.push_back(message.text());
    listing.header = header_from_json(message.text());
    listing.bricks = message.table<Brick>();
    if (!listing.bricks.empty()) check_bricks(listing.header.dims, listing.bricks);
    listing.blocks_in_file = message.number();
    return listing;
}

/// The child's side.
class Answers {
public:
    explicit Answers(std::shared_ptr<TreeParser> file) : file_(std::move(file)) {}

    void operator()(Message& request, std::span<std::byte> window, Message& answer) {
        switch (request.number()) {
        case list_request:
            put(answer, file_->listing());
            break;
        case read_request:
            read(request, answer);
            break;
        default: {
            auto const first = static_cast<std::size_t>(request.number());
            auto const count = static_cast<std::size_t>(request.number());
            tree_.cells(first, count, window.data() + request.number());
        }
        }
    }

private:
    void read(Message& request, Message& answer) {
        AmrReadOptions options;
        options.variable = request.text();
        if (std::int64_t const dtype = request.number(); dtype >= 0) options.dtype = data_type(dtype);
        options.roi.text = request.text();
        options.world_roi.text = request.text();
        tree_ = file_->read(options);
        answer.put(to_json(with_counts(tree_.header, tree_.bricks)));
        bool const listed = tree_.bricks == file_->listing().bricks; // most often, and the table is long
        answer.put(std::int64_t{listed});
        if (!listed) answer.put_table(std::span<Brick const>(tree_.bricks));
        answer.put_table(std::span<std::int64_t const>(tree_.places));
    }

    std::shared_ptr<TreeParser> file_;
    ParsedTree tree_;
};

/// Cells that lie in the file as they are wanted, read by all threads.
void read_in_place(ByteSource const& bytes, std::span<std::size_t const> sizes, std::span<std::int64_t const> places,
                   std::byte* to, Execution const& execution) {
    /// Bricks that follow one another in the file.
    struct Run {
        std::int64_t from;
        std::size_t to, bytes;
    };
    std::vector<Run> runs;
    std::size_t filled = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
        if (!runs.empty() && runs.back().from + static_cast<std::int64_t>(runs.back().bytes) == places[i])
            runs.back().bytes += sizes[i];
        else
            runs.push_back({places[i], filled, sizes[i]});
        filled += sizes[i];
    }
    std::exception_ptr failure;
    auto const count = static_cast<std::int64_t>(runs.size());
#pragma omp parallel for num_threads(execution.threads) schedule(dynamic, 16)
    for (std::int64_t r = 0; r < count; ++r) {
        Run const& run = runs[static_cast<std::size_t>(r)];
        try {
            bytes.read_at(run.from, to + run.to, run.bytes);
        } catch (...) {
#pragma omp critical(vkt_parsed)
            failure = std::current_exception();
        }
    }
    if (failure) std::rethrow_exception(failure);
}

class ParsedFile : public AmrFile, public std::enable_shared_from_this<ParsedFile> {
public:
    ParsedFile(std::string const& module, std::string const& what, std::shared_ptr<ByteSource const> bytes,
               std::size_t memory)
        : bytes_(std::move(bytes)), child_(parser_program(module, what), module, bytes_->descriptor(), bytes_->name(),
                                           parser_limits(memory, bytes_->size())) {
        Message request;
        request.put(list_request);
        Message answer = child_.ask(request);
        listing_ = listing_in(answer);
    }

    AmrListing const& listing() const override { return listing_; }

    BrickSequence read(AmrReadOptions const& options, Execution const& execution) override {
        std::scoped_lock const lock(mutex_);
        Message request;
        request.put(read_request);
        request.put(options.variable);
        request.put(options.dtype ? static_cast<std::int64_t>(*options.dtype) : std::int64_t{-1});
        request.put(options.roi.text);
        request.put(options.world_roi.text);
        Message answer = child_.ask(request);
        int const reading = ++readings_;
        Header header = header_from_json(answer.text());
        bool const listed = answer.number() != 0;
        std::vector<Brick> bricks = listed ? listing_.bricks : answer.table<Brick>();
        check_bricks(header.dims, bricks);
        std::vector<std::int64_t> places = answer.table<std::int64_t>();
        std::vector<std::size_t> sizes = collect(bricks, [n = size_of(header.dtype)](Brick const& brick) {
            return static_cast<std::size_t>(brick.cells()) * n;
        });
        if (places.empty())
            return {std::move(header), std::move(bricks),
                    [file = shared_from_this(), reading, sizes = std::move(sizes)](std::size_t first, std::size_t count,
                                                                                   std::byte* to) {
                        file->read_through_child(reading, sizes, first, first + count, to);
                    }};
        if (places.size() != bricks.size() || *std::min_element(places.begin(), places.end()) < 0)
            throw Error(ErrorKind::data, text("'", bytes_->name(), "': its reader does not say where all cells lie"));
        return {std::move(header), std::move(bricks),
                [file = shared_from_this(), sizes = std::move(sizes), places = std::move(places),
                 execution](std::size_t first, std::size_t count, std::byte* to) {
                    read_in_place(*file->bytes_, std::span(sizes).subspan(first, count),
                                  std::span(places).subspan(first, count), to, execution);
                }};
    }

private:
    /// A portion is filled in one half of the shared memory while the one before it is copied out of the other.
    void read_through_child(int reading, std::span<std::size_t const> sizes, std::size_t first, std::size_t end,
                            std::byte* to) {
        std::scoped_lock const lock(mutex_);
        if (reading != readings_)
            throw Error(ErrorKind::failure,
                        text("'", bytes_->name(), "': another of its variables was read meanwhile"));
        if (window_.empty()) {
            half_ = std::max(half_, *std::max_element(sizes.begin(), sizes.end()));
            window_ = child_.share(2 * half_);
        }
        std::size_t pending = 0; // bytes of the portion under way
        for (std::size_t half = 0; first < end || pending > 0; half = 1 - half) {
            std::size_t bytes = 0, last = first;
            while (last < end && bytes + sizes[last] <= half_) bytes += sizes[last++];
            if (last > first) {
                Message request;
                request.put(cells_request);
                request.put(static_cast<std::int64_t>(first));
                request.put(static_cast<std::int64_t>(last - first));
                request.put(static_cast<std::int64_t>(half * half_));
                child_.send(request);
            }
            if (pending > 0) {
                child_.receive();
                std::memcpy(to, window_.data() + (1 - half) * half_, pending);
                to += pending;
            }
            pending = bytes;
            first = last;
        }
    }

    std::shared_ptr<ByteSource const> bytes_;
    Parser child_;
    AmrListing listing_;
    std::mutex mutex_;
    std::size_t half_ = std::size_t{4} << 20;
    std::span<std::byte const> window_;
    int readings_ = 0; ///< the child knows the cells of the last one
};

} // namespace

ParserHandler answer_about(std::shared_ptr<TreeParser> file) { return Answers(std::move(file)); }

std::shared_ptr<AmrFile> parsed_file(std::string const& module, std::string const& what,
                                     std::shared_ptr<ByteSource const> bytes, std::size_t memory) {
    return std::make_shared<ParsedFile>(module, what, std::move(bytes), memory);
}

} // namespace vkt
