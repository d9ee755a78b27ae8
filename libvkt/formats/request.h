// What a user asks of reading and writing a file: options declared once for command line, C API and Python.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/volume_selection.h"

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace vkt {

enum class Endian : std::uint8_t { little, big };
template <> struct EnumNames<Endian> {
    static std::vector<std::pair<Endian, char const*>> all() {
        return {{Endian::little, "little"}, {Endian::big, "big"}};
    }
};

template <> struct EnumNames<ChunkCodec> {
    static std::vector<std::pair<ChunkCodec, char const*>> all() {
        return {{ChunkCodec::blosc, "blosc"}, {ChunkCodec::zstd, "zstd"}, {ChunkCodec::gzip, "gzip"}};
    }
};

class ReadRequest {
public:
    void declare(Parameters& p);
    /// The option that commands share and others add; see ReadOptions.
    static void declare_trust(Parameters& p, bool& trust_paths);
    void trust(bool paths) { options_.trust_paths = paths; }
    void check() const; ///< throws Error{usage}
    /// All volumes of a file, or of the files that a pattern matches, as they were described; region_of() chooses.
    std::unique_ptr<Source> open(std::string const& path) const;
    /// What is said about the file.
    ReadOptions options() const;
    /// The volumes of a source, and the part of each, that were asked for; `on_region` as in region_source.h.
    std::unique_ptr<Source> region_of(std::unique_ptr<Source> source,
                                      std::function<void(SteppedBox const&)> on_region = {}) const;

private:
    ReadOptions options_;
    std::optional<Endian> endian_;
    Roi roi_;
    WorldRoi world_roi_;
    std::optional<VolumeRange> index_;
};

class WriteRequest {
public:
    void declare(Parameters& p);
    void check(std::string const& path) const; ///< throws Error{usage}
    WriteOptions options() const;

private:
    void check_region(std::string const& path, std::string const& format) const;

    WriteOptions options_;
    std::optional<double> background_;
    std::optional<Vec3> chunk_, shard_;
    std::optional<std::int64_t> index_;
};

} // namespace vkt
