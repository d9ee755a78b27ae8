// Elements of DICOM's data sets.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/gdcm/elements.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace vkt::dicom {

std::string element_text(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return {};
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetPointer() == nullptr) return {};
    std::string words(value->GetPointer(), value->GetLength());
    while (!words.empty() && (words.back() == ' ' || words.back() == '\0')) words.pop_back();
    return words;
}

std::vector<double> element_numbers(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    std::vector<double> values;
    for (std::string const& word : split(element_text(set, group, element), '\\')) {
        auto const value = number_in(trimmed(word));
        if (!value || !std::isfinite(*value)) return {};
        values.push_back(*value);
    }
    return values;
}

std::int64_t element_short(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element,
                           std::int64_t otherwise) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return otherwise;
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetLength() < 2) return otherwise;
    std::uint16_t number = 0;
    std::memcpy(&number, value->GetPointer(), 2);
    return number;
}

std::optional<std::uint32_t> element_long(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return std::nullopt;
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetLength() != 4) return std::nullopt;
    std::uint32_t number = 0;
    std::memcpy(&number, value->GetPointer(), 4);
    return number;
}

gdcm::SmartPointer<gdcm::SequenceOfItems> sequence(gdcm::DataSet const& set, std::uint16_t group,
                                                   std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return nullptr;
    return set.GetDataElement(tag).GetValueAsSQ();
}

std::optional<gdcm::DataSet> first_item(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    auto const items = sequence(set, group, element);
    if (items == nullptr || items->GetNumberOfItems() == 0) return std::nullopt;
    return items->GetItem(1).GetNestedDataSet();
}

namespace {

class ElementWalk {
public:
    explicit ElementWalk(std::istream& stream) : stream_(stream) {
        stream_.seekg(0, std::ios::end);
        size_ = stream_.tellg();
    }
    ~ElementWalk() {
        stream_.clear();
        stream_.seekg(0);
    }
    ElementWalk(ElementWalk const&) = delete;
    ElementWalk& operator=(ElementWalk const&) = delete;

    bool whole() {
        std::int64_t at = text_at(128, 4) == "DICM" ? 132 : 0;
        // The file's own elements are explicit and little-endian; they tell of the others.
        while (fits(at, 8) && number(at, 2) == 2) {
            Element const e = element(at);
            if (!e.known) return true;
            if (number(at + 2, 2) == 0x10) {
                std::string syntax = text_at(e.value, e.length);
                syntax.erase(std::find(syntax.begin(), syntax.end(), '\0'), syntax.end());
                if (syntax == "1.2.840.10008.1.2.1.99") return true; // deflated
                next_implicit_ = syntax == "1.2.840.10008.1.2";
                next_big_ = syntax == "1.2.840.10008.1.2.2";
            }
            at = e.value + e.length;
        }
        if (at >= size_) return at == size_ && size_ > 132;
        if (at == 0 && number(0, 2) > 0xff) return true; // big-endian, and does not say so
        // Some say that types are written and do not write them.
        implicit_ = next_implicit_.value_or(false) || !has_type(at);
        big_ = next_big_;
        return list(at, 0) != cut;
    }
    std::int64_t pixels_at() const { return pixels_at_; }

private:
    static constexpr std::int64_t cut = -1, unknown = -2;
    static constexpr std::uint32_t undefined = 0xffffffff, end_of_item = 0xfffee00d, end_of_items = 0xfffee0dd,
                                   pixels = 0x7fe00010;
    struct Element {
        std::uint32_t tag = 0;
        std::int64_t value = 0, length = 0; ///< length: -1: undefined
        bool known = false;
    };

    bool fits(std::int64_t at, std::int64_t n) const { return at <= size_ && n <= size_ - at; }
    std::string text_at(std::int64_t at, std::int64_t n) {
        if (!fits(at, n) || n > 256) return {};
        std::string words(static_cast<std::size_t>(n), '\0');
        stream_.seekg(at);
        stream_.read(words.data(), n);
        return words;
    }
    std::uint32_t number(std::int64_t at, int n) {
        std::string const b = text_at(at, n);
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < b.size(); ++i)
            value = value << 8 | static_cast<unsigned char>(b[big_ ? i : b.size() - 1 - i]);
        return value;
    }
    bool has_type(std::int64_t at) {
        std::string const type = text_at(at + 4, 2);
        return type.size() == 2 && type[0] >= 'A' && type[0] <= 'Z' && type[1] >= 'A' && type[1] <= 'Z';
    }

    Element element(std::int64_t at) {
        Element e;
        e.tag = number(at, 2) << 16 | number(at + 2, 2);
        e.value = at + 8;
        std::uint32_t length = number(at + 4, 4);
        bool const typed = !implicit_ && e.tag >> 16 != 0xfffe;
        if (typed && !has_type(at)) return e;
        if (typed) {
            static constexpr std::string_view wide[] = {"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                        "SV", "UC", "UN", "UR", "UT", "UV"};
            std::string const type = text_at(at + 4, 2);
            bool const is_wide = std::find(std::begin(wide), std::end(wide), type) != std::end(wide);
            length = is_wide ? number(at + 8, 4) : number(at + 6, 2);
            if (is_wide) e.value = at + 12;
        }
        e.length = length == undefined ? -1 : std::int64_t{length};
        e.known = true;
        return e;
    }

    /// Where the list ends: at the pixels, its own end, or the file's.
    std::int64_t list(std::int64_t at, int depth) {
        if (depth > 32) return unknown;
        while (at < size_) {
            if (!fits(at, 8)) return cut;
            Element const e = element(at);
            if (!e.known) return unknown;
            if (e.tag == pixels && depth == 0) {
                pixels_at_ = e.value;
                return at;
            }
            if (e.tag == end_of_item || e.tag == end_of_items) return e.value;
            if (e.length >= 0) {
                if (!fits(e.value, e.length)) return cut;
                at = e.value + e.length;
                continue;
            }
            at = list(e.value, depth + 1); // of items, or of an item's elements
            if (at < 0) return at;
        }
        return depth == 0 ? at : cut;
    }

    std::istream& stream_;
    std::int64_t size_ = 0, pixels_at_ = -1;
    std::optional<bool> next_implicit_;
    bool next_big_ = false, implicit_ = false, big_ = false;
};

} // namespace

ElementsFound look_at_elements(std::istream& stream) {
    ElementWalk walk(stream);
    bool const whole = walk.whole();
    return {whole, walk.pixels_at()};
}

} // namespace vkt::dicom
