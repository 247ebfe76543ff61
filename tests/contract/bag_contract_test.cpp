// What BagWriter writes BagReader reads, whatever the files are, and whatever became of them.

#include <gmock/gmock.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <functional>

#include "services/bags/format/folder_reader.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using bags::BagOptions;
using bags::BagReader;
using bags::BagWriter;
using bags::Message;
using bags::Time;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr Time kBegin = 1'700'000'000'000'000'000;

struct Kind {
  const char* name;
  BagOptions options;
  const char* extension;
  bool keeps_everything;  // publish times, sequence numbers, definitions: .db3 of version 3 has no place for them
};

class BagContract : public ::testing::TestWithParam<Kind> {
 protected:
  std::unique_ptr<BagWriter> writer(BagOptions options) { return taken(BagWriter::create(bag_, options)); }
  std::unique_ptr<BagWriter> writer() { return writer(GetParam().options); }
  std::unique_ptr<BagReader> reader() { return taken(BagReader::open(bag_)); }

  static void write(BagWriter& to, int topic, Time time, const std::string& text) {
    const Bytes data = cdr_of(text);
    taken(to.write(topic, {.log_time = time, .publish_time = time - 5, .data = data}));
  }

  // In a process of its own, which must end as told.
  static void in_child(const std::function<void()>& work, const std::function<bool(int)>& ends_well) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      try {
        work();
        _exit(0);
      } catch (const std::exception& problem) {
        fprintf(stderr, "%s\n", problem.what());
        _exit(1);
      }
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(ends_well(status)) << "status " << status;
  }

  fs::path file(int number) const { return bag_ / ("a bag_" + std::to_string(number) + GetParam().extension); }

  TempFolder folder_;
  const fs::path bag_ = folder_.path() / "a bag";
};

TEST_P(BagContract, GivesBackWhatWasWritten) {
  const auto sut = writer();
  const bags::Topic latched = string_topic("/b", kLatched);
  bags::Topic retained = string_topic("/a", {.reliable = false, .retained = true, .depth = 7, .instances = 3});
  retained.type = "jostle_msgs/msg/RobotStatus";
  const int b = taken(sut->add_topic(latched)), a = taken(sut->add_topic(retained));
  write(*sut, b, kBegin, "one");
  write(*sut, a, kBegin + 10, "");
  taken(sut->write(a, {.log_time = kBegin + 20, .publish_time = kBegin + 19, .sequence = 9, .data = cdr_of("three")}));
  taken(sut->close());

  const auto back = reader();
  const bags::BagInfo& info = back->info();
  ASSERT_EQ(info.topics.size(), 2u);
  if (!GetParam().keeps_everything) retained.definition.clear();
  EXPECT_EQ(info.topics[0].topic, retained);
  EXPECT_EQ(info.topics[0].messages, 2u);
  EXPECT_EQ(info.topics[1].topic.qos, latched.qos);
  EXPECT_EQ(info.topics[1].messages, 1u);
  EXPECT_EQ(info.messages, 3u);
  EXPECT_EQ(info.start, kBegin);
  EXPECT_EQ(info.end, kBegin + 20);
  EXPECT_EQ(info.files, std::vector{file(0)});
  EXPECT_EQ(info.bytes, fs::file_size(file(0)));
  EXPECT_EQ(info.bytes, sut->bytes());
  const auto messages = rest_of(*back);
  ASSERT_EQ(messages.size(), 3u);
  EXPECT_EQ(messages[0].topic, 1);
  EXPECT_EQ(messages[0].data, cdr_of("one"));
  EXPECT_EQ(messages[1].topic, 0);
  EXPECT_EQ(messages[1].data, cdr_of(""));
  EXPECT_EQ(messages[2].log_time, kBegin + 20);
  if (GetParam().keeps_everything) {
    EXPECT_EQ(messages[0].sequence, 1u);
    EXPECT_EQ(messages[1].publish_time, kBegin + 5);
    EXPECT_EQ(messages[2].sequence, 9u);
  }
}

TEST_P(BagContract, FindsTopicsByName) {
  const auto sut = writer();
  taken(sut->add_topic(string_topic("/x")));
  taken(sut->close());
  const auto back = reader();
  EXPECT_EQ(back->find_topic("/x"), 0);
  EXPECT_EQ(back->find_topic("x"), std::nullopt);
}

TEST_P(BagContract, HoldsNothingWhenNothingWasWritten) {
  taken(writer()->close());
  const auto back = reader();
  EXPECT_EQ(back->info().messages, 0u);
  EXPECT_THAT(rest_of(*back), IsEmpty());
}

TEST_P(BagContract, IsCompleteWhenTheWriterIsDestroyed) {
  {
    const auto sut = writer();
    write(*sut, taken(sut->add_topic(string_topic("/x"))), kBegin, "x");
  }
  EXPECT_THAT(texts_of(rest_of(*reader())), ElementsAre("x"));
}

TEST_P(BagContract, SortsByLogTimeAndKeepsTheOrderOfEqualOnes) {
  const auto sut = writer();
  const int x = taken(sut->add_topic(string_topic("/x"))), y = taken(sut->add_topic(string_topic("/y")));
  write(*sut, x, kBegin + 20, "third");
  write(*sut, y, kBegin + 10, "first");
  write(*sut, x, kBegin + 10, "second");
  taken(sut->flush());  // into another chunk, which overlaps the one before
  write(*sut, x, kBegin + 15, "between");
  write(*sut, y, kBegin + 20, "last");
  taken(sut->close());
  EXPECT_THAT(texts_of(rest_of(*reader())), ElementsAre("first", "second", "between", "third", "last"));
}

TEST_P(BagContract, SeeksByTimeAndTopic) {
  const auto sut = writer();
  const int x = taken(sut->add_topic(string_topic("/x"))), y = taken(sut->add_topic(string_topic("/y")));
  for (int i = 0; i < 100; ++i) {
    write(*sut, i % 2 == 0 ? x : y, kBegin + i, std::to_string(i));
    if (i % 10 == 9) taken(sut->flush());
  }
  taken(sut->close());
  const auto back = reader();
  back->seek(kBegin + 97);
  EXPECT_THAT(texts_of(rest_of(*back)), ElementsAre("97", "98", "99"));
  back->seek(kBegin + 94, {*back->find_topic("/y")});
  EXPECT_THAT(texts_of(rest_of(*back)), ElementsAre("95", "97", "99"));
  back->seek(kBegin + 100);
  EXPECT_THAT(rest_of(*back), IsEmpty());
  back->seek(0, {*back->find_topic("/y"), *back->find_topic("/x")});
  EXPECT_EQ(taken(back->next())->log_time, kBegin);
  back->seek(0);
  EXPECT_EQ(rest_of(*back).size(), 100u);
}

TEST_P(BagContract, KnowsTheLastMessageAtATime) {
  const auto sut = writer();
  const int x = taken(sut->add_topic(string_topic("/x"))), y = taken(sut->add_topic(string_topic("/y")));
  write(*sut, x, kBegin, "old");
  taken(sut->flush());
  for (int i = 1; i < 50; ++i) {
    write(*sut, y, kBegin + i, std::to_string(i));
    if (i % 7 == 0) taken(sut->flush());
  }
  write(*sut, x, kBegin + 50, "new");
  write(*sut, x, kBegin + 50, "newer");
  taken(sut->close());
  const auto back = reader();
  const int read_x = *back->find_topic("/x"), read_y = *back->find_topic("/y");
  EXPECT_EQ(taken(back->last_at(read_x, kBegin - 1)), std::nullopt);
  EXPECT_EQ(text_of(taken(back->last_at(read_x, kBegin))->data), "old");
  EXPECT_EQ(text_of(taken(back->last_at(read_x, kBegin + 49))->data), "old");
  EXPECT_EQ(text_of(taken(back->last_at(read_x, kBegin + 50))->data), "newer");
  EXPECT_EQ(text_of(taken(back->last_at(read_y, kBegin + 23))->data), "23");
  EXPECT_EQ(taken(back->last_at(read_y, kBegin + 1000))->log_time, kBegin + 49);
  // next() goes on as if nothing had been asked.
  EXPECT_EQ(text_of(taken(back->next())->data), "old");
  EXPECT_EQ(taken(back->last_at(read_y, kBegin + 30))->topic, read_y);
  EXPECT_EQ(text_of(taken(back->next())->data), "1");
}

TEST_P(BagContract, SplitsByTimeAndRepeatsLatchedSamplesOnce) {
  BagOptions options = GetParam().options;
  options.split_time = std::chrono::nanoseconds(10);
  const auto sut = writer(options);
  const int map = taken(sut->add_topic(string_topic("/map", kLatched)));
  const int x = taken(sut->add_topic(string_topic("/x")));
  write(*sut, map, kBegin, "first map");
  write(*sut, map, kBegin + 1, "map");
  for (int i = 2; i < 25; ++i) write(*sut, x, kBegin + i, std::to_string(i));
  EXPECT_EQ(sut->files(), 3);
  taken(sut->close());

  const auto back = reader();
  EXPECT_EQ(back->info().files, (std::vector{file(0), file(1), file(2)}));
  EXPECT_EQ(back->info().messages, 25u);
  EXPECT_EQ(back->info().topics[0].messages, 2u);
  EXPECT_EQ(rest_of(*back).size(), 25u);
  back->seek(kBegin + 8);
  EXPECT_EQ(rest_of(*back).size(), 17u);
  EXPECT_EQ(text_of(taken(back->last_at(0, kBegin + 24))->data), "map");
  EXPECT_EQ(taken(back->last_at(0, kBegin + 24))->log_time, kBegin + 1);

  const auto alone = taken(BagReader::open(file(2)));
  const auto messages = rest_of(*alone);
  ASSERT_EQ(messages.size(), 6u);
  EXPECT_EQ(text_of(messages[0].data), "map");
  EXPECT_EQ(messages[0].log_time, kBegin + 20);
  EXPECT_EQ(text_of(messages[1].data), "20");
  EXPECT_EQ(alone->info().start, kBegin + 20);
}

TEST_P(BagContract, SplitsBySize) {
  BagOptions options = GetParam().options;
  options.split_bytes = 100'000;
  const auto sut = writer(options);
  const int x = taken(sut->add_topic(string_topic("/x")));
  for (int i = 0; i < 100; ++i) {
    taken(sut->write(x, {.log_time = kBegin + i, .data = noise(10'000, static_cast<std::uint64_t>(i))}));
  }
  taken(sut->close());
  EXPECT_GE(sut->files(), 8);
  EXPECT_LE(sut->files(), 11);
  const auto back = reader();
  EXPECT_EQ(back->info().files.size(), static_cast<std::size_t>(sut->files()));
  const auto messages = rest_of(*back);
  ASSERT_EQ(messages.size(), 100u);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(messages[static_cast<std::size_t>(i)].data, noise(10'000, static_cast<std::uint64_t>(i)));
    if (GetParam().keeps_everything) {
      EXPECT_EQ(messages[static_cast<std::size_t>(i)].sequence, static_cast<std::uint32_t>(i + 1));
    }
  }
}

TEST_P(BagContract, TakesTopicsWhileItIsWritten) {
  BagOptions options = GetParam().options;
  options.split_time = std::chrono::nanoseconds(10);
  const auto sut = writer(options);
  write(*sut, taken(sut->add_topic(string_topic("/x"))), kBegin, "x");
  write(*sut, taken(sut->add_topic(string_topic("/y"))), kBegin + 10, "y");
  write(*sut, taken(sut->add_topic(string_topic("/z"))), kBegin + 20, "z");
  EXPECT_THAT(sut->add_topic(string_topic("/y")).error().message, HasSubstr("/y: got the topic twice"));
  taken(sut->close());
  EXPECT_THAT(texts_of(rest_of(*reader())), ElementsAre("x", "y", "z"));
}

TEST_P(BagContract, KeepsNotes) {
  BagOptions options = GetParam().options;
  options.split_time = std::chrono::nanoseconds(10);
  const auto sut = writer(options);
  const int x = taken(sut->add_topic(string_topic("/x")));
  write(*sut, x, kBegin, "x");
  sut->set_note("record", {{"command", "jostle record \"a\\b\"\n"}});
  sut->set_note("lost", {{"/x", "3"}});
  write(*sut, x, kBegin + 10, "x");
  sut->set_note("lost", {{"/x", "4"}, {"/y", ""}});
  taken(sut->close());
  const auto notes = reader()->info().notes;
  EXPECT_EQ(notes, (std::map<std::string, bags::Note>{{"record", {{"command", "jostle record \"a\\b\"\n"}}},
                                                      {"lost", {{"/x", "4"}, {"/y", ""}}}}));
}

TEST_P(BagContract, TakesLargeMessages) {
  const auto sut = writer();
  const int x = taken(sut->add_topic(string_topic("/x")));
  const Bytes large = noise(5'000'000, 1), zeros(20'000'000);
  taken(sut->write(x, {.log_time = kBegin, .data = large}));
  taken(sut->write(x, {.log_time = kBegin + 1, .data = zeros}));
  taken(sut->close());
  const auto messages = rest_of(*reader());
  ASSERT_EQ(messages.size(), 2u);
  EXPECT_TRUE(messages[0].data == large);
  EXPECT_TRUE(messages[1].data == zeros);
}

TEST_P(BagContract, RefusesWhatMakesNoSense) {
  const auto sut = writer();
  EXPECT_THAT(sut->write(0, {.log_time = kBegin}).error().message, HasSubstr("topic: got 0"));
  const int x = taken(sut->add_topic(string_topic("/x")));
  EXPECT_THAT(sut->write(x, {.log_time = -1}).error().message, HasSubstr("log time: got -1"));
  taken(sut->close());
  EXPECT_THAT(sut->write(x, {.log_time = kBegin}).error().message, HasSubstr("closed"));
  EXPECT_TRUE(sut->close());
  const auto again = BagWriter::create(bag_, GetParam().options);
  EXPECT_EQ(again.error().code, Code::kInvalidArgument);
  EXPECT_THAT(again.error().message, HasSubstr(bag_.string()));
}

TEST_P(BagContract, SaysWhatIsNotABag) {
  EXPECT_EQ(BagReader::open(bag_).error().code, Code::kNotFound);
  fs::create_directory(bag_);
  EXPECT_THAT(BagReader::open(bag_).error().message, HasSubstr("wanted a bag"));
  const auto foreign =
      folder_.write(std::string("notes") + GetParam().extension, "These are no messages, but a text of some length.");
  const auto error = BagReader::open(foreign).error();
  EXPECT_EQ(error.code, Code::kInvalidArgument);
  EXPECT_THAT(error.message, HasSubstr(foreign.string()));
  const auto empty = folder_.write(std::string("empty") + GetParam().extension, "");
  EXPECT_EQ(BagReader::open(empty).error().code, Code::kInvalidArgument);
  EXPECT_THAT(BagReader::open(folder_.write("a.bag", "x")).error().message, HasSubstr("wanted .mcap or .db3"));
}

TEST_P(BagContract, SaysWhichFileIsMissing) {
  taken(writer()->close());
  fs::remove(file(0));
  const auto error = BagReader::open(bag_).error();
  EXPECT_EQ(error.code, Code::kNotFound);
  EXPECT_THAT(error.message, HasSubstr(file(0).string()));
}

TEST_P(BagContract, NeverCrashesOnATruncatedFile) {
  const auto sut = writer();
  const int x = taken(sut->add_topic(string_topic("/x")));
  for (int i = 0; i < 2000; ++i) write(*sut, x, kBegin + i, std::to_string(i));
  taken(sut->close());
  const auto size = fs::file_size(file(0));
  for (int part = 0; part < 16; ++part) {
    fs::resize_file(file(0), size * static_cast<std::uintmax_t>(15 - part) / 16);
    // An error, or the messages that are left; in either case when asked to recover.
    if (const auto opened = BagReader::open(bag_)) {
      while (true) {
        const auto message = (*opened)->next();
        if (!message) {
          EXPECT_THAT(message.error().message, HasSubstr(file(0).string()));
          break;
        }
        if (!*message) break;
      }
    } else {
      EXPECT_THAT(opened.error().message, HasSubstr(file(0).string()));
    }
    if (const auto saved = bags::open_bag(bag_, true)) {
      int count = 0;
      while (true) {
        const auto message = (*saved)->next();
        if (!message || !*message) break;
        EXPECT_EQ(text_of((*message)->data), std::to_string(count++));
      }
    }
  }
}

TEST_P(BagContract, KeepsWhatWasFlushedWhenTheWriterIsKilled) {
  in_child(
      [&] {
        const auto sut = writer();
        const int x = taken(sut->add_topic(string_topic("/x")));
        sut->set_note("lost", {{"/x", "1"}});
        for (int i = 0; i < 1000; ++i) {
          write(*sut, x, kBegin + i, std::to_string(i));
          if (i == 500) taken(sut->flush());
        }
        sut->set_note("lost", {{"/x", "2"}});
        taken(sut->flush());
        write(*sut, x, kBegin + 1000, "1000");
        raise(SIGKILL);
      },
      [](int status) { return WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL; });
  const auto saved = taken(bags::open_bag(bag_, true));
  const auto messages = rest_of(*saved);
  ASSERT_GE(messages.size(), 1000u);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(text_of(messages[static_cast<std::size_t>(i)].data), std::to_string(i));
  EXPECT_EQ(saved->info().notes.at("lost"), (bags::Note{{"/x", "2"}}));
}

// Killed in the middle of whatever it does, not where it is convenient.
TEST_P(BagContract, KeepsWhatWasFlushedWheneverTheWriterIsKilled) {
  for (int round = 1; round <= 8; ++round) {
    SCOPED_TRACE(round);
    const fs::path bag = folder_.path() / ("killed-" + std::to_string(round));
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      const auto sut = taken(BagWriter::create(bag, GetParam().options));
      const int x = taken(sut->add_topic(string_topic("/x")));
      for (int count = 0;; ++count) {
        write(*sut, x, kBegin + count, std::to_string(count));
        if (count % 97 != 96) continue;
        taken(sut->flush());
        const int flushed = count + 1;
        if (::write(ends[1], &flushed, sizeof flushed) != sizeof flushed) _exit(1);
      }
    }
    close(ends[1]);
    int flushed = 0;
    for (int i = 0; i < round * round; ++i) {
      ASSERT_EQ(read(ends[0], &flushed, sizeof flushed), static_cast<ssize_t>(sizeof flushed));
    }
    kill(child, SIGKILL);
    while (read(ends[0], &flushed, sizeof flushed) == static_cast<ssize_t>(sizeof flushed)) continue;
    close(ends[0]);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    const auto saved = taken(bags::open_bag(bag, true));
    const auto messages = rest_of(*saved);
    ASSERT_GE(messages.size(), static_cast<std::size_t>(flushed));
    for (std::size_t i = 0; i < messages.size(); ++i) ASSERT_EQ(text_of(messages[i].data), std::to_string(i));
  }
}

// The limit on a file's size, its signal ignored, stands for a full disk: write() takes what
// fits, then fails.
TEST_P(BagContract, EndsAtItsLastWholeChunkWhenTheDiskIsFull) {
  constexpr rlim_t kRoom = 3'400'000;
  in_child(
      [&] {
        signal(SIGXFSZ, SIG_IGN);
        const auto sut = writer();
        const int x = taken(sut->add_topic(string_topic("/x")));
        const rlimit limit{kRoom, kRoom};
        setrlimit(RLIMIT_FSIZE, &limit);
        Result<void> ok;
        int written = 0;
        while (ok && written < 10'000) {
          ok = sut->write(x, {.log_time = kBegin + written, .data = noise(1000, static_cast<std::uint64_t>(written))});
          ++written;
          if (ok && written % 500 == 0) ok = sut->flush();
        }
        if (ok) throw std::runtime_error("the limit has no effect");
        if (ok.error().code != Code::kIo) throw std::runtime_error(ok.error().message);
        if (ok.error().message.find(file(0).string()) == std::string::npos) {
          throw std::runtime_error(ok.error().message);
        }
        if (sut->write(x, {.log_time = kBegin})) throw std::runtime_error("it goes on after a failure");
        taken(sut->close());
      },
      [](int status) { return WIFEXITED(status) && WEXITSTATUS(status) == 0; });
  const auto back = reader();  // complete: it has an index and metadata.yaml
  const auto messages = rest_of(*back);
  EXPECT_EQ(messages.size(), back->info().messages);
  EXPECT_GE(messages.size(), 2000u);
  for (std::size_t i = 0; i < messages.size(); ++i) {
    EXPECT_EQ(messages[i].log_time, kBegin + static_cast<Time>(i));
    EXPECT_TRUE(messages[i].data == noise(1000, i));
  }
}

// A disk that others fill, too: what is kept for the index is not theirs.
TEST_P(BagContract, IsCompletedOnASmallDisk) {
  const auto work = [&] {
    if (unshare(CLONE_NEWNS) != 0 || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("tmpfs", folder_.path().c_str(), "tmpfs", 0, "size=4m") != 0) {
      throw std::runtime_error("a disk cannot be mounted");
    }
    const auto sut = writer();
    const int x = taken(sut->add_topic(string_topic("/x")));
    Result<void> ok;
    std::size_t written = 0;
    while (ok && written < 10'000) {
      ok = sut->write(x, {.log_time = kBegin + static_cast<Time>(written), .data = noise(1000, written)});
      ++written;
    }
    if (ok) throw std::runtime_error("the disk has no end");
    std::ofstream(folder_.path() / "another's") << std::string(8 << 20, 'x');
    if (GetParam().extension == std::string(".db3")) fs::remove(folder_.path() / "another's");  // it keeps no room
    taken(sut->close());
    fs::remove(folder_.path() / "another's");
    const auto back = reader();
    const auto messages = rest_of(*back);
    if (messages.size() < 1000 || messages.size() != back->info().messages) {
      throw std::runtime_error("messages are missing");
    }
  };
  in_child(work, [](int status) { return WIFEXITED(status) && WEXITSTATUS(status) == 0; });
}

INSTANTIATE_TEST_SUITE_P(Mcap, BagContract, ::testing::Values(Kind{"Mcap", {}, ".mcap", true}));
INSTANTIATE_TEST_SUITE_P(McapUncompressed, BagContract,
                         ::testing::Values(Kind{"McapUncompressed", {.compress = false}, ".mcap", true}));
INSTANTIATE_TEST_SUITE_P(Sqlite, BagContract,
                         ::testing::Values(Kind{"Sqlite", {.storage = BagOptions::Storage::kSqlite}, ".db3", false}));

}  // namespace
}  // namespace jostle::tests
