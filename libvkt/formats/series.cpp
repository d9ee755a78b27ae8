// Series of files.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/series.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/shared_memory.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fnmatch.h>
#include <glob.h>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

namespace vkt {
namespace {

bool digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// Compares runs of digits by value, everything else by character.
bool natural_less(std::string const& a, std::string const& b) {
    std::size_t i = 0;
    std::size_t j = 0;
    while (i < a.size() && j < b.size()) {
        if (!digit(a[i]) || !digit(b[j])) {
            if (a[i] != b[j]) return a[i] < b[j];
            ++i;
            ++j;
            continue;
        }
        auto const run = [](std::string const& s, std::size_t& k) {
            std::size_t const begin = s.find_first_not_of('0', k);
            std::size_t const first =
                begin == std::string::npos || !digit(s[begin]) ? std::min(begin, s.size()) : begin;
            std::size_t end = first;
            while (end < s.size() && digit(s[end])) ++end;
            k = end;
            return s.substr(first, end - first);
        };
        std::string const x = run(a, i);
        std::string const y = run(b, j);
        if (x != y) return x.size() != y.size() ? x.size() < y.size() : x < y;
    }
    return a.size() - i < b.size() - j;
}

class SeriesSource : public Source {
public:
    SeriesSource(std::vector<std::string> paths, std::function<std::unique_ptr<Source>(std::string const&)> open)
        : paths_(std::move(paths)), open_(std::move(open)) {}

    bool next_volume() override {
        while (true) {
            if (current_ && current_->next_volume()) return true;
            if (next_ == paths_.size()) return false;
            current_ = open_(paths_[next_++]);
        }
    }
    Header const& header() const override { return current_->header(); }
    Access access() const override { return current_->access(); }
    void read(AnyView out) override { current_->read(out); }
    std::optional<ConstView> borrow(Box const& region) override { return current_->borrow(region); }
    std::shared_ptr<Lease> lease(Box const& region) override { return current_->lease(region); }
    std::optional<Volume> take_whole() override { return current_->take_whole(); }
    BrickSequence take_bricks() override { return current_->take_bricks(); }
    std::vector<std::string> not_read() const override { return current_->not_read(); }
    void expect(Box const& region) override { current_->expect(region); }
    std::int64_t natural_slab() const override { return current_->natural_slab(); }
    Space space() const override { return current_ ? current_->space() : Space::host; }
    void finish() override { current_->finish(); }

private:
    std::vector<std::string> paths_;
    std::function<std::unique_ptr<Source>(std::string const&)> open_;
    std::unique_ptr<Source> current_;
    std::size_t next_ = 0;
};

class SeriesSink : public Sink {
public:
    SeriesSink(std::string pattern, WriteOptions options, CreateFile create)
        : pattern_(std::move(pattern)), options_(std::move(options)), create_(std::move(create)) {}

    void begin(Header const& header) override {
        current_ = create_(numbered_path(pattern_, number_++), options_);
        current_->begin(header);
    }
    AnyView acquire(Box const& slab) override { return current_->acquire(slab); }
    void commit() override { current_->commit(); }
    void put_bricks(BrickSequence bricks) override { current_->put_bricks(std::move(bricks)); }
    void end() override {
        current_->end();
        current_->close();
        current_.reset();
    }
    void close() override {}
    std::int64_t natural_slab() const override { return current_ ? current_->natural_slab() : 0; }

private:
    std::string pattern_;
    WriteOptions options_;
    CreateFile create_;
    std::unique_ptr<Sink> current_;
    std::int64_t number_ = 0;
};

/// Position and length of the number's place, or npos. Throws Error{usage} if there are several.
std::pair<std::size_t, std::size_t> number_place(std::string const& path) {
    std::pair<std::size_t, std::size_t> place{std::string::npos, 0};
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
        if (path[i] != '%') continue;
        if (path[i + 1] == '%') {
            ++i;
            continue;
        }
        std::size_t end = i + 1;
        while (end < path.size() && digit(path[end])) ++end;
        if (end == path.size() || path[end] != 'd' || end - i > 4)
            throw Error(ErrorKind::usage, text("'", path, "' has a '%' that is no number's place"),
                        "write %04d, or %% for a per cent sign");
        if (place.first != std::string::npos)
            throw Error(ErrorKind::usage, text("'", path, "' has two places for one number"),
                        "write %d once, and %% for a per cent sign");
        place = {i, end + 1 - i};
        i = end;
    }
    return place;
}

std::string without_escapes(std::string path) {
    for (std::size_t i = path.find("%%"); i != std::string::npos; i = path.find("%%", i + 1)) path.erase(i, 1);
    return path;
}

std::vector<std::string> matching_segments(std::string const& pattern) {
    std::vector<std::string> names = segments();
    std::erase_if(names, [&](std::string const& name) { return ::fnmatch(pattern.c_str(), name.c_str(), 0) != 0; });
    if (names.empty()) throw Error(ErrorKind::io, text("no segment matches '", pattern, "'"));
    std::sort(names.begin(), names.end(), natural_less);
    return names;
}

/// The files that numbers make of a path, in the order of these.
std::vector<std::string> numbered_files_of(std::string const& path) {
    namespace fs = std::filesystem;
    fs::path const folder = fs::path(path).parent_path();
    auto const [begin, length] = number_place(path);
    std::vector<std::string> paths;
    std::error_code failed;
    for (auto const& entry : fs::directory_iterator(folder.empty() ? fs::path(".") : folder, failed)) {
        std::string const file = (folder / entry.path().filename()).string();
        std::size_t end = begin;
        while (end < file.size() && digit(file[end])) ++end;
        if (end == begin || end - begin > 18) continue;
        if (numbered_path(path, parse_integer(file.substr(begin, end - begin))) == file) paths.push_back(file);
    }
    if (paths.empty()) throw Error(ErrorKind::io, text("no file matches '", path, "'"));
    std::sort(paths.begin(), paths.end(), natural_less);
    return paths;
}

/// Slabs come as they come; each slice is handed to a sink of its own.
class SlicesSink : public Sink {
public:
    SlicesSink(std::string pattern, WriteOptions options, CreateFile create)
        : pattern_(std::move(pattern)), options_(std::move(options)), create_(std::move(create)) {}

    void begin(Header const& header) override {
        if (header.kind != Kind::structured)
            throw Error(ErrorKind::usage, "hierarchical volumes have no slices",
                        "make a grid of it first: vkt resample --cells 50M");
        header_ = header;
        if (open_files(header.dims.z + spare_files)) waiting_ = std::make_shared<HeldFiles>();
    }
    AnyView acquire(Box const& slab) override {
        slab_ = slab;
        held_.resize(static_cast<std::size_t>(slab.voxels()) * size_of(header_.dtype));
        return dense_view(held_.data(), header_.dtype, slab);
    }
    void commit() override {
        ConstView const slab = dense_view<std::byte const>(held_.data(), header_.dtype, slab_);
        for (std::int64_t z = slab_.lower.z; z < slab_.upper.z; ++z) {
            Box part = slab_;
            part.lower.z = z;
            part.upper.z = z + 1;
            if (!current_) begin_slice(z);
            Box target = part;
            target.lower.z = 0;
            target.upper.z = 1;
            copy(slab.part(part), current_->acquire(target));
            current_->commit();
            if (part.upper.y < header_.dims.y) continue;
            current_->end();
            current_->close();
            current_.reset();
            // Files that have a name meanwhile are watched over by a process each.
            if (waiting_ && header_.dims.z > most_named && !waiting_->empty() &&
                !waiting_->front()->temporary().empty())
                show();
        }
    }
    void end() override { show(); }
    void close() override {}
    std::int64_t natural_slab() const override { return 1; }

private:
    static constexpr std::int64_t most_named = 64, spare_files = 64;

    /// Whether so many files may be open at a time; the limit of the process is raised as far as it may be.
    static bool open_files(std::int64_t count) {
        rlimit limit{};
        if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return false;
        auto const wanted = static_cast<rlim_t>(count);
        if (limit.rlim_cur >= wanted) return true;
        limit.rlim_cur = std::min(wanted, limit.rlim_max);
        return limit.rlim_cur == wanted && ::setrlimit(RLIMIT_NOFILE, &limit) == 0;
    }
    /// The files that wait get their names, and what follows does not wait.
    void show() {
        if (!waiting_) return;
        for (auto const& file : *waiting_) file->commit();
        waiting_.reset();
    }
    void begin_slice(std::int64_t z) {
        options_.files = header_.dims.z - z;
        options_.held = waiting_;
        current_ = create_(numbered_path(pattern_, number_++), options_);
        Header slice = header_;
        slice.dims.z = 1;
        slice.geometry = cropped(header_.geometry, {0, 0, z});
        slice.part.reset();
        current_->begin(slice);
    }

    std::string pattern_;
    WriteOptions options_;
    CreateFile create_;
    Header header_;
    Box slab_;
    std::vector<std::byte> held_;
    std::shared_ptr<HeldFiles> waiting_; ///< of the volume, until it is whole
    std::unique_ptr<Sink> current_;
    std::int64_t number_ = 0;
};

} // namespace

std::vector<std::string> matching_files(std::string const& path) {
    if (path.find('%') != std::string::npos && ::access(path.c_str(), F_OK) != 0 && is_numbered(path))
        return numbered_files_of(path);
    bool const pattern = path.find_first_of("*?[") != std::string::npos;
    if (pattern && is_segment(path)) return matching_segments(path);
    if (!pattern || ::access(path.c_str(), F_OK) == 0) return {path};
    glob_t found{};
    int const failure = ::glob(path.c_str(), GLOB_NOSORT, nullptr, &found);
    std::vector<std::string> paths(found.gl_pathv, found.gl_pathv + (failure == 0 ? found.gl_pathc : 0));
    ::globfree(&found);
    if (paths.empty()) throw Error(ErrorKind::io, text("no file matches '", path, "'"));
    std::sort(paths.begin(), paths.end(), natural_less);
    return paths;
}

std::unique_ptr<Source> series_source(std::vector<std::string> paths,
                                      std::function<std::unique_ptr<Source>(std::string const&)> open) {
    return std::make_unique<SeriesSource>(std::move(paths), std::move(open));
}

bool is_numbered(std::string const& path) {
    return path.find('%') != std::string::npos && number_place(path).first != std::string::npos;
}

std::string numbered_path(std::string const& path, std::int64_t number) {
    auto const [begin, length] = number_place(path);
    if (begin == std::string::npos) return without_escapes(path);
    std::string const width = path.substr(begin + 1, length - 2);
    std::string digits = text(number);
    std::size_t const least = width.empty() ? 0 : static_cast<std::size_t>(parse_integer(width));
    if (digits.size() < least) digits.insert(0, least - digits.size(), width.front() == '0' ? '0' : ' ');
    return without_escapes(path.substr(0, begin)) + digits + without_escapes(path.substr(begin + length));
}

std::unique_ptr<Sink> numbered_sink(std::string pattern, bool slices, WriteOptions options, CreateFile create) {
    if (slices) return std::make_unique<SlicesSink>(std::move(pattern), std::move(options), std::move(create));
    return std::make_unique<SeriesSink>(std::move(pattern), std::move(options), std::move(create));
}

} // namespace vkt
