// DICOM: the elements of data sets that GDCM has read, and whether a file holds the elements that it says.
// SPDX-License-Identifier: MIT
#pragma once

#include <gdcmDataSet.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmSmartPointer.h>
#include <gdcmTag.h>

#include <cstdint>
#include <cstring>
#include <istream>
#include <optional>
#include <string>
#include <vector>

namespace vkt::dicom {

inline gdcm::Tag const pixel_data(0x7fe0, 0x0010);

/// Without the blanks at its end; empty if it is not there.
std::string element_text(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element);

/// Decimal strings; none if one of them is no finite number.
std::vector<double> element_numbers(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element);

/// Binary elements of two bytes, in this machine's order as GDCM hands them out.
std::int64_t element_short(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element,
                           std::int64_t otherwise);

/// The same of four bytes.
std::optional<std::uint32_t> element_long(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element);

/// Elements of some binary numbers.
template <class T> std::vector<T> element_values(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return {};
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetPointer() == nullptr || value->GetLength() % sizeof(T) != 0) return {};
    std::vector<T> values(value->GetLength() / sizeof(T));
    std::memcpy(values.data(), value->GetPointer(), value->GetLength());
    return values;
}

/// Null if it is not there.
gdcm::SmartPointer<gdcm::SequenceOfItems> sequence(gdcm::DataSet const& set, std::uint16_t group,
                                                   std::uint16_t element);

std::optional<gdcm::DataSet> first_item(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element);

struct ElementsFound {
    bool whole = true;        ///< they end where they say, up to the pixels
    std::int64_t pixels = -1; ///< where the value of those begins; -1: not found
};
/// Looks at the elements of a file up to its pixels: GDCM may end the process for one that is cut short among them.
/// What is no plain list of elements is left to GDCM.
ElementsFound look_at_elements(std::istream& stream);

} // namespace vkt::dicom
