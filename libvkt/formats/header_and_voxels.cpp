// A header and voxels, in one file or in two.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/header_and_voxels.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/wrapper.h"
#include "libvkt/io/system_error.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace vkt {

namespace {

/// Along the axis that enumerates volumes.
std::optional<double> position_of(Header const& header) { return number_of(header, "sequence position"); }

bool other_channel(Header const& header, Header const& first) {
    auto const a = header.attributes.find("channel"), b = first.attributes.find("channel");
    return a != header.attributes.end() && (b == first.attributes.end() || a->second != b->second);
}

} // namespace

HeaderAndVoxelsWriter::HeaderAndVoxelsWriter(HeaderFormat format, std::string const& path, WriteOptions const& options)
    : format_(std::move(format)), options_(options) {
    if (format_.channel_axis) axes_.emplace(format_.name + " file", format_.attached);
    std::string const name = lower_case(path);
    bool const detached = !format_.detached.empty() && name.ends_with(format_.detached);
    bool const packed = name.ends_with(".gz");
    if (packed && !format_.detached.empty() && name.ends_with(format_.detached + ".gz"))
        throw Error(ErrorKind::usage, text("a detached ", format_.name, " header is not compressed"),
                    text("write one file: NAME", format_.attached, ".gz"));
    if (options_.compress && format_.compressed_data.empty() && !packed && path != "-")
        throw Error(ErrorKind::usage, text(format_.name, " files are compressed as a whole, and named so"),
                    text("name it NAME", format_.attached, ".gz"));
    whole_ = !detached && (packed || (options_.compress && format_.compressed_data.empty()));
    if (whole_) options_.compress = false; // once is enough
    if (detached) {
        header_file_.emplace(path, options_.force);
        // Beside the header: that is where readers look for it.
        std::string data = header_file_->target();
        if (lower_case(data).ends_with(format_.detached)) data.resize(data.size() - format_.detached.size());
        data += options_.compress ? format_.compressed_data : format_.data;
        data_file_.emplace(data, options_.force);
        data_name_ = std::filesystem::path(data).filename().string();
        return;
    }
    data_file_.emplace(path, options_.force);
    if (whole_) deflate_.emplace(*data_file_, DeflateWriter::Wrapper::gzip, options_);
    if (options_.compress && format_.states_compressed_size && data_file_->in_place())
        throw Error(ErrorKind::usage,
                    text("compressed ", format_.name, " cannot go to a pipe, since its size comes first"),
                    "write a file, or NRRD");
}

void HeaderAndVoxelsWriter::write(std::byte const* voxels, std::size_t n) {
    if (deflate_)
        deflate_->write(voxels, n);
    else
        data_file_->write(voxels, n);
}

void HeaderAndVoxelsWriter::check_volume(Header const& header) {
    std::string const each = text("name it like out_%04d", format_.attached);
    refuse_bricks(header, format_.name);
    if (format_.type_name(header.dtype).empty())
        throw Error(ErrorKind::usage, text(format_.name, " cannot hold ", header.dtype),
                    "convert first: vkt convert --dtype float32");
    if (volumes_ > 0) {
        bool const slices = first_.dims == header.dims && first_.dims.z == 1 && first_.dtype == header.dtype;
        check_lattice(first_, header, text(format_.name, " file"),
                      slices ? "slices make one volume: name their folder, or order them with vkt stack"
                             : "write one file each: " + each);
    }
    if (volumes_ > 0 && !header_file_ && data_file_->in_place())
        throw Error(ErrorKind::usage,
                    text(format_.name, " on a pipe cannot hold several volumes, since their number comes first"),
                    "write a file, or one file each: " + each);
}

/// One axis knows a first place and a step.
void HeaderAndVoxelsWriter::check_place(Header const& header) {
    std::optional<double> const at = position_of(header), first = position_of(first_);
    // All channels have the times of the first one.
    bool const other = axes_ ? axes_->channel_of_last() > 0 : other_channel(header, first_);
    std::int64_t const time = axes_ ? axes_->time_of_last() : volumes_;
    if (!at || !first || time == 0 || other) return;
    if (!step_) step_ = (*at - *first) / static_cast<double>(time); // the second one tells
    if (std::abs(*first + *step_ * static_cast<double>(time) - *at) > 1e-3 * std::abs(*step_))
        throw Error(ErrorKind::usage,
                    text("volume ", volumes_, " lies at ", *at, ", not ", *step_,
                         " behind the one before it, which one ", format_.name, " file cannot say"),
                    text("write one file each: name it like out_%04d", format_.attached));
}

/// Channels inside of times: the file has them the other way round.
bool HeaderAndVoxelsWriter::turned() const {
    if (!axes_) return false;
    std::vector<SeriesAxis> const axes = axes_->axes();
    return axes.size() > 1 && axes.front().time;
}

std::int64_t HeaderAndVoxelsWriter::channels() const {
    for (SeriesAxis const& axis : axes_ ? axes_->axes() : std::vector<SeriesAxis>{})
        if (!axis.time) return axis.size();
    return 1;
}

std::string HeaderAndVoxelsWriter::header_text(std::size_t length) const {
    std::int64_t const compressed = !options_.compress ? -1 : deflate_ ? deflate_->bytes_written() : 0;
    bool const last_word = !header_file_ && data_file_->in_place();
    return format_.text({first_, volumes_, compressed, data_name_, length, last_word, channels()});
}

/// Of a header that has room for the distance of volumes that say where they lie, but not how far from each other; 0:
/// as it comes.
std::size_t HeaderAndVoxelsWriter::length_for_series() const {
    if (step_ || !position_of(first_) || data_file_->in_place()) return 0;
    Header longest = first_;
    longest.attributes["sequence step"] = "-1.2345678901234567e-300";
    std::size_t const length = format_.text({longest, 1, options_.compress ? 0 : -1, data_name_, 0, false, 1}).size();
    return std::max(length, format_.text({first_, 1, options_.compress ? 0 : -1, data_name_, 0, false, 1}).size());
}

void HeaderAndVoxelsWriter::begin(Header const& header) {
    check_volume(header);
    if (axes_) axes_->add(header);
    if (volumes_ > 0) check_place(header);
    data_file_->expect(deflate_ || options_.compress ? least_deflated(header.bytes()) : header.bytes());
    if (volumes_++ > 0) {
        // There is one line for all, in a header of a length that is fixed.
        take_common(in_utf8(header));
        return;
    }
    first_ = in_utf8(header);
    step_ = number_of(first_, "sequence step");
    if (format_.private_values) tell_private_values(options_, header, format_.name);
    if (!header_file_) {
        std::string const head = header_text(length_for_series());
        header_length_ = head.size();
        if (whole_)
            deflate_->store(head);
        else
            data_file_->write(head.data(), head.size());
    }
    if (options_.compress) deflate_.emplace(*data_file_, format_.wrapper, options_);
}

/// Attributes are those of all volumes, besides where the first of them lies along the series, which channels of
/// several series have in common.
void HeaderAndVoxelsWriter::take_common(Header header) {
    bool const channels = other_channel(header, first_);
    // The number of a channel is its place.
    bool const numbered = first_.attributes.contains("channel") && first_.attributes["channel"] == "0";
    if (!channels || axes_) {
        if (auto const at = first_.attributes.find("sequence position"); at != first_.attributes.end())
            header.attributes.insert_or_assign(at->first, at->second);
    } else {
        // Components of vectors at several times are no vectors of so many components.
        if (first_.attributes.contains("sequence step")) header.attributes.erase("intent_code");
        header.attributes.erase("sequence step");
    }
    for (std::string& name : keep_common(first_, header))
        if (name != "channel" || !numbered) differing_.push_back(std::move(name));
}

/// Of all volumes some bytes at a time: where these stand changes, and nothing else.
void HeaderAndVoxelsWriter::put_in_order() {
    auto const n = static_cast<std::size_t>(volumes_), channels = static_cast<std::size_t>(this->channels());
    std::size_t const size = first_.bytes(), budget = options_.memory.value_or(default_memory()) / 8;
    std::size_t const most = std::clamp<std::size_t>(budget / n, 1, size);
    std::vector<std::byte> held(n * most);
    auto const begin = static_cast<std::int64_t>(header_length_); // 0 if the voxels are apart
    for (std::size_t at = 0; at < size; at += most) {
        std::size_t const count = std::min(most, size - at);
        for (std::size_t v = 0; v < n; ++v)
            read_back(begin + static_cast<std::int64_t>(v * size + at), held.data() + v * count, count);
        for (std::size_t v = 0; v < n; ++v) {
            std::size_t const place = v % channels * (n / channels) + v / channels;
            data_file_->write_at(begin + static_cast<std::int64_t>(place * size + at), held.data() + v * count, count);
        }
    }
}

void HeaderAndVoxelsWriter::read_back(std::int64_t position, std::byte* to, std::size_t n) const {
    while (n > 0) {
        ssize_t const done = ::pread(data_file_->descriptor(), to, n, position);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) throw system_error(text("cannot read '", data_file_->path(), "' back"));
        to += done;
        position += done;
        n -= static_cast<std::size_t>(done);
    }
}

/// What is compressed as a whole is unpacked to a file without a name, and compressed anew.
void HeaderAndVoxelsWriter::compress_in_order() {
    int const descriptor = ::fcntl(data_file_->descriptor(), F_DUPFD_CLOEXEC, 3);
    if (descriptor < 0) throw system_error(text("cannot read '", data_file_->path(), "' back"));
    ::lseek(descriptor, 0, SEEK_SET);
    auto const plain =
        seekable_bytes(unwrapped(std::make_unique<ByteSource>(descriptor, data_file_->path()), Wrapper::gzip));
    std::string const head = header_text(header_length_), path = data_file_->path();
    deflate_.reset();
    data_file_.emplace(path, options_.force);
    deflate_.emplace(*data_file_, DeflateWriter::Wrapper::gzip, options_);
    deflate_->store(head);
    std::int64_t const channels = this->channels(), size = static_cast<std::int64_t>(first_.bytes());
    constexpr std::int64_t block = std::int64_t{1} << 20;
    std::vector<std::byte> held(static_cast<std::size_t>(std::min(block, size)));
    for (std::int64_t i = 0; i < volumes_; ++i) {
        std::int64_t const times = volumes_ / channels, volume = i % times * channels + i / times;
        for (std::int64_t at = 0; at < size; at += block) {
            auto const n = static_cast<std::size_t>(std::min(block, size - at));
            plain->read_at(static_cast<std::int64_t>(header_length_) + volume * size + at, held.data(), n);
            deflate_->write(held.data(), n);
        }
    }
    deflate_->finish();
}

void HeaderAndVoxelsWriter::close() {
    if (volumes_ == 0) throw Error(ErrorKind::data, "there is no volume to write");
    if (axes_) axes_->finish();
    if (volumes_ > 1 && step_.value_or(0) != 0 && position_of(first_))
        first_.attributes.insert({"sequence step", to_text(*step_)});
    if (!differing_.empty() && options_.notice)
        options_.notice(text("one ", format_.name, " file does not hold attributes that differ between its volumes (",
                             join(differing_, ", "), "): not kept"));
    if (whole_ && volumes_ > 1) deflate_->restore(header_text(header_length_));
    if (deflate_) deflate_->finish();
    if (whole_ && turned()) compress_in_order();
    if (whole_) return data_file_->commit();
    if (turned()) put_in_order();
    if (header_file_) {
        std::string const head = header_text(0);
        header_file_->write(head.data(), head.size());
    } else if (volumes_ > 1 || (deflate_ && format_.states_compressed_size)) {
        std::string const head = header_text(header_length_);
        data_file_->write_at(0, head.data(), head.size());
    }
    // A header must not be seen without its data.
    data_file_->commit();
    if (!header_file_) return;
    try {
        header_file_->commit();
    } catch (...) {
        // Nor should data stay without its header, unless it has replaced other data anyway.
        if (!options_.force) ::unlink(data_file_->target().c_str());
        throw;
    }
}

} // namespace vkt
