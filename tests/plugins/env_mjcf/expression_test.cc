// The language of observations, rewards and ends: values by hand, and what is wrong with a text.
#include "plugins/env_mjcf/expression.h"

#include <gtest/gtest.h>

#include <cmath>

#include "plugins/mujoco/engine.h"
#include "plugins/mujoco/tolerance.h"
#include "tests/plugins/env_mjcf/model_files.h"

namespace dreamsearch::mjcf {
namespace {

class ExpressionTest : public testing::Test {
 protected:
  ExpressionTest()
      : model_(mujoco::CompileModel("leg", kLeg, {})), data_(mj_makeData(model_.get())) {
    data_->qpos[0] = 0.25;
    data_->qpos[1] = 0.5;
    data_->qvel[0] = -2;
    data_->qvel[1] = 3;
    data_->ctrl[1] = 0.75;
    mj_forward(model_.get(), data_.get());
  }

  double Value(const std::string& text) {
    return *ParseNumber(text, *model_)->Evaluate(*model_, *data_);
  }
  std::vector<double> Values(const std::string& text) {
    std::vector<double> values;
    for (const Named& part : ParseList(text, *model_)) {
      const double* numbers = part.expression->Evaluate(*model_, *data_);
      values.insert(values.end(), numbers, numbers + part.expression->size());
    }
    return values;
  }
  std::string Error(const std::string& text) {
    return MessageOf([&] { ParseNumber(text, *model_); });
  }

  mujoco::ModelPtr model_;
  mujoco::DataPtr data_;
};

TEST_F(ExpressionTest, ArithmeticHasItsUsualOrder) {
  EXPECT_EQ(Value("1 + 2 * 3"), 7);
  EXPECT_EQ(Value("(1 + 2) * 3"), 9);
  EXPECT_EQ(Value("8 / 4 / 2"), 1);
  EXPECT_EQ(Value("5 - 3 - 1"), 1);
  EXPECT_EQ(Value("-2 * -3"), 6);
  EXPECT_EQ(Value("1e-2 * .5"), 0.005);
}

TEST_F(ExpressionTest, QuantitiesAreTheSimulators) {
  EXPECT_EQ(Value("position(rail)"), 0.25);
  EXPECT_EQ(Value("velocity( hip )"), 3);
  EXPECT_EQ(Values("position(root)"), (std::vector<double>{3, 0, 1, 1, 0, 0, 0}));
  EXPECT_EQ(Values("velocity(ankle)"), (std::vector<double>{0, 0, 0}));
  EXPECT_EQ(Value("body(torso).z"), 2.25);
  EXPECT_EQ(Value("body(torso).zz"), data_->xmat[9 + 8]);
  EXPECT_EQ(Value("body(torso).xz"), data_->xmat[9 + 2]);
  EXPECT_EQ(Value("body('left foot').x"), data_->xpos[6]);
  EXPECT_EQ(Value("body(left foot).z"), data_->xpos[8]);
  EXPECT_EQ(Values("site(goal)"), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(Value("geom(sole).yy"), data_->geom_xmat[9 * 2 + 4]);
  EXPECT_EQ(Value("sensor(reach)"), 0.25);
  EXPECT_EQ(Value("sensor(turning)[1]"), data_->sensordata[1]);
  EXPECT_EQ(Value("control(swing)"), 0.75);
  EXPECT_EQ(Value("center_of_mass(torso).z"), data_->subtree_com[5]);
  EXPECT_NEAR(Value("linear_velocity(torso).z"), -2, 1e-12);
  EXPECT_NEAR(Value("angular_velocity(torso).y"), 3, 1e-12);
  EXPECT_EQ(Values("positions, velocities").size(),
            static_cast<std::size_t>(model_->nq + model_->nv));
  EXPECT_EQ(Values("sensors, controls, time").size(), 4u + 2u + 1u);
}

TEST_F(ExpressionTest, SeveralNumbersAreCombinedEntryByEntry) {
  EXPECT_EQ(Values("site(goal) - 1"), (std::vector<double>{0, 1, 2}));
  EXPECT_EQ(Values("2 * site(goal)"), (std::vector<double>{2, 4, 6}));
  EXPECT_EQ(Values("-site(goal)"), (std::vector<double>{-1, -2, -3}));
  EXPECT_EQ(Value("(site(goal) - body(world)).y"), 2);
  EXPECT_EQ(Value("norm(site(goal) * 2 - site(goal))"), std::sqrt(14.0));
  EXPECT_EQ(Value("distance(site(goal), body(world))"), std::sqrt(14.0));
  EXPECT_EQ(Value("mean(site(goal), 6)"), 3);
  EXPECT_EQ(Value("sum(site(goal))"), 6);
  EXPECT_EQ(Value("max(site(goal)) - min(site(goal), -1)"), 4);
  EXPECT_EQ(Value("abs(-3) + sqrt(4) + exp(0) + sin(0) + cos(0) + tanh(0)"), 7);
}

TEST_F(ExpressionTest, ToleranceIsTheSuitesWithTheBoundsThatAreGiven) {
  const double x = 0.25;
  EXPECT_EQ(Value("tolerance(position(rail), margin=1)"), mujoco::Tolerance(0, 0, 1)(x));
  EXPECT_EQ(Value("tolerance(position(rail), lower=0.5, margin=0.5)"),
            mujoco::Tolerance(0.5, 1e300, 0.5)(x));
  EXPECT_EQ(Value("tolerance(position(rail), upper=-1, margin=2, shape=linear, at_margin=0)"),
            mujoco::Tolerance(-1e300, -1, 2, mujoco::Falloff::kLinear, 0)(x));
  EXPECT_EQ(Value("tolerance(position(rail), lower = 0.2, upper = 0.3)"), 1);
  EXPECT_EQ(Value("tolerance(position(rail), lower=0.3)"), 0);
  for (const char* shape : {"gaussian", "hyperbolic", "long_tail", "reciprocal", "cosine", "linear",
                            "quadratic", "tanh_squared"}) {
    EXPECT_NEAR(Value("tolerance(3, margin=3, at_margin=0.2, shape=" + std::string(shape) + ")"),
                0.2, 1e-12);
  }
}

TEST_F(ExpressionTest, SaysWhichNameIsUnknownAndWhichThereAre) {
  EXPECT_EQ(Error("position(hipp)"),
            "the model has no joint 'hipp'; it has: rail, hip, ankle, root");
  EXPECT_EQ(Error("body(head).z"),
            "the model has no body 'head'; it has: world, torso, left foot, free");
  EXPECT_EQ(Error("sensor(reech)"), "the model has no sensor 'reech'; it has: turning, reach");
  EXPECT_EQ(Error("control(x)"), "the model has no actuator 'x'; it has: lift, swing");
  EXPECT_NE(Error("torso_height").find("unknown 'torso_height'; quantities: "), std::string::npos);
  EXPECT_NE(Error("torso_height").find("center_of_mass, control"), std::string::npos);
  EXPECT_NE(Error("tolerence(1)").find("functions: tolerance"), std::string::npos);
  EXPECT_EQ(Error("tolerance(1, shape=bell)").substr(0, 28), "no shape 'bell'; there are: ");
}

TEST_F(ExpressionTest, SaysWhatItExpectedAndWhatItFound) {
  EXPECT_EQ(Error("1 + "), "expected a number, a quantity or a function, found the end of '1 + '");
  EXPECT_EQ(Error("(1"), "expected ')', found the end of '(1'");
  EXPECT_EQ(Error("1 2"), "expected an operator or the end, found '2'");
  EXPECT_EQ(Error("tolerance(1, marg=2)"),
            "expected lower=, upper=, margin=, shape= or at_margin=, found 'marg=2)'");
  EXPECT_EQ(Error("tolerance(1, margin=wide)"), "expected a number, found 'wide)'");
  EXPECT_EQ(Error("tolerance(1, lower=2, upper=1)"), "tolerance: low must not exceed high");
  EXPECT_EQ(Error("body('torso).z"), "expected a closing quote, found 'torso).z'");
  EXPECT_EQ(Error("site(goal)"),
            "expected one number, found 3; take one of them (.x, [0]), or their mean, sum or norm");
  EXPECT_EQ(Error("site(goal) + position(root)"), "cannot combine 3 numbers with 7");
  EXPECT_EQ(Error("site(goal)[3]"), "expected an index from 0 to 2");
  EXPECT_EQ(Error("(site(goal) + 1).zz"), "'.zz' is of body(...), geom(...) or site(...)");
  EXPECT_EQ(Error("position(rail).x"), "'.x' is of a place or a direction, of 3 numbers; found 1");
  EXPECT_EQ(Error("1e999"), "expected a number, found '1e999'");
}

TEST_F(ExpressionTest, HostileTextsEndWithASentence) {
  EXPECT_NE(Error(std::string(100000, '(')).find("inside each other"), std::string::npos);
  EXPECT_NE(Error(std::string(100000, '-')).find("inside each other"), std::string::npos);
  for (const char* text : {"",
                           "(",
                           ")",
                           ",",
                           ".",
                           "[",
                           "position(",
                           "position()",
                           "position('",
                           "1.",
                           "-",
                           "*",
                           "sum()",
                           "body(torso).",
                           "body(torso)[",
                           "body(torso)[-1]",
                           "body(torso)[0.5]",
                           "tolerance()",
                           "tolerance(1,",
                           "\xff",
                           "nan",
                           "inf"}) {
    const std::string message = Error(text);
    if (std::string(text) == "1.") {
      EXPECT_EQ(message, "");
    } else {
      EXPECT_NE(message, "") << text;
    }
  }
}

TEST_F(ExpressionTest, ConditionsCompareTwoNumbers) {
  const auto holds = [&](const std::string& text) {
    return ParseConditions(text, *model_).at(0).Holds(*model_, *data_);
  };
  EXPECT_TRUE(holds("body(torso).z < 2.5"));
  EXPECT_FALSE(holds("body(torso).z > 2.5"));
  EXPECT_TRUE(holds("abs(velocity(rail)) > 1.5"));
  EXPECT_EQ(ParseConditions("1 < 2, 3 > 4", *model_).size(), 2u);
  EXPECT_TRUE(ParseConditions("", *model_).empty());
  EXPECT_EQ(MessageOf([&] { ParseConditions("position(rail)", *model_); }),
            "expected < or >, found the end of 'position(rail)'");
}

TEST_F(ExpressionTest, PartsAreCalledAsTheyAreWritten) {
  const std::vector<Named> parts = ParseList("position(rail) , body('left foot').x*2", *model_);
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].text, "position(rail)");
  EXPECT_EQ(parts[1].text, "body('left foot').x*2");
}

}  // namespace
}  // namespace dreamsearch::mjcf
