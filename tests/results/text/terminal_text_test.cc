// Lines for a terminal fit it and cannot steer it.
#include "results/text/terminal_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "results/text/text.h"

namespace dreamsearch {
namespace {

TEST(Sparkline, RisesWithItsValuesFromLowToHigh) {
  EXPECT_EQ(Sparkline({0, 1, 2, 3, 4, 5, 6, 7, 8}, 0, 8, true), "▁▁▂▃▄▅▆▇█");
  EXPECT_EQ(Sparkline({0, 8}, 0, 8, false), "_#");
  EXPECT_EQ(Sparkline({-5, 13, NAN, 4.1}, 0, 8, false), "_# =");
  EXPECT_EQ(Sparkline({3, 3}, 3, 3, false), "--");
  EXPECT_EQ(Sparkline({}, 0, 1, true), "");
}

TEST(MeansOfColumns, EachColumnHasItsShareOfTheValues) {
  EXPECT_EQ(MeansOfColumns({1, 3, 5, 7}, 2), (std::vector<double>{2, 6}));
  EXPECT_EQ(MeansOfColumns({1, 3}, 5), (std::vector<double>{1, 3}));
  EXPECT_EQ(MeansOfColumns({1, NAN, 3, 5}, 2), (std::vector<double>{1, 4}));
  EXPECT_TRUE(std::isnan(MeansOfColumns({NAN}, 1)[0]));
  EXPECT_TRUE(MeansOfColumns({}, 3).empty());
}

TEST(OneLine, IsAsLongAsTheTerminalAndHasNoControlCharacter) {
  EXPECT_EQ(OneLine("▁▂▃▄", 2), "▁▂");
  EXPECT_EQ(OneLine("abc", 10), "abc");
  EXPECT_EQ(OneLine("a\x1b[2Jb\n", 80), "a\\x1b[2Jb\\n");
  EXPECT_EQ(OneLine("a\xc2\x9b"
                    "2Jb",
                    80),
            "a?2Jb");  // U+009B begins a sequence as ESC [ does
  EXPECT_EQ(OneLine("\xc3\xa9\xc2\xa0", 80), "\xc3\xa9\xc2\xa0");
}

TEST(TerminalHasUtf8, AsTheFirstVariableThatIsSetSays) {
  ::setenv("LC_ALL", "", 1);
  ::unsetenv("LC_CTYPE");
  ::setenv("LANG", "de_DE.UTF-8", 1);
  EXPECT_TRUE(TerminalHasUtf8());
  ::setenv("LC_CTYPE", "C.utf8", 1);
  EXPECT_TRUE(TerminalHasUtf8());
  ::setenv("LC_ALL", "C", 1);
  EXPECT_FALSE(TerminalHasUtf8());
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) ::unsetenv(name);
  EXPECT_FALSE(TerminalHasUtf8());
}

TEST(Printable, LeavesNothingThatSteersATerminal) {
  EXPECT_EQ(Printable("a\x1b[31m\x07\n"), "a\\x1b[31m\\x07\\n");
  EXPECT_EQ(Printable("a\xc2\x9b"
                      "31m"),
            "a?31m");
  EXPECT_EQ(Printable("a\xe2\x80\xae"
                      "b\xe2\x81\xa6"
                      "c"),
            "a?b?c");
  EXPECT_EQ(Printable("\xc3\xa9 \xe2\x80\x93 \xe2\x82\xac"), "\xc3\xa9 \xe2\x80\x93 \xe2\x82\xac");
  EXPECT_EQ(PrintableLines("a\x1b\nb\n"), "a\\x1b\nb\n");
  EXPECT_EQ(Printable("\xc2"), "\xc2");  // cut off
}

}  // namespace
}  // namespace dreamsearch
