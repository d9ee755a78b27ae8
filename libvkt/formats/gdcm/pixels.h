// DICOM: the pixels of a slice: where they lie in their file, and how they are decoded.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/gdcm/input.h"
#include "libvkt/formats/gdcm/slice.h"

#include <gdcmFile.h>

#include <cstdint>
#include <istream>
#include <span>
#include <string>
#include <vector>

namespace vkt::dicom {

/// Notes where the pixels lie that no library needs to decode. Throws Error{data} for those that are cut short, since
/// GDCM takes zeros for what a file that was cut short lacks. The stream is behind the head of the pixel data, where
/// GDCM leaves it, or their value begins at `found`, below 0 if nobody knows; the four bytes before it are their
/// length.
void check_pixels(std::istream& stream, gdcm::File const& file, Input const& input, std::int64_t found, Slice& slice);

/// Decodes frames, and keeps what was decoded last.
class FrameDecoder {
public:
    /// The pixels of one frame.
    std::span<char const> frame_of(Input const& input, Slice const& slice);
    /// Whether its samples are planes, one behind the other.
    bool planar() const { return planar_; }

private:
    std::vector<char> const& pixels(Input const& input, Slice const& slice);
    void read_plain(std::istream& stream, Slice const& slice);
    bool read_runs(std::istream& stream, Slice const& slice);
    bool single_bits(gdcm::DataSet const& set, Slice const& slice);
    void to_colours(Slice const& slice);

    std::string held_file_;
    std::int64_t held_frame_ = -1; ///< -1: all of them
    bool held_ = false;
    std::vector<char> pixels_;
    bool planar_ = false;
};

} // namespace vkt::dicom
