// Fields to JSON and back: every kind of member, and what is missing or of another type.
#include "results/text/json_fields.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "results/text/json_text.h"

namespace dreamsearch::results {
namespace {

enum class Colour : std::uint32_t { kRed = 1, kBlue = 7 };

struct Inner {
  std::string name;
  double number = 0;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("number", &number);
  }
};

struct Outer {
  std::vector<Inner> list;
  std::optional<Inner> maybe;
  std::shared_ptr<const Inner> shared;
  std::filesystem::path path;
  Colour colour = Colour::kRed;
  std::uint64_t large = 0;
  std::vector<std::string> texts;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("list", &list);
    (*archive)("maybe", &maybe);
    (*archive)("shared", &shared);
    (*archive)("path", &path);
    (*archive)("colour", &colour);
    (*archive)("large", &large);
    (*archive)("texts", &texts);
  }
};

Outer Some() {
  Outer some;
  some.list = {{"a", 0.1}, {"b", std::nan("")}};
  some.shared = std::make_shared<Inner>(Inner{"shared", 3});
  some.path = "/x/y";
  some.colour = Colour::kBlue;
  some.large = ~0ull;
  some.texts = {"one", ""};
  return some;
}

// Through text, as it passes between processes.
Outer There(const Outer& value) {
  return FieldsFromJson<Outer>(nlohmann::json::parse(FieldsToJson(value).dump()));
}

TEST(JsonFields, EveryMemberComesBackAsItWas) {
  Outer some = Some();
  Outer found = There(some);
  ASSERT_EQ(found.list.size(), 2u);
  EXPECT_EQ(found.list[0].number, 0.1);
  EXPECT_TRUE(std::isnan(found.list[1].number));
  EXPECT_FALSE(found.maybe);
  EXPECT_EQ(found.shared->name, "shared");
  EXPECT_EQ(found.path, some.path);
  EXPECT_EQ(found.colour, Colour::kBlue);
  EXPECT_EQ(found.large, ~0ull);
  EXPECT_EQ(found.texts, some.texts);
  some.maybe = Inner{"maybe", -1};
  found = There(some);
  ASSERT_TRUE(found.maybe);
  EXPECT_EQ(found.maybe->number, -1);
}

TEST(JsonFields, AFieldThatIsMissingOrOfAnotherTypeIsAnException) {
  nlohmann::json json = FieldsToJson(Some());
  json.erase("path");
  EXPECT_THROW(FieldsFromJson<Outer>(json), nlohmann::json::exception);
  json = FieldsToJson(Some());
  json["list"][0]["name"] = 5;
  EXPECT_THROW(FieldsFromJson<Outer>(json), nlohmann::json::exception);
  EXPECT_THROW(FieldsFromJson<Outer>(nlohmann::json::array()), nlohmann::json::exception);
}

// Whoever walks such a value calls itself for each level.
TEST(ParseJson, RefusesWhatIsNestedTooDeeply) {
  const auto nested = [](int depth) {
    return std::string(static_cast<std::size_t>(depth), '[') +
           std::string(static_cast<std::size_t>(depth), ']');
  };
  EXPECT_TRUE(ParseJson(nested(kMostJsonDepth)).is_array());
  EXPECT_THROW(ParseJson(nested(kMostJsonDepth + 1)), nlohmann::json::parse_error);
  EXPECT_TRUE(ParseJsonOrDiscard(nested(1000000)).is_discarded());
  EXPECT_THROW(ParseJson("[1e999]"), nlohmann::json::parse_error);
  // Brackets in a text are none.
  EXPECT_TRUE(ParseJson("[\"" + std::string(1000, '[') + "\\\"" + std::string(1000, '{') + "\"]")
                  .is_array());
}

}  // namespace
}  // namespace dreamsearch::results
