// Reading collections: the list by expat, the images by their own reader.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/pvd.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/coordinates.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/vti.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#ifdef VKT_HAVE_EXPAT
#include <expat.h>
#endif

namespace vkt {
namespace {

/// One entry of the list.
struct Entry {
    std::optional<double> time;
    std::string file;
};

#ifdef VKT_HAVE_EXPAT

class ListReader {
public:
    explicit ListReader(ByteSource& bytes) : bytes_(bytes) {}

    std::vector<Entry> read() {
        XML_Parser const parser = XML_ParserCreate(nullptr);
        if (parser == nullptr) throw std::bad_alloc();
        struct Free {
            XML_Parser parser;
            ~Free() { XML_ParserFree(parser); }
        } const free{parser};
        parser_ = parser;
        XML_SetUserData(parser, this);
        XML_SetStartElementHandler(parser, [](void* self, XML_Char const* name, XML_Char const** attributes) {
            auto* const reader = static_cast<ListReader*>(self);
            reader->guarded([&] { reader->begin(name, attributes); });
        });
        // Nothing that a document may define is needed.
        XML_SetStartDoctypeDeclHandler(parser, [](void* self, XML_Char const*, XML_Char const*, XML_Char const*, int) {
            auto* const reader = static_cast<ListReader*>(self);
            reader->guarded([&] { reader->fail("defines entities of its own, which no collection needs"); });
        });
        constexpr std::size_t block = std::size_t{64} << 10, most = std::size_t{64} << 20;
        std::size_t done = 0;
        for (std::size_t n = block; n > 0; done += n) {
            void* const buffer = XML_GetBuffer(parser, static_cast<int>(block));
            if (buffer == nullptr) throw std::bad_alloc();
            n = bytes_.read(static_cast<std::byte*>(buffer), block);
            if (done + n > most) fail("is larger than a list of files may be");
            auto const status = XML_ParseBuffer(parser, static_cast<int>(n), n == 0 ? 1 : 0);
            if (failure_) std::rethrow_exception(failure_);
            if (status == XML_STATUS_OK) continue;
            fail(text(n == 0 ? "ended early" : "damaged", " at line ",
                      static_cast<std::int64_t>(XML_GetCurrentLineNumber(parser)), ": ",
                      XML_ErrorString(XML_GetErrorCode(parser))));
        }
        return std::move(entries_);
    }

private:
    [[noreturn]] void fail(std::string const& what) const {
        throw Error(ErrorKind::data, text("'", bytes_.name(), "': ", what));
    }

    /// C code lies between what throws and who catches.
    template <class What> void guarded(What const& what) {
        if (failure_) return;
        try {
            what();
        } catch (...) {
            failure_ = std::current_exception();
            XML_StopParser(parser_, XML_FALSE);
        }
    }

    void begin(std::string const& name, char const** list) {
        std::map<std::string, std::string> a;
        for (; *list != nullptr; list += 2) a.emplace(list[0], list[1]);
        if (!std::exchange(begun_, true)) {
            if (name != "VTKFile" || a["type"] != "Collection") fail("is no collection of VTK files");
            return;
        }
        if (name != "DataSet") return;
        Entry one;
        one.file = a["file"];
        if (one.file.empty()) fail("has a data set without a file");
        if (auto const time = a.find("timestep"); time != a.end()) {
            one.time = number_in(time->second);
            if (!one.time || !std::isfinite(*one.time))
                fail(text("timestep=\"", printable(time->second.substr(0, 40)), "\" is no number"));
        }
        entries_.push_back(std::move(one));
    }

    ByteSource& bytes_;
    XML_Parser parser_ = nullptr;
    bool begun_ = false;
    std::exception_ptr failure_;
    std::vector<Entry> entries_;
};

std::vector<Entry> read_list(ByteSource& bytes) { return ListReader(bytes).read(); }

#else

std::vector<Entry> read_list(ByteSource& bytes) {
    throw Error(ErrorKind::failure, text("'", bytes.name(), "': this build cannot read VTK's XML files"),
                "build vkt with libexpat1-dev");
}

#endif

class PvdSource : public Source {
public:
    PvdSource(std::unique_ptr<ByteSource> const& bytes, ReadOptions options)
        : name_(bytes->name()), options_(std::move(options)), entries_(read_list(*bytes)) {
        options_.format.clear();
        if (entries_.empty()) fail("names no file");
        std::stable_sort(entries_.begin(), entries_.end(),
                         [](Entry const& a, Entry const& b) { return a.time.value_or(0) < b.time.value_or(0); });
        std::vector<double> times;
        for (Entry const& one : entries_) {
            double const time = one.time.value_or(0);
            if (!times.empty() && times.back() == time)
                throw Error(ErrorKind::data,
                            text("'", name_, "' names several files at time ", time, ", '",
                                 printable(one.file.substr(0, 80)), "' among them: parts of no one volume"),
                            "read the files that are wanted by their names");
            times.push_back(time);
        }
        places_ = sequence_places(times, "");
    }

    bool next_volume() override {
        while (!current_ || !current_->next_volume()) {
            if (next_ == entries_.size()) return false;
            std::string const path = beside(name_, entries_[next_++].file, options_.trust_paths);
            current_ = open_vti(open_bytes(path), options_);
        }
        header_ = current_->header();
        put_time(entries_[next_ - 1], places_[next_ - 1]);
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    void read(AnyView out) override { current_->read(out); }
    void expect(Box const& region) override { current_->expect(region); }
    std::int64_t natural_slab() const override { return current_->natural_slab(); }
    std::vector<std::string> not_read() const override { return current_->not_read(); }
    void finish() override { current_->finish(); }

private:
    [[noreturn]] void fail(std::string const& what) const {
        throw Error(ErrorKind::data, text("'", name_, "': ", what));
    }

    /// The list counts; what vkt wrote into an image that says the same stays as it was written. A single image at time
    /// 0 is of no time.
    void put_time(Entry const& entry, std::map<std::string, std::string> const& place) {
        auto& attributes = header_.attributes;
        auto const stated = number_of(header_, "sequence position");
        if (!entry.time || (stated && *stated == *entry.time)) return;
        if (entries_.size() == 1 && *entry.time == 0) return;
        attributes.erase("sequence step");
        for (auto const& [name, value] : place) attributes[name] = value;
    }

    std::string name_;
    ReadOptions options_;
    std::vector<Entry> entries_;
    std::vector<std::map<std::string, std::string>> places_;
    std::unique_ptr<Source> current_;
    std::size_t next_ = 0;
    Header header_;
};

} // namespace

bool is_pvd(std::string_view head) {
    std::size_t const at = head.find("<VTKFile");
    if (at == std::string_view::npos) return false;
    std::string_view const tag = head.substr(at, head.find('>', at) - at);
    return tag.find("\"Collection\"") != std::string_view::npos || tag.find("'Collection'") != std::string_view::npos;
}

std::unique_ptr<Source> open_pvd(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    return std::make_unique<PvdSource>(bytes, options);
}

Format pvd_format() {
    return {"pvd",
            "ParaView's collections of VTK images, a time each",
            {".pvd"},
            [](std::span<std::byte const> head) {
                return is_pvd(std::string_view(reinterpret_cast<char const*>(head.data()), head.size()));
            },
            open_pvd,
            create_pvd};
}

} // namespace vkt
