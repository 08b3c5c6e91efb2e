// Pictures: where they go, and that nothing is left of a film that failed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "host/films/film_writer.h"
#include "host/films/picture.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/temporary_folder.h"

namespace dreamsearch {
namespace {

// Of a pixel's first byte.
std::size_t Offset(const Picture& picture, int x, int y) {
  return 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
              static_cast<std::size_t>(x));
}

Picture Plain(int width, int height, std::uint8_t shade) {
  Picture picture{width, height, {}};
  picture.rgb.assign(Offset(picture, 0, height), shade);
  return picture;
}

int ShadeAt(const Picture& picture, int x, int y) { return picture.rgb[Offset(picture, x, y)]; }

TEST(PictureSheet, KeepsTheFirstAndTheLastAndSpreadsTheRestEvenly) {
  for (const int count : {1, 2, 11, 12, 13, 48, 49, 100, 251}) {
    PictureSheet sheet(12);
    for (int i = 0; i < count; ++i) sheet.Add(Plain(2, 2, static_cast<std::uint8_t>(i)));
    const std::vector<Picture> chosen = sheet.Chosen();
    ASSERT_EQ(chosen.size(), static_cast<std::size_t>(std::min(count, 12))) << count;
    EXPECT_EQ(ShadeAt(chosen.front(), 0, 0), 0) << count;
    EXPECT_EQ(ShadeAt(chosen.back(), 0, 0), count - 1) << count;
    for (std::size_t i = 1; i < chosen.size(); ++i) {
      const int gap = ShadeAt(chosen[i], 0, 0) - ShadeAt(chosen[i - 1], 0, 0);
      EXPECT_GE(gap, 1) << count << " pictures, " << i;
      EXPECT_LE(gap, 2 * count / 11 + 1) << count << " pictures, " << i;
    }
  }
}

TEST(Grid, GoesFromLeftToRightThenDownAndHasEvenSides) {
  const Picture grid = Grid({Plain(3, 5, 10), Plain(3, 5, 20), Plain(3, 5, 30)}, 2);
  EXPECT_EQ(grid.width, 6);
  EXPECT_EQ(grid.height, 10);
  EXPECT_EQ(ShadeAt(grid, 0, 0), 10);
  EXPECT_EQ(ShadeAt(grid, 3, 4), 20);
  EXPECT_EQ(ShadeAt(grid, 2, 9), 30);
  EXPECT_EQ(ShadeAt(grid, 5, 9), 0);
  EXPECT_EQ(Grid({Plain(3, 5, 1)}, 4).width, 4);
  EXPECT_THROW(Grid({Plain(3, 5, 1), Plain(4, 5, 1)}, 2), Failure);
}

TEST(Panel, LeavesTheSceneAsItIsAndDrawsPositiveActionsUpwards) {
  Frame frame;
  frame.scene = Plain(200, 100, 77);
  frame.action = {1, -1};
  frame.decision = 3;
  const Picture panel = Panel(frame, "a title that is far too long for such a narrow picture");
  ASSERT_EQ(panel.width, 200);
  ASSERT_EQ(panel.height, 100 + kPanelLines);
  const int top = 26;
  for (const int x : {0, 100, 199}) {
    for (const int y : {0, 50, 99}) EXPECT_EQ(ShadeAt(panel, x, top + y), 77);
  }
  // The two bars end 8 pixels from the right edge, 12 wide each; blue is positive.
  const auto blue = [&](int x, int y) { return panel.rgb[Offset(panel, x, y) + 2]; };
  const int middle = top + 100 + 2 + 15;
  EXPECT_GT(blue(200 - 8 - 18, middle - 8), 200);  // the first, above
  EXPECT_LT(blue(200 - 8 - 18, middle + 8), 100);
  EXPECT_LT(blue(200 - 8 - 6, middle - 8), 100);
  EXPECT_GT(ShadeAt(panel, 200 - 8 - 6, middle + 8), 200);  // the second, below, is orange
}

TEST(Panel, WritesNothingOverTheActionHoweverNarrowItIs) {
  Frame frame;
  frame.scene = Plain(200, 100, 77);
  frame.action = {1, -1, 1, -1, 1, -1};
  frame.seconds = 1234;
  frame.decision = 123456;
  const Picture without = Panel(frame, "title");
  frame.depth = 12;
  frame.simulations = 5000;
  frame.value = 12345.6;
  const Picture with = Panel(frame, "title");
  EXPECT_NE(with.rgb, without.rgb) << "the search is told";
  const int bars = 200 - 8 - static_cast<int>(200 / 3.0);
  for (int y = 0; y < with.height; ++y) {
    for (int x = bars - 4; x < 200; ++x) {
      ASSERT_EQ(ShadeAt(with, x, y), ShadeAt(without, x, y)) << x << ", " << y;
    }
  }
}

TEST(Scaled, KeepsAPlainColour) {
  const Picture small = Scaled(Plain(64, 48, 99), 16, 12);
  EXPECT_EQ(small.width, 16);
  EXPECT_EQ(ShadeAt(small, 8, 6), 99);
}

TEST(FilmWriter, TellsByTheNameWhatIsWanted) {
  for (const char* path : {"a.mp4", "a.webm", "a.gif", "a.png", "folder/"}) {
    EXPECT_NO_THROW(FilmWriter::CheckPath(path)) << path;
  }
  for (const char* path : {"a.avi", "a", "a.png.txt", ""}) {
    EXPECT_THROW(FilmWriter::CheckPath(path), Failure) << path;
  }
}

TEST(FilmWriter, AFolderGetsAPngForEachPicture) {
  const TemporaryFolder folder;
  const std::string to = (folder / "frames") + "/";
  const auto writer = FilmWriter::Make(to, 25);
  for (int i = 0; i < 3; ++i) writer->Add(Plain(8, 8, 50));
  writer->Finish();
  for (const char* name : {"frame-000001.png", "frame-000003.png"}) {
    EXPECT_EQ(ReadWholeFile(to + name).substr(0, 8), "\x89PNG\r\n\x1a\n") << name;
  }
  EXPECT_FALSE(std::filesystem::exists(to + "frame-000004.png"));
}

TEST(FilmWriter, AVideoIsThereOnlyWhenItIsWhole) {
  const TemporaryFolder folder;
  const std::string path = folder / "a film.mp4";
  const auto entries = [&] {
    return std::distance(
        std::filesystem::directory_iterator(std::filesystem::path(path).parent_path()), {});
  };
  {
    const auto writer = FilmWriter::Make(path, 25);
    writer->Add(Plain(64, 48, 50));
  }
  EXPECT_EQ(entries(), 0);
  const auto writer = FilmWriter::Make(path, 25);
  for (int i = 0; i < 10; ++i) writer->Add(Plain(64, 48, static_cast<std::uint8_t>(20 * i)));
  writer->Finish();
  EXPECT_EQ(entries(), 1);
  EXPECT_EQ(ReadWholeFile(path).substr(4, 4), "ftyp");
}

TEST(FilmWriter, WithoutFfmpegASentenceNamesThePackage) {
  const TemporaryFolder folder;
  const char* before = std::getenv("PATH");
  const std::string kept = before == nullptr ? "" : before;
  ::setenv("PATH", "/nowhere", 1);
  const auto writer = FilmWriter::Make(folder / "a.mp4", 25);
  try {
    writer->Add(Plain(64, 48, 50));
    ADD_FAILURE() << "expected a Failure";
  } catch (const Failure& error) {
    EXPECT_EQ(error.code(), ExitCode::kNotFound);
    EXPECT_NE(std::string(error.what()).find("Install the package ffmpeg"), std::string::npos);
  }
  ::setenv("PATH", kept.c_str(), 1);
}

}  // namespace
}  // namespace dreamsearch
