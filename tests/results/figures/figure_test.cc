#include "results/figures/figure.h"

#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <tuple>

#include "results/system/file.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

// Texts of an SVG picture that are anchored at their left, and where they end, in
// pixels; a letter is taken to be 7.2 wide.
std::vector<std::pair<std::string, double>> LeftTexts(const std::string& svg) {
  const std::regex form(
      R"re(translate\(([0-9.]+),[^>]*text-anchor="start">\s*<text>([^<]*)</text>)re");
  std::vector<std::pair<std::string, double>> texts;
  for (std::sregex_iterator it(svg.begin(), svg.end(), form), none; it != none; ++it) {
    const std::string text = (*it)[2];
    texts.emplace_back(text, std::stod((*it)[1]) + 7.2 * static_cast<double>(text.size()));
  }
  return texts;
}

TEST(Figure, LongLegendEntriesAreWrappedAndLoseNothing) {
  Figure figure;
  figure.panels.push_back({.title = "t", .series = {{.x = {0, 1}, .y = {0, 1}}}});
  const std::string shared =
      "mcts_pw model.parameters.entropy_scale=0.003 model.parameters.slow_critic_weight=1.0 ";
  const std::string word(150, 'w');
  figure.legend = {{.text = shared + "run.train_every=2 (n = 3)", .style = 0},
                   {.text = shared + "run.train_every=3 (n = 3)", .style = 1},
                   {.text = word, .style = 2}};
  const std::string svg = DrawSvg(figure);
  double width = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("<svg"), "<svg width=\"%lf\"", &width), 1)
      << svg.substr(0, 300);
  std::string all;
  for (const auto& [text, right] : LeftTexts(svg)) {
    EXPECT_LE(right, width) << text;
    all += text + (text.find('w') == 0 ? "" : " ");
  }
  for (const LegendEntry& entry : figure.legend) {
    EXPECT_NE(all.find(entry.text), std::string::npos) << all;
  }
}

TEST(Figure, LongNamesBesideAnAxisAreWrapped) {
  Figure figure;
  figure.panels.push_back(
      {.title = "t",
       .series = {
           {.mark = Series::Mark::kInterval, .x = {0.5}, .y = {0}, .lo = {0.4}, .hi = {0.6}}}});
  std::string name = "mcts_pw";
  for (int i = 0; i < 6; ++i) name += " model.parameters.setting_" + std::to_string(i) + "=1.0";
  figure.panels[0].categories = {name};
  const std::string svg = DrawSvg(figure);
  double width = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("<svg"), "<svg width=\"%lf\"", &width), 1);
  EXPECT_LT(width, 800);
  EXPECT_NE(svg.find("setting_5=1.0"), std::string::npos);
  // Below bars a number stands for it.
  figure.panels[0].series[0].mark = Series::Mark::kBar;
  figure.panels[0].series[0].x = {0};
  const std::string bars = DrawSvg(figure);
  EXPECT_NE(bars.find("<text>1</text>"), std::string::npos);
  EXPECT_NE(bars.find("<text>1: mcts_pw model."), std::string::npos);
}

TEST(Figure, FortyLinesHaveFortyStyles) {
  std::set<std::tuple<std::string, std::string, Marker>> styles;
  for (int i = 0; i < 40; ++i) {
    const Style style = StyleOf(i);
    styles.emplace(style.colour, style.dash, style.marker);
  }
  EXPECT_EQ(styles.size(), 40u);
}

// gnuplot itself draws the upper edge of such a band wrongly.
TEST(Figure, ABandThatGoesOnBeyondTheAxisIsCutAtItsEnd) {
  Figure figure;
  figure.x_high = 5;
  figure.y_high = 10;
  figure.panels.push_back(
      {.title = "t",
       .series = {
           {.mark = Series::Mark::kBand, .x = {0, 4, 10}, .lo = {0, 1, 4}, .hi = {2, 4, 10}}}});
  const std::string beyond = DrawSvg(figure);
  Series& band = figure.panels[0].series[0];
  band.x[2] = 5;
  band.lo[2] = 1.5;
  band.hi[2] = 5;
  EXPECT_EQ(beyond, DrawSvg(figure));
}

// U+10FFFD is of no font.
TEST(Figure, ALetterThatNoFontHasIsReplacedByTheSignForIt) {
  const TemporaryFolder folder;
  Figure figure;
  figure.panels.push_back({.title = "t", .series = {{.x = {0, 1}, .y = {0, 1}}}});
  figure.title = "a \xF4\x8F\xBF\xBD b \xFF";
  Draw(figure, folder / "a.png");
  figure.title = "a \xEF\xBF\xBD b \xEF\xBF\xBD";
  Draw(figure, folder / "b.png");
  EXPECT_EQ(ReadWholeFile(folder / "a.png"), ReadWholeFile(folder / "b.png"));
  figure.title = "first line\nsecond line";
  const std::string svg = DrawSvg(figure);
  EXPECT_NE(svg.find(">first line<"), std::string::npos);
  EXPECT_NE(svg.find(">second line<"), std::string::npos);
}

}  // namespace
}  // namespace dreamsearch::results
