// NIfTI files: .nii, .nii.gz, and pairs of .hdr and .img. Parsed here and not by a library, since regions shall be read
// where they lie, streams in order, and damaged headers refused: all of which voxels behind a header have already.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/analyze.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/nifti_header.h"
#include "libvkt/formats/nifti_places.h"
#include "libvkt/formats/sidecar.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/wrapper.h"

#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <utility>

namespace vkt {

namespace {

using Json = nlohmann::ordered_json;

/// Who names the voxels of a pair means both.
std::unique_ptr<ByteSource> header_beside(std::unique_ptr<ByteSource> bytes) {
    std::string const lower = lower_case(bytes->name());
    std::size_t const end = lower.ends_with(".img.gz") ? 7 : lower.ends_with(".img") ? 4 : 0;
    if (end == 0 || is_nifti(bytes->peek(352)) || is_analyze(bytes->peek(analyze_size))) return bytes;
    std::string const stem = bytes->name().substr(0, bytes->name().size() - end);
    bool const capitals = bytes->name().compare(stem.size(), 4, ".IMG") == 0;
    std::string const header = stem + (capitals ? ".HDR" : ".hdr"), packed = header + ".gz";
    std::error_code error;
    if (std::filesystem::exists(header, error) || !std::filesystem::exists(packed, error)) return open_bytes(header);
    return unwrapped(open_bytes(packed), Wrapper::gzip);
}

/// The object that a text holds; null if it holds none, or nests deeper than what such files say: the library writes by
/// recursion.
Json object_in(std::string_view text) {
    constexpr int deepest = 64;
    bool deep = false;
    auto const watch = [&](int depth, Json::parse_event_t, Json const&) {
        deep = deep || depth > deepest;
        return !deep;
    };
    Json json = Json::parse(text, watch, false);
    return !deep && json.is_object() ? json : Json();
}

/// Whether BIDS may have it: it writes names in CamelCase. Reports of ours, which may lie there, have none.
bool is_of_bids(Json const& object) {
    for (auto const& entry : object.items())
        if (!entry.key().empty() && entry.key()[0] >= 'A' && entry.key()[0] <= 'Z') return true;
    return object.empty();
}

/// What stands in it, on one line; empty if there is none, or it holds no such object.
std::string sidecar_text(std::string const& path) {
    constexpr std::int64_t most = std::int64_t{1} << 20;
    std::error_code error;
    if (path.empty() || !std::filesystem::is_regular_file(path, error)) return {};
    if (std::filesystem::file_size(path, error) > most || error) return {};
    std::ifstream file(path);
    Json const json = object_in(std::string(std::istreambuf_iterator<char>(file), {}));
    return json.is_null() || !is_of_bids(json) ? std::string() : json.dump();
}

/// The pair or file, and a sidecar for what an input's sidecar said. It appears before the image does.
class NiftiWriter : public HeaderAndVoxelsWriter {
public:
    NiftiWriter(HeaderFormat format, std::string const& path, WriteOptions const& options)
        : HeaderAndVoxelsWriter(std::move(format), path, options), options_(options), sidecar_(sidecar_of(target())) {}

    void begin(Header const& header) override {
        Geometry const plain, &g = header.geometry;
        bool const placed = !(g.origin == plain.origin) || g.direction != plain.direction;
        if (frame_of(header).empty() && placed && !std::exchange(told_, true) && options_.notice)
            options_.notice(
                "the volume does not say what its axes mean, and those of NIfTI are right-anterior-superior: "
                "taken as they are (vkt edit --attribute space=LPS says it)");
        Header own = header;
        if (std::string const lost = drop_outdated(own);
            !lost.empty() && !std::exchange(told_lost_, true) && options_.notice)
            options_.notice(lost);
        auto const found = own.attributes.find("sidecar");
        if (found == own.attributes.end() || sidecar_.empty()) return HeaderAndVoxelsWriter::begin(own);
        Json const json = object_in(found->second);
        own.attributes.erase(found);
        HeaderAndVoxelsWriter::begin(own);
        if (file_ || json.is_null()) return;
        file_.emplace(sidecar_, options_.force);
        std::string const lines = json.dump(2) + "\n";
        file_->write(lines.data(), lines.size());
    }

    void close() override {
        if (file_) file_->commit();
        HeaderAndVoxelsWriter::close();
    }

private:
    WriteOptions options_;
    std::string sidecar_; ///< empty: there is no name for one
    std::optional<OutputFile> file_;
    bool told_ = false, told_lost_ = false;
};

std::unique_ptr<Source> open_nifti(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    bytes = header_beside(std::move(bytes));
    RawLayout layout = is_analyze(bytes->peek(analyze_size))
                           ? read_analyze(*bytes, options.trust_paths)
                           : nifti_layout(read_nifti_header(*bytes), options.trust_paths);
    std::string sidecar = sidecar_text(sidecar_of(where_linked(bytes->name())));
    if (sidecar.empty()) sidecar = sidecar_text(sidecar_of(bytes->name()));
    if (!sidecar.empty()) layout.header.attributes["sidecar"] = std::move(sidecar);
    return raw_source(std::move(bytes), std::move(layout));
}

std::unique_ptr<Sink> create_nifti(std::string const& path, WriteOptions const& options) {
    if (lower_case(path).ends_with(".img"))
        throw Error(ErrorKind::usage, "a NIfTI pair is written by the name of its header",
                    text("write ", path.substr(0, path.size() - 4), ".hdr"));
    HeaderFormat format{"NIfTI", ".nii",          ".hdr",     ".img", "", DeflateWriter::Wrapper::gzip,
                        false,   nifti_type_name, nifti_bytes};
    format.channel_axis = true;
    return slab_sink(std::make_unique<NiftiWriter>(std::move(format), path, options));
}

} // namespace

Format nifti_format() {
    return {"nifti",
            "NIfTI-1 and NIfTI-2, one file or a pair",
            {".nii", ".hdr", ".img"},
            is_nifti,
            open_nifti,
            create_nifti,
            true};
}

} // namespace vkt
