// A GPU for machines without one: its memory is files in memory, and it counts what is done with them.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/gpu_memory.h"
#include "libvkt/core/error.h"
#include "libvkt/io/shared_memory.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt::test {

class FileGpu : public ipc::GpuMemory {
public:
    explicit FileGpu(unsigned char name = 1) { identity_.fill(std::byte{name}); }

    /// From now on memory cannot be shared.
    void refuse_identity(std::string why) { no_identity_ = std::move(why); }
    /// From now on there is no memory.
    void refuse_pieces(std::string why) { no_pieces_ = std::move(why); }

    int pieces_made() const { return counts_->made; }
    int pieces_opened() const { return counts_->opened; }
    int pieces_alive() const { return counts_->alive; }
    int settled() const { return settled_; }
    std::size_t most_bytes() const { return most_bytes_; }

    DeviceIdentity identity() override {
        if (!no_identity_.empty()) throw Error(ErrorKind::resources, no_identity_);
        return identity_;
    }
    std::unique_ptr<ipc::RingMemory> create(std::size_t bytes) override {
        if (!no_pieces_.empty()) throw Error(ErrorKind::resources, no_pieces_);
        ++counts_->made;
        most_bytes_ = std::max(most_bytes_, bytes);
        int const file = ::memfd_create("vkt-gpu", MFD_CLOEXEC);
        if (file < 0 || ::ftruncate(file, static_cast<off_t>(bytes)) != 0)
            throw Error(ErrorKind::resources, "no file in memory");
        return std::make_unique<Piece>(counts_, file, bytes);
    }
    std::unique_ptr<ipc::RingMemory> open(int descriptor, std::size_t bytes) override {
        auto piece = std::make_unique<Piece>(counts_, descriptor, bytes);
        ++counts_->opened;
        return piece;
    }
    void settle() override { ++settled_; }
    Space space() const override { return Space::host; }
    std::size_t slab_bytes() override { return std::size_t{1} << 20; }

private:
    struct Counts {
        std::atomic<int> made = 0, opened = 0, alive = 0;
    };

    class Piece : public ipc::RingMemory {
    public:
        Piece(std::shared_ptr<Counts> counts, int file, std::size_t bytes)
            : counts_(std::move(counts)), file_(file), mapping_(mapped(file, bytes)) {
            ++counts_->alive;
        }
        ~Piece() override {
            ::close(file_);
            --counts_->alive;
        }
        std::byte* data() const override { return mapping_->data(); }
        int descriptor() const override { return file_; }

    private:
        static std::unique_ptr<SharedMapping> mapped(int file, std::size_t bytes) {
            struct stat status {};
            if (::fstat(file, &status) != 0 || static_cast<std::size_t>(status.st_size) < bytes) {
                ::close(file);
                throw Error(ErrorKind::resources, "GPU: cannot map shared memory: invalid argument");
            }
            return std::make_unique<SharedMapping>(file, bytes, SharedMapping::Rights::write);
        }

        std::shared_ptr<Counts> counts_;
        int file_;
        std::unique_ptr<SharedMapping> mapping_;
    };

    DeviceIdentity identity_{};
    std::string no_identity_, no_pieces_;
    std::shared_ptr<Counts> counts_ = std::make_shared<Counts>();
    std::atomic<int> settled_ = 0;
    std::size_t most_bytes_ = 0;
};

} // namespace vkt::test
