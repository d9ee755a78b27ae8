// Stores.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_store.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/zip_archive.h"
#include "libvkt/io/system_error.h"
#include "libvkt/io/whole_text.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt::zarr {
namespace {

using Json = nlohmann::json;

constexpr std::size_t most_text = std::size_t{16} << 20, most_nodes = 1000;
constexpr int deepest = 16; ///< groups in groups
constexpr std::array<char const*, 4> metadata_names{"zarr.json", ".zarray", ".zgroup", ".zattrs"};

[[noreturn]] void ended_early(std::string const& file) {
    throw Error(ErrorKind::data, text("'", file, "' ended early"));
}

class DirectoryFile : public StoredFile {
public:
    DirectoryFile(int descriptor, std::string name) : descriptor_(descriptor), name_(std::move(name)) {
        struct stat status {};
        if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
            ::close(descriptor_);
            throw Error(ErrorKind::data, text("'", name_, "' is no regular file"));
        }
        size_ = static_cast<std::uint64_t>(status.st_size);
    }
    ~DirectoryFile() override { ::close(descriptor_); }
    DirectoryFile(DirectoryFile const&) = delete;
    DirectoryFile& operator=(DirectoryFile const&) = delete;

    std::uint64_t size() const override { return size_; }
    void read(std::uint64_t at, std::span<std::byte> to) const override {
        std::size_t done = 0;
        while (done < to.size()) {
            ssize_t const got = ::pread(descriptor_, to.data() + done, to.size() - done, static_cast<off_t>(at + done));
            if (got < 0 && errno == EINTR) continue;
            if (got < 0) throw system_error(text("cannot read '", name_, "'"));
            if (got == 0) ended_early(name_);
            done += static_cast<std::size_t>(got);
        }
    }

private:
    int descriptor_;
    std::string name_;
    std::uint64_t size_ = 0;
};

class Directories : public Store {
public:
    std::unique_ptr<StoredFile> open(std::string const& key) const override {
        int const descriptor = ::open(key.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
        if (descriptor >= 0) return std::make_unique<DirectoryFile>(descriptor, key);
        if (errno != ENOENT) throw system_error(text("cannot open '", key, "'"));
        return nullptr;
    }
    std::string shown(std::string const& key) const override { return key; }

protected:
    std::optional<std::string> text_of(std::string const& key) const override {
        std::error_code failed;
        if (!std::filesystem::is_regular_file(key, failed)) return std::nullopt;
        return whole_text(key, most_text);
    }
    std::vector<std::string> folders_below(std::string const& folder) const override {
        std::vector<std::string> result;
        std::error_code failed;
        for (auto const& entry : std::filesystem::directory_iterator(folder, failed))
            if (entry.is_directory(failed) && result.size() < most_nodes)
                result.push_back(entry.path().filename().string());
        return result;
    }
};

/// Part of the archive, as it lies there.
class StoredMember : public StoredFile {
public:
    StoredMember(std::shared_ptr<ByteSource const> bytes, ZipMember const& member)
        : bytes_(std::move(bytes)), at_(zip_begin(*bytes_, member)), size_(member.packed), checksum_(member.checksum),
          name_(text(bytes_->name(), "/", member.name)) {}

    std::uint64_t size() const override { return size_; }
    bool checks_whole() const override { return true; }
    void read(std::uint64_t at, std::span<std::byte> to) const override {
        if (at > size_ || to.size() > size_ - at) ended_early(name_);
        bytes_->read_at(at_ + static_cast<std::int64_t>(at), to.data(), to.size());
        // The archive knows a sum of the whole; parts, of a shard, are left to the codecs of their chunks.
        if (to.size() == size_ && crc32_z(0, reinterpret_cast<Bytef const*>(to.data()), to.size()) != checksum_)
            throw Error(ErrorKind::data, text("'", name_, "': damaged: its checksum is another"));
    }

private:
    std::shared_ptr<ByteSource const> bytes_;
    std::int64_t at_;
    std::uint64_t size_, checksum_;
    std::string name_;
};

/// A member that was deflated: all of it at once.
class InflatedMember : public StoredFile {
public:
    InflatedMember(std::shared_ptr<ByteSource const> const& bytes, ZipMember const& member)
        : name_(text(bytes->name(), "/", member.name)) {
        // Deflate makes at most 1032 bytes of one.
        if (member.bytes > 1032 * (member.packed + 64))
            throw Error(ErrorKind::data, text("'", name_, "': damaged: more bytes than it can hold"));
        bytes_.resize(member.bytes);
        Inflated inflated(bytes, zip_begin(*bytes, member), member);
        if (inflated.read(bytes_.data(), bytes_.size()) != bytes_.size()) ended_early(name_);
    }
    std::uint64_t size() const override { return bytes_.size(); }
    void read(std::uint64_t at, std::span<std::byte> to) const override {
        if (at > bytes_.size() || to.size() > bytes_.size() - at) ended_early(name_);
        if (!to.empty()) std::memcpy(to.data(), bytes_.data() + at, to.size());
    }

private:
    std::string name_;
    std::vector<std::byte> bytes_;
};

class ZipFile : public Store {
public:
    ZipFile(std::shared_ptr<ByteSource const> bytes, std::string shown)
        : bytes_(std::move(bytes)), shown_(std::move(shown)) {
        for (ZipMember& member : zip_members(*bytes_)) {
            std::string const name = member.name;
            members_.insert_or_assign(name, std::move(member)); // of two, the later one counts, as for zipfile
        }
    }
    std::unique_ptr<StoredFile> open(std::string const& key) const override {
        auto const found = members_.find(key);
        if (found == members_.end()) return nullptr;
        if (found->second.method == zip::deflated && !found->second.encrypted)
            return std::make_unique<InflatedMember>(bytes_, found->second);
        return std::make_unique<StoredMember>(bytes_, found->second);
    }
    std::string shown(std::string const& key) const override { return key.empty() ? shown_ : text(shown_, "/", key); }

protected:
    std::optional<std::string> text_of(std::string const& key) const override {
        auto const file = open(key);
        if (!file) return std::nullopt;
        if (file->size() > most_text) throw Error(ErrorKind::data, text("'", shown(key), "' exceeds 16 MiB"));
        std::string result(file->size(), '\0');
        file->read(0, std::as_writable_bytes(std::span(result)));
        return result;
    }
    std::vector<std::string> folders_below(std::string const& folder) const override {
        std::string const prefix = folder.empty() ? "" : folder + "/";
        std::vector<std::string> result;
        for (auto at = members_.lower_bound(prefix); at != members_.end() && at->first.starts_with(prefix); ++at) {
            std::size_t const end = at->first.find('/', prefix.size());
            if (end == std::string::npos) continue;
            std::string name = at->first.substr(prefix.size(), end - prefix.size());
            if ((result.empty() || result.back() != name) && result.size() < most_nodes)
                result.push_back(std::move(name));
        }
        return result;
    }

private:
    std::shared_ptr<ByteSource const> bytes_;
    std::string shown_;
    std::map<std::string, ZipMember> members_;
};

/// The folder that a key lies in; none of what has none.
std::optional<std::string> parent_of(std::string const& folder) {
    std::size_t const slash = folder.rfind('/');
    if (slash == 0 || folder.empty()) return std::nullopt;
    return slash == std::string::npos ? "" : folder.substr(0, slash);
}

} // namespace

std::string key_of(std::string const& folder, std::string const& name) {
    return folder.empty() ? name : folder + "/" + name;
}

/// What one file of this folder tells of those below it.
std::shared_ptr<Store::Told const> Store::told(std::string const& folder) const {
    {
        std::lock_guard const lock(mutex_);
        if (auto const found = told_.find(folder); found != told_.end()) return found->second;
    }
    auto result = std::make_shared<Told>();
    auto const dump = [](Json const& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); };
    for (char const* const file : {".zmetadata", "zarr.json"}) {
        std::optional<std::string> const words = text_of(key_of(folder, file));
        if (!words) continue;
        Json const json = Json::parse(*words, nullptr, false);
        Json const* all = nullptr;
        bool const second = file[0] == '.';
        if (json.is_object() && second && json.contains("metadata")) all = &json["metadata"];
        if (json.is_object() && !second && json.contains("consolidated_metadata") &&
            json["consolidated_metadata"].is_object() && json["consolidated_metadata"].contains("metadata"))
            all = &json["consolidated_metadata"]["metadata"];
        if (all == nullptr || !all->is_object()) continue;
        for (auto const& [key, value] : all->items())
            result->emplace(second ? key : key_of(key, "zarr.json"), dump(value));
    }
    std::lock_guard const lock(mutex_);
    return told_[folder] = result;
}

std::optional<std::string> Store::metadata(std::string const& folder, std::string const& name) const {
    if (auto own = text_of(key_of(folder, name))) return own;
    std::string below = name;
    std::optional<std::string> above = folder;
    for (int i = 0; above && i < deepest; ++i) {
        auto const all = told(*above);
        if (auto const found = all->find(below); found != all->end()) return found->second;
        std::size_t const slash = above->rfind('/');
        below = above->substr(slash == std::string::npos ? 0 : slash + 1) + "/" + below;
        above = parent_of(*above);
    }
    return std::nullopt;
}

bool Store::is_node(std::string const& folder) const {
    return std::any_of(metadata_names.begin(), metadata_names.end() - 1,
                       [&](char const* name) { return metadata(folder, name).has_value(); });
}

std::vector<std::string> Store::nodes_below(std::string const& folder) const {
    std::vector<std::string> names = folders_below(folder);
    // Those of which no folder tells, since they hold nothing but fill values.
    for (auto const& [key, words] : *told(folder))
        if (std::size_t const slash = key.find('/'); slash != std::string::npos && names.size() < most_nodes)
            names.push_back(key.substr(0, slash));
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    std::erase_if(names, [&](std::string const& name) { return !is_node(key_of(folder, name)); });
    return names;
}

std::shared_ptr<Store const> directories() { return std::make_shared<Directories>(); }

std::shared_ptr<Store const> zip_file(std::shared_ptr<ByteSource const> bytes, std::string const& shown) {
    return std::make_shared<ZipFile>(std::move(bytes), shown);
}

} // namespace vkt::zarr
