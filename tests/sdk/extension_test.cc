#include "dreamsearch/extension.h"

#include <gtest/gtest.h>

#include "dreamsearch/environment.h"
#include "dreamsearch/sized.h"

namespace dreamsearch {
namespace {

class Numbered {
 public:
  static constexpr const char* kName = "tests.number/1";
  virtual int Number() noexcept = 0;

 protected:
  ~Numbered() = default;
};

class Plain : public Environment {
 public:
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t, View<double>) noexcept override { return OkStatus(); }
  Status Step(View<const double>, View<double>, StepResult*) noexcept override {
    return OkStatus();
  }
  void Destroy() noexcept override {}

 private:
  EnvironmentSpec spec_;
};

class Drawn : public Offers<Plain, Rendering> {
 public:
  Status Render(const RenderRequest&, View<std::uint8_t>) noexcept override {
    return Error(StatusCode::kInternal, "drawn");
  }
};

class Both final : public Offers<Drawn, Numbered> {
 public:
  int Number() noexcept override { return 7; }
};

TEST(Extension, NoneIsOfferedUnlessSaid) {
  Plain plain;
  EXPECT_EQ(plain.Extension(Rendering::kName), nullptr);
  EXPECT_EQ(ExtensionOf<StateSaving>(static_cast<Environment*>(&plain)), nullptr);
}

TEST(Extension, IsFoundByItsWholeNameAndCalledAsItsInterface) {
  Drawn drawn;
  Environment* environment = &drawn;
  auto* rendering = ExtensionOf<Rendering>(environment);
  ASSERT_EQ(rendering, &drawn);
  EXPECT_STREQ(rendering->Render({}, {}).message, "drawn");
  for (const char* other : {"render", "render/2", "render/10", "RENDER/1", ""}) {
    EXPECT_EQ(environment->Extension(other), nullptr) << other;
  }
}

TEST(Extension, WhatABaseOffersIsOfferedStill) {
  Both both;
  Environment* environment = &both;
  ASSERT_EQ(ExtensionOf<Numbered>(environment), &both);
  EXPECT_EQ(ExtensionOf<Numbered>(environment)->Number(), 7);
  EXPECT_EQ(ExtensionOf<Rendering>(environment), &both);
  EXPECT_EQ(ExtensionOf<StateSaving>(environment), nullptr);
}

// Of this version's own structs; versions/ has those of two.
TEST(Sized, AStructThatIsShorterHasTheDefaultOfWhatItLacks) {
  RenderRequest sent{.width = 3, .height = 4, .camera = 5};
  EXPECT_EQ(Received(sent).camera, 5u);
  sent.struct_size = 8;  // as if camera had come later
  EXPECT_EQ(Received(sent).height, 4u);
  EXPECT_EQ(Received(sent).camera, 0u);
  EXPECT_EQ(Received(sent).struct_size, sizeof sent);
  EXPECT_TRUE(Carries(sent, sent.height));
  EXPECT_FALSE(Carries(sent, sent.camera));
}

TEST(Records, StepByTheirStride) {
  struct Longer {
    ObservationPart part;
    double later;
  };
  const Longer longer[] = {{{"a", 1}, 9}, {{"b", 2}, 9}, {{"c", 3}, 9}};
  Records<ObservationPart> records(&longer[0].part, 3);
  records.stride = sizeof(Longer);
  std::string names;
  std::uint64_t sizes = 0;
  for (const ObservationPart& part : records) {
    names += part.name;
    sizes += part.size;
  }
  EXPECT_EQ(names, "abc");
  EXPECT_EQ(sizes, 6u);
  EXPECT_EQ(records.At(2).size, 3u);
  records.stride = sizeof(const char*);  // elements of a name alone
  const char* const bare[] = {"x", "y"};
  records.data = reinterpret_cast<const ObservationPart*>(bare);
  EXPECT_STREQ(records.At(1).name, "y");
  EXPECT_EQ(records.At(1).size, 0u);
}

}  // namespace
}  // namespace dreamsearch
