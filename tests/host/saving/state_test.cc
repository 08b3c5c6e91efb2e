// Fields: every type there and back, streams of any length, and bytes that are not fields.
#include "host/saving/state.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

enum class Colour : std::uint32_t { kRed = 0, kBlue = 7 };

struct Everything {
  std::uint64_t count = 0;
  std::uint32_t small = 0;
  std::int64_t balance = 0;
  double real = 0;
  bool flag = false;
  Colour colour = Colour::kRed;
  std::string text;
  std::vector<double> reals;
  std::vector<float> floats;
  std::vector<std::byte> bytes;
  std::map<std::string, std::string> map;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("count", &count);
    (*archive)("small", &small);
    (*archive)("balance", &balance);
    (*archive)("real", &real);
    (*archive)("flag", &flag);
    (*archive)("colour", &colour);
    (*archive)("text", &text);
    (*archive)("reals", &reals);
    (*archive)("floats", &floats);
    (*archive)("bytes", &bytes);
    VisitMap(archive, "map", &map);
  }
};

Everything Some() {
  Everything some;
  some.count = 1ull << 63;
  some.small = 3;
  some.balance = -5;
  some.real = 0.1;
  some.flag = true;
  some.colour = Colour::kBlue;
  some.text = std::string("a\0b", 3);
  some.reals.assign(20000, 0.25);  // more than the buffer holds
  some.floats = {1.5f};
  some.bytes = {std::byte{1}, std::byte{2}};
  some.map = {{"a", "1"}, {"b", ""}};
  return some;
}

std::string Written(const std::function<void(StateWriter*)>& write) {
  std::string bytes;
  StateWriter writer([&](std::string_view piece) { bytes += piece; });
  write(&writer);
  writer.Flush();
  return bytes;
}

void Read(const std::string& bytes, const std::function<void(StateReader*)>& read) {
  std::size_t position = 0;
  StateReader reader(
      [&](void* data, std::uint64_t size) {
        std::memcpy(data, bytes.data() + position, size);
        position += size;
      },
      bytes.size(), "here", "Start over");
  read(&reader);
  reader.Finish();
}

TEST(State, EveryTypeComesBackAsItWas) {
  Everything some = Some(), found;
  const std::string bytes = Written([&](StateWriter* writer) { some.Fields(writer); });
  Read(bytes, [&](StateReader* reader) { found.Fields(reader); });
  EXPECT_EQ(Written([&](StateWriter* writer) { found.Fields(writer); }), bytes);
  EXPECT_EQ(found.count, some.count);
  EXPECT_EQ(found.balance, -5);
  EXPECT_EQ(found.colour, Colour::kBlue);
  EXPECT_EQ(found.text, some.text);
  EXPECT_EQ(found.reals, some.reals);
  EXPECT_EQ(found.map, some.map);
  EXPECT_EQ(StateBytes([&](StateWriter* writer) { some.Fields(writer); }), bytes.size());
}

TEST(State, ALargeArrayIsHandedOverWhereItLies) {
  std::vector<double> values(100000, 1);
  bool seen = false;
  StateWriter writer([&](std::string_view piece) {
    seen = seen || piece.data() == reinterpret_cast<const char*>(values.data());
  });
  writer("values", &values);
  EXPECT_TRUE(seen);
}

TEST(State, AStreamOfAnyLengthComesBackAsItWas) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{65536},
                                 std::size_t{65537}, std::size_t{300000}}) {
    SCOPED_TRACE(size);
    std::string content(size, '\0');
    Random random(size);
    for (char& c : content) c = static_cast<char>(random.Below(256));
    const std::string bytes = Written([&](StateWriter* writer) {
      const Status saved = writer->Stream("stream", [&](ByteSink* sink) {
        // In uneven pieces, as components write.
        for (std::size_t at = 0, n = 1; at < size; at += n, n = n * 3 + 1) {
          n = std::min(n, size - at);
          const Status status = sink->Write(content.data() + at, n);
          if (!status.ok()) return status;
        }
        return OkStatus();
      });
      EXPECT_TRUE(saved.ok());
      const std::uint64_t after = 9;
      (*writer)("after", &after);
    });
    std::string found(size, '\0');
    Read(bytes, [&](StateReader* reader) {
      const Status loaded = reader->Stream(
          "stream", [&](ByteSource* source) { return source->Read(found.data(), found.size()); });
      EXPECT_TRUE(loaded.ok()) << loaded.message;
      std::uint64_t after = 0;
      (*reader)("after", &after);
      EXPECT_EQ(after, 9u);
    });
    EXPECT_EQ(found, content);
  }
}

TEST(State, AComponentThatReadsMoreOrLessThanItSavedIsFound) {
  const std::string bytes = Written([](StateWriter* writer) {
    EXPECT_TRUE(
        writer->Stream("stream", [](ByteSink* sink) { return sink->Write("1234", 4); }).ok());
  });
  for (const std::size_t size : {3, 5}) {
    Status loaded;
    try {
      Read(bytes, [&](StateReader* reader) {
        char room[8];
        loaded =
            reader->Stream("stream", [&](ByteSource* source) { return source->Read(room, size); });
      });
    } catch (const Failure&) {  // of the rest that was not read
    }
    EXPECT_EQ(loaded.code, StatusCode::kDataLoss) << size;
  }
}

TEST(State, TheFaultOfTheDestinationPassesThroughAComponent) {
  StateWriter writer([](std::string_view) { throw Failure(ExitCode::kInputOutput, "disk full"); });
  const std::string large(200000, 'x');
  try {
    const Status unreached = writer.Stream("stream", [&](ByteSink* sink) {
      const Status status = sink->Write(large.data(), large.size());
      EXPECT_FALSE(status.ok());
      EXPECT_FALSE(sink->Write("y", 1).ok()) << "it stays failed";
      return status;
    });
    ADD_FAILURE() << unreached.message;
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kInputOutput);
  }
}

TEST(State, ANumberThatTheFieldCannotHoldIsRefused) {
  const std::uint64_t large = 1ull << 40;
  const std::string bytes = Written([&](StateWriter* writer) { (*writer)("small", &large); });
  std::uint32_t small = 0;
  EXPECT_THROW(Read(bytes, [&](StateReader* reader) { (*reader)("small", &small); }), Failure);
}

// Whatever the bytes are, reading ends with a value or a refusal, and allocates no more
// than there is.
TEST(State, DamagedBytesAreRefusedOrReadNeverWorse) {
  Everything some = Some();
  some.reals.resize(10);
  const std::string good = Written([&](StateWriter* writer) { some.Fields(writer); });
  std::size_t refused = 0;
  for (std::uint64_t seed = 0; seed < 20000; ++seed) {
    Random random(seed);
    std::string bad = good.substr(0, random.Below(good.size() + 1));
    for (std::uint64_t i = random.Below(4); i > 0 && !bad.empty(); --i) {
      bad[random.Below(bad.size())] = static_cast<char>(random.Below(256));
    }
    Everything found;
    try {
      Read(bad, [&](StateReader* reader) { found.Fields(reader); });
    } catch (const Failure& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      ++refused;
    }
  }
  EXPECT_GT(refused, 15000u);
}

}  // namespace
}  // namespace dreamsearch
