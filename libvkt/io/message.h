// Messages between this process and a child that parses: numbers and texts in order, perhaps with a descriptor.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Values are taken out in the order in which they were put in. The sender may have lost its mind: taking throws
/// Error{data} for messages that end early, and never reads beyond them.
class Message {
public:
    Message() = default;
    explicit Message(std::string bytes) : bytes_(std::move(bytes)) {}

    void put(std::int64_t number);
    void put(double number);
    void put(std::string_view text);
    /// A table of records without pointers, as they lie in memory.
    template <class T> void put_table(std::span<T const> records) {
        bytes_.reserve(bytes_.size() + sizeof(std::int64_t) + records.size_bytes());
        put(std::string_view(reinterpret_cast<char const*>(records.data()), records.size_bytes()));
    }

    std::int64_t number();
    double real();
    std::string text();
    template <class T> std::vector<T> table() {
        std::string_view const bytes = view();
        if (bytes.size() % sizeof(T) != 0) malformed();
        std::vector<T> records(bytes.size() / sizeof(T));
        copy(bytes, records.data());
        return records;
    }

    std::string const& bytes() const { return bytes_; }

private:
    [[noreturn]] static void malformed();
    static void copy(std::string_view from, void* to);
    std::string_view view();

    std::string bytes_;
    std::size_t taken_ = 0;
};

/// Sends a message, and a descriptor beside it unless that is -1. False if nobody is there any more.
bool send_message(int socket, Message const& message, int descriptor = -1);

struct Received {
    Message message;
    int descriptor = -1; ///< the receiver's to close
};

/// The next message; nullopt if the other end is gone or sends what is no message.
std::optional<Received> receive_message(int socket);

} // namespace vkt
