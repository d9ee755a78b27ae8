// Writing collections: an image for each time, in a folder, and the list that names them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/pvd.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/series_axes.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/vti.h"
#include "libvkt/io/output_directory.h"

#include <algorithm>
#include <filesystem>
#include <vector>

namespace vkt {
namespace {

class PvdWriter : public VolumeWriter {
public:
    PvdWriter(std::string const& path, WriteOptions const& options)
        : options_(options), file_(path, options.force), folder_(folder_beside(file_.target(), ".pvd")) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': collections of files cannot go to a pipe"), "write .vti");
        directory_.emplace(folder_, options.force, holds_only_vti, "VTK images");
        options_.force = false;
    }

    void begin(Header const& header) override {
        refuse_bricks(header, ".pvd collections");
        series_.add(header);
        std::int64_t const time = series_.time_of_last();
        if (!image_ || time != time_) open(time);
        image_->begin(header);
    }
    void write(std::byte const* voxels, std::size_t n) override { image_->write(voxels, n); }
    void end() override { image_->end(); }

    void close() override {
        if (!image_) throw Error(ErrorKind::data, "there is no volume to write");
        series_.finish();
        image_->close();
        std::string words = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n";
        std::vector<double> const times = list_of_times();
        for (std::int64_t t = 0; t < images_; ++t)
            words += text("    <DataSet timestep=\"", to_text(times[static_cast<std::size_t>(t)]),
                          "\" group=\"\" part=\"0\" file=\"", xml_escaped(name_of_folder()), "/",
                          xml_escaped(file_of(t)), "\"/>\n");
        words += "  </Collection>\n</VTKFile>\n";
        file_.write(words.data(), words.size());
        // What names the images appears after them.
        directory_->commit();
        file_.commit();
    }

private:
    std::vector<double> list_of_times() const {
        for (SeriesAxis const& axis : series_.axes())
            if (axis.time) return times_of(axis);
        auto const& attributes = series_.header().attributes;
        auto const found = attributes.find("sequence position");
        return times_of({true, {found == attributes.end() ? "" : found->second}});
    }

    std::string name_of_folder() const { return std::filesystem::path(folder_).filename().string(); }
    std::string file_of(std::int64_t time) const {
        std::string number = to_text(time);
        number.insert(0, 4 - std::min<std::size_t>(number.size(), 4), '0');
        return text(name_of_folder(), "_", number, ".vti");
    }

    /// Another channel of a time that has an image already comes behind those that it holds.
    void open(std::int64_t time) {
        if (image_) image_->close();
        image_.reset();
        std::string const path = directory_->file(file_of(time));
        WriteOptions own = options_;
        own.force = time < images_;
        image_ = vti_writer(path, own);
        if (own.force) take(*open_vti(open_bytes(path), ReadOptions{}));
        images_ = std::max(images_, time + 1);
        time_ = time;
    }

    void take(Source& source) {
        std::vector<std::byte> voxels;
        while (source.next_volume()) {
            Header const& header = source.header();
            image_->begin(header);
            for (std::int64_t z = 0; z < header.dims.z; ++z) {
                Box const slice{{0, 0, z}, {header.dims.x, header.dims.y, z + 1}};
                voxels.resize(static_cast<std::size_t>(slice.voxels()) * size_of(header.dtype));
                source.read(dense_view(voxels.data(), header.dtype, slice));
                image_->write(voxels.data(), voxels.size());
            }
            image_->end();
        }
    }

    WriteOptions options_;
    OutputFile file_;
    std::string folder_;
    std::optional<OutputDirectory> directory_;
    SeriesAxes series_{".pvd collection", ".vti"};
    std::unique_ptr<VolumeWriter> image_;
    std::int64_t time_ = 0, images_ = 0;
};

} // namespace

std::unique_ptr<Sink> create_pvd(std::string const& path, WriteOptions const& options) {
    return slab_sink(std::make_unique<PvdWriter>(path, options));
}

} // namespace vkt
