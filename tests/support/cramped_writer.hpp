#pragma once
/// \file
/// A writer that can be made to fail.

#include <string>

namespace jostle::tests {

/// Profile of a topic's writer that takes no message larger than its type is with texts of 255
/// characters and sequences of 100 entries; write() says false to others. Goes in front of the
/// `</profiles>` of the shipped file.
inline std::string cramped_writer(const std::string& topic) {
  return R"(<data_writer profile_name=")" + topic + R"(">
    <topic><historyQos><kind>KEEP_LAST</kind><depth>512</depth></historyQos></topic>
    <qos><reliability><kind>RELIABLE</kind></reliability></qos>
    <historyMemoryPolicy>PREALLOCATED</historyMemoryPolicy>
  </data_writer>
)";
}

}  // namespace jostle::tests
