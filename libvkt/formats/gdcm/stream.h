// DICOM: a file as a stream that reads what is asked for, and little of it twice, wherever one seeks.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <istream>
#include <streambuf>
#include <string>
#include <vector>

namespace vkt::dicom {

/// Streams of the library empty their buffer at each seek, and elements are read with many. This one keeps the
/// beginning of the file, where they are, and a part elsewhere that is small behind a jump; large reads go past both.
class FileBytes : public std::streambuf {
public:
    explicit FileBytes(std::string const& path);
    ~FileBytes() override;
    FileBytes(FileBytes const&) = delete;
    FileBytes& operator=(FileBytes const&) = delete;
    bool opened() const { return descriptor_ >= 0; }

protected:
    int_type underflow() override;
    std::streamsize xsgetn(char* to, std::streamsize n) override;
    pos_type seekoff(off_type by, std::ios::seekdir from, std::ios::openmode which) override;
    pos_type seekpos(pos_type to, std::ios::openmode which) override;

private:
    std::int64_t position() const { return begin_ + (gptr() - eback()); }
    std::int64_t read_at(std::int64_t at, char* to, std::int64_t n) const;
    void show(std::vector<char>& part, std::int64_t begin, std::int64_t at);

    int descriptor_;
    std::int64_t size_ = 0;
    std::vector<char> head_, part_;
    std::int64_t begin_ = 0;    ///< in the file, of what is shown
    std::int64_t part_end_ = 0; ///< in the file, of what was read last
};

class FileStream : public std::istream {
public:
    explicit FileStream(std::string const& path) : std::istream(nullptr), bytes_(path) {
        rdbuf(&bytes_);
        if (!bytes_.opened()) setstate(std::ios::failbit);
    }

private:
    FileBytes bytes_;
};

} // namespace vkt::dicom
