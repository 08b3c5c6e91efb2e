// expression.h - what is observed, rewarded and taken for the end, as a text.
//
//   expression = number | quantity | function(...) | ( expression ) | -expression
//              | expression (+ - * /) expression | expression.x | expression[0]
//
// A value is one number or several; two of one size, or any with one number, are combined entry
// by entry. README.md lists quantities and functions.
//
// Errors   ExpressionError: what was expected, what was found, and the names that there are.
#pragma once

#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace dreamsearch::mjcf {

struct ExpressionError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Expression {
 public:
  virtual ~Expression() = default;
  explicit Expression(std::size_t size) : size_(size) {}

  std::size_t size() const { return size_; }
  // [size()] numbers, valid until the next call or until `data` changes.
  virtual const double* Evaluate(const mjModel& model, const mjData& data) = 0;

 private:
  std::size_t size_;
};
using ExpressionPtr = std::unique_ptr<Expression>;

// A part of a list, and how it is written.
struct Named {
  std::string text;
  ExpressionPtr expression;
};

// "left < right" or "left > right"; both one number.
struct Condition {
  ExpressionPtr left;
  ExpressionPtr right;
  bool less = true;

  bool Holds(const mjModel& model, const mjData& data) const;
};

// One number.
ExpressionPtr ParseNumber(const std::string& text, const mjModel& model);
// Expressions, or conditions, separated by commas; "" is an empty list.
std::vector<Named> ParseList(const std::string& text, const mjModel& model);
std::vector<Condition> ParseConditions(const std::string& text, const mjModel& model);
// The ids of actuators by name, separated by commas.
std::vector<int> ParseActuators(const std::string& text, const mjModel& model);
// The id of a keyframe.
int ParseKeyframe(const std::string& name, const mjModel& model);

}  // namespace dreamsearch::mjcf
