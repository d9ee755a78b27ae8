// Where the files of a Zarr store lie: in directories, in a ZIP file, or, of metadata, in one that tells all others.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt::zarr {

/// One file that is open for reading, by any number of threads.
class StoredFile {
public:
    virtual ~StoredFile() = default;
    virtual std::uint64_t size() const = 0;
    /// Throws Error{data, io}, also beyond the end.
    virtual void read(std::uint64_t at, std::span<std::byte> to) const = 0;
    /// A checksum proves that it is not damaged, where all of it is read at once.
    virtual bool checks_whole() const { return false; }
};

/// Files by their keys, "FOLDER/NAME". Metadata that have no file of their own are taken from those that a group tells
/// of all below it: .zmetadata (version 2) and the member consolidated_metadata of zarr.json (3).
class Store {
public:
    virtual ~Store() = default;

    /// None if there is no such file. Throws Error{data, io}.
    virtual std::unique_ptr<StoredFile> open(std::string const& key) const = 0;
    /// How messages name it.
    virtual std::string shown(std::string const& key) const = 0;

    /// The text of a file of metadata, at most 16 MiB; none if there is none.
    std::optional<std::string> metadata(std::string const& folder, std::string const& name) const;
    /// True if the folder has metadata of an array or a group.
    bool is_node(std::string const& folder) const;
    /// Arrays and groups right below a folder, in alphabetical order, at most 1000.
    std::vector<std::string> nodes_below(std::string const& folder) const;

protected:
    virtual std::optional<std::string> text_of(std::string const& key) const = 0;
    virtual std::vector<std::string> folders_below(std::string const& folder) const = 0;

private:
    using Told = std::map<std::string, std::string>; ///< texts by their keys below a folder
    std::shared_ptr<Told const> told(std::string const& folder) const;

    mutable std::mutex mutex_;
    mutable std::map<std::string, std::shared_ptr<Told const>> told_;
};

/// "FOLDER/NAME"; NAME alone at the root of a ZIP file.
std::string key_of(std::string const& folder, std::string const& name);

/// Keys are paths.
std::shared_ptr<Store const> directories();
/// Keys are names of members of a seekable file. Throws Error{data, io}.
std::shared_ptr<Store const> zip_file(std::shared_ptr<ByteSource const> bytes, std::string const& shown);

} // namespace vkt::zarr
