#include "results/text/web_page.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "results/system/error.h"

namespace dreamsearch {
namespace {

TEST(WebPage, MarksAreReplacedAndMarksInValuesStay) {
  EXPECT_EQ(FillTemplate("<p>{{a}}, {{b}}, {{a}}</p>", {{"a", "1"}, {"b", "{{a}}"}}),
            "<p>1, {{a}}, 1</p>");
}

TEST(WebPage, ATemplateAndValuesThatDoNotBelongTogetherAreRefused) {
  EXPECT_THROW(FillTemplate("{{a}} {{b}}", {{"a", ""}}), Failure);
  EXPECT_THROW(FillTemplate("{{a}} {{b", {{"a", ""}}), Failure);
  EXPECT_THROW(FillTemplate("{{a}}", {{"a", ""}, {"b", ""}}), Failure);
}

TEST(WebPage, ANameEndsNoElement) {
  const std::string name = "</script><b title=\"x\">&'";
  EXPECT_EQ(HtmlText(name), "&lt;/script&gt;&lt;b title=&quot;x&quot;&gt;&amp;&#39;");
  const std::string json = ScriptJson(nlohmann::json{{"name", name}});
  EXPECT_EQ(json.find('<'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(json)["name"], name);
}

}  // namespace
}  // namespace dreamsearch
