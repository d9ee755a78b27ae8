// Writing formats that are a header and voxels, in one file or in two (NRRD, MetaImage, NIfTI, NumPy).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/encode.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/series_axes.h"
#include "libvkt/formats/slab_sink.h"

#include <optional>
#include <string>

namespace vkt {

/// What a header is made of.
struct HeaderText {
    Header const& first;     ///< of the first volume; the others have the same lattice
    std::int64_t volumes;    ///< so far
    std::int64_t compressed; ///< bytes of compressed voxels; below 0: they are not compressed
    std::string const& data; ///< name of the file with the voxels; empty if they follow
    std::size_t length;      ///< that an attached header must have; 0: as it comes, with room for what close() adds
    bool last_word;          ///< the file cannot be written to again, so no room is needed
    /// Of formats with an axis for them: the volumes are as many channels, each at all times.
    std::int64_t channels = 1;
};

/// How one format differs from the others.
struct HeaderFormat {
    std::string name;               ///< for messages
    std::string attached, detached; ///< extensions: one file, header with the voxels in another (empty: never)
    /// Extensions of that other file. Without the second the format knows no compression but that of the whole file.
    std::string data, compressed_data;
    DeflateWriter::Wrapper wrapper;
    bool states_compressed_size;
    std::string (*type_name)(DataType); ///< empty for types that the format does not have
    std::string (*text)(HeaderText const&);
    bool private_values = false; ///< the map of values is kept in a place that only vkt reads
    /// Channels lie along an axis of their own, outside of times; what comes the other way round is put in order at
    /// the end.
    bool channel_axis = false;
};

/// Volumes of one lattice become one file, of which NAME.gz is compressed as a whole, the header behind a block of
/// deflate that is only stored; the header is completed when their number is known.
class HeaderAndVoxelsWriter : public VolumeWriter {
public:
    /// Throws Error{usage} for compression that the format does not have, or to a pipe where the size comes first,
    /// Error{io}.
    HeaderAndVoxelsWriter(HeaderFormat format, std::string const& path, WriteOptions const& options);

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

protected:
    /// Where the header, or all, will lie.
    std::string const& target() const { return (header_file_ ? header_file_ : data_file_)->target(); }

private:
    void check_volume(Header const& header);
    void check_place(Header const& header);
    std::size_t length_for_series() const;
    void take_common(Header header);
    std::string header_text(std::size_t length) const;
    bool turned() const;
    std::int64_t channels() const;
    void put_in_order();
    void read_back(std::int64_t position, std::byte* to, std::size_t n) const;
    void compress_in_order();

    HeaderFormat format_;
    WriteOptions options_;
    std::optional<OutputFile> header_file_, data_file_;
    std::string data_name_; ///< empty if attached
    bool whole_ = false;    ///< compressed with its header
    std::optional<DeflateWriter> deflate_;
    Header first_;
    std::optional<SeriesAxes> axes_; ///< of formats that have one for channels
    std::int64_t volumes_ = 0;
    std::optional<double> step_;         ///< between volumes, as the first or the second of them says
    std::vector<std::string> differing_; ///< attributes that not all volumes have alike
    std::size_t header_length_ = 0;
};

} // namespace vkt
