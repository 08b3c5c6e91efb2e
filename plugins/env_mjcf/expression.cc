// Over 400 lines: nodes and parser of one small language; apart, each would be read with the
// other open.
#include "plugins/env_mjcf/expression.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string_view>

#include "plugins/mujoco/tolerance.h"

namespace dreamsearch::mjcf {
namespace {

using mujoco::Falloff;
using mujoco::Tolerance;

constexpr int kMostNesting = 100;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// --- nodes -----------------------------------------------------------------------

class Constant final : public Expression {
 public:
  explicit Constant(double value) : Expression(1), value_(value) {}
  const double* Evaluate(const mjModel&, const mjData&) override { return &value_; }
  double value() const { return value_; }

 private:
  double value_;
};

// Numbers that lie in mjData one after the other.
class Quantity : public Expression {
 public:
  using Place = std::function<const double*(const mjData&)>;
  Quantity(std::size_t size, Place place) : Expression(size), place_(std::move(place)) {}
  const double* Evaluate(const mjModel&, const mjData& data) override { return place_(data); }

 private:
  Place place_;
};

// Where a body, a geom or a site is; its rotation matrix is had by .xx to .zz.
class Location final : public Quantity {
 public:
  Location(Place position, Place matrix)
      : Quantity(3, std::move(position)), matrix_(std::move(matrix)) {}
  ExpressionPtr MatrixEntry(std::size_t index) const {
    const Place matrix = matrix_;
    return std::make_unique<Quantity>(1, [=](const mjData& data) { return matrix(data) + index; });
  }

 private:
  Place matrix_;
};

// A body's velocity at its frame, in the world's axes.
class BodyVelocity final : public Expression {
 public:
  BodyVelocity(int body, bool angular) : Expression(3), body_(body), angular_(angular) {}
  const double* Evaluate(const mjModel& model, const mjData& data) override {
    mj_objectVelocity(&model, &data, mjOBJ_XBODY, body_, both_, 0);
    return both_ + (angular_ ? 0 : 3);
  }

 private:
  int body_;
  bool angular_;
  double both_[6] = {};
};

class Component final : public Expression {
 public:
  Component(ExpressionPtr of, std::size_t index)
      : Expression(1), of_(std::move(of)), index_(index) {}
  const double* Evaluate(const mjModel& model, const mjData& data) override {
    return of_->Evaluate(model, data) + index_;
  }

 private:
  ExpressionPtr of_;
  std::size_t index_;
};

class EntryByEntry final : public Expression {
 public:
  using Function = std::function<double(double)>;
  EntryByEntry(ExpressionPtr of, Function function)
      : Expression(of->size()), of_(std::move(of)), function_(std::move(function)), out_(size()) {}
  const double* Evaluate(const mjModel& model, const mjData& data) override {
    const double* in = of_->Evaluate(model, data);
    std::transform(in, in + size(), out_.begin(), function_);
    return out_.data();
  }

 private:
  ExpressionPtr of_;
  Function function_;
  std::vector<double> out_;
};

class Pairwise final : public Expression {
 public:
  using Function = double (*)(double, double);
  Pairwise(ExpressionPtr left, ExpressionPtr right, Function function)
      : Expression(std::max(left->size(), right->size())),
        left_(std::move(left)),
        right_(std::move(right)),
        function_(function),
        out_(size()) {}
  const double* Evaluate(const mjModel& model, const mjData& data) override {
    const double* left = left_->Evaluate(model, data);
    const double* right = right_->Evaluate(model, data);
    for (std::size_t i = 0; i < size(); ++i) {
      out_[i] = function_(left[left_->size() == 1 ? 0 : i], right[right_->size() == 1 ? 0 : i]);
    }
    return out_.data();
  }

 private:
  ExpressionPtr left_;
  ExpressionPtr right_;
  Function function_;
  std::vector<double> out_;
};

// Of all entries of all arguments one number.
class Summary final : public Expression {
 public:
  using Function = double (*)(const std::vector<double>&);
  Summary(std::vector<ExpressionPtr> of, Function function)
      : Expression(1), of_(std::move(of)), function_(function) {}
  const double* Evaluate(const mjModel& model, const mjData& data) override {
    entries_.clear();
    for (const ExpressionPtr& part : of_) {
      const double* values = part->Evaluate(model, data);
      entries_.insert(entries_.end(), values, values + part->size());
    }
    out_ = function_(entries_);
    return &out_;
  }

 private:
  std::vector<ExpressionPtr> of_;
  Function function_;
  std::vector<double> entries_;
  double out_ = 0;
};

double Sum(const std::vector<double>& entries) {
  double sum = 0;
  for (const double entry : entries) sum += entry;
  return sum;
}
double Norm(const std::vector<double>& entries) {
  double squares = 0;
  for (const double entry : entries) squares += entry * entry;
  return std::sqrt(squares);
}

const std::map<std::string, Summary::Function, std::less<>> kSummaries = {
    {"sum", Sum},
    {"mean",
     [](const auto& entries) { return Sum(entries) / static_cast<double>(entries.size()); }},
    {"min", [](const auto& entries) { return *std::min_element(entries.begin(), entries.end()); }},
    {"max", [](const auto& entries) { return *std::max_element(entries.begin(), entries.end()); }},
    {"norm", Norm},
};

const std::map<std::string, double (*)(double), std::less<>> kFunctions = {
    {"abs", [](double x) { return std::abs(x); }}, {"sqrt", [](double x) { return std::sqrt(x); }},
    {"exp", [](double x) { return std::exp(x); }}, {"sin", [](double x) { return std::sin(x); }},
    {"cos", [](double x) { return std::cos(x); }}, {"tanh", [](double x) { return std::tanh(x); }},
};

const std::map<std::string, Falloff, std::less<>> kShapes = {
    {"gaussian", Falloff::kGaussian},   {"hyperbolic", Falloff::kHyperbolic},
    {"long_tail", Falloff::kLongTail},  {"reciprocal", Falloff::kReciprocal},
    {"cosine", Falloff::kCosine},       {"linear", Falloff::kLinear},
    {"quadratic", Falloff::kQuadratic}, {"tanh_squared", Falloff::kTanhSquared},
};

// --- names -----------------------------------------------------------------------

std::string Listed(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 30;
  std::string text;
  for (std::size_t i = 0; i < names.size() && i < kMost; ++i) {
    text += (i == 0 ? "" : ", ") + names[i];
  }
  return names.size() > kMost ? text + ", ..." : text;
}

template <typename Map>
std::string Keys(const Map& map) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : map) keys.push_back(key);
  return Listed(keys);
}

// The id of a named object. `kind` is what people call it.
int Find(const mjModel& model, mjtObj type, int count, const char* kind, const std::string& name) {
  const int id = mj_name2id(&model, type, name.c_str());
  if (id >= 0) return id;
  std::vector<std::string> known;
  for (int i = 0; i < count; ++i) {
    const char* other = mj_id2name(&model, type, i);
    if (other != nullptr && *other != '\0') known.emplace_back(other);
  }
  throw ExpressionError(
      "the model has no " + std::string(kind) + " '" + name + "'" +
      (known.empty() ? "; it has none with a name" : "; it has: " + Listed(known)));
}

int FindBody(const mjModel& m, const std::string& name) {
  return Find(m, mjOBJ_BODY, m.nbody, "body", name);
}
int FindActuator(const mjModel& m, const std::string& name) {
  return Find(m, mjOBJ_ACTUATOR, m.nu, "actuator", name);
}

std::size_t PositionSize(int joint_type) {
  return joint_type == mjJNT_FREE ? 7 : joint_type == mjJNT_BALL ? 4 : 1;
}
std::size_t VelocitySize(int joint_type) {
  return joint_type == mjJNT_FREE ? 6 : joint_type == mjJNT_BALL ? 3 : 1;
}

ExpressionPtr At(std::size_t size, std::size_t offset, double* mjData::*array) {
  return std::make_unique<Quantity>(
      size, [=](const mjData& data) -> const double* { return data.*array + offset; });
}
ExpressionPtr Placed(int id, double* mjData::*position, double* mjData::*matrix) {
  const auto offset = static_cast<std::size_t>(id);
  return std::make_unique<Location>(
      [=](const mjData& data) -> const double* { return data.*position + 3 * offset; },
      [=](const mjData& data) -> const double* { return data.*matrix + 9 * offset; });
}

std::size_t Size(int n) { return static_cast<std::size_t>(n); }

// Quantities that take a name, and those that take none.
using OfName = ExpressionPtr (*)(const mjModel&, const std::string&);
const std::map<std::string, OfName, std::less<>> kNamed = {
    {"position",
     [](const mjModel& m, const std::string& name) {
       const int id = Find(m, mjOBJ_JOINT, m.njnt, "joint", name);
       return At(PositionSize(m.jnt_type[id]), Size(m.jnt_qposadr[id]), &mjData::qpos);
     }},
    {"velocity",
     [](const mjModel& m, const std::string& name) {
       const int id = Find(m, mjOBJ_JOINT, m.njnt, "joint", name);
       return At(VelocitySize(m.jnt_type[id]), Size(m.jnt_dofadr[id]), &mjData::qvel);
     }},
    {"sensor",
     [](const mjModel& m, const std::string& name) {
       const int id = Find(m, mjOBJ_SENSOR, m.nsensor, "sensor", name);
       return At(Size(m.sensor_dim[id]), Size(m.sensor_adr[id]), &mjData::sensordata);
     }},
    {"body",
     [](const mjModel& m, const std::string& name) {
       return Placed(FindBody(m, name), &mjData::xpos, &mjData::xmat);
     }},
    {"geom",
     [](const mjModel& m, const std::string& name) {
       return Placed(Find(m, mjOBJ_GEOM, m.ngeom, "geom", name), &mjData::geom_xpos,
                     &mjData::geom_xmat);
     }},
    {"site",
     [](const mjModel& m, const std::string& name) {
       return Placed(Find(m, mjOBJ_SITE, m.nsite, "site", name), &mjData::site_xpos,
                     &mjData::site_xmat);
     }},
    {"center_of_mass",
     [](const mjModel& m, const std::string& name) {
       return At(3, 3 * Size(FindBody(m, name)), &mjData::subtree_com);
     }},
    {"linear_velocity",
     [](const mjModel& m, const std::string& name) -> ExpressionPtr {
       return std::make_unique<BodyVelocity>(FindBody(m, name), false);
     }},
    {"angular_velocity",
     [](const mjModel& m, const std::string& name) -> ExpressionPtr {
       return std::make_unique<BodyVelocity>(FindBody(m, name), true);
     }},
    {"control",
     [](const mjModel& m, const std::string& name) {
       return At(1, Size(FindActuator(m, name)), &mjData::ctrl);
     }},
};

using OfModel = ExpressionPtr (*)(const mjModel&);
const std::map<std::string, OfModel, std::less<>> kWhole = {
    {"positions", [](const mjModel& m) { return At(Size(m.nq), 0, &mjData::qpos); }},
    {"velocities", [](const mjModel& m) { return At(Size(m.nv), 0, &mjData::qvel); }},
    {"sensors", [](const mjModel& m) { return At(Size(m.nsensordata), 0, &mjData::sensordata); }},
    {"controls", [](const mjModel& m) { return At(Size(m.nu), 0, &mjData::ctrl); }},
    {"time",
     [](const mjModel&) -> ExpressionPtr {
       return std::make_unique<Quantity>(
           1, [](const mjData& data) -> const double* { return &data.time; });
     }},
};

// --- parser ----------------------------------------------------------------------

bool IsLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsDigit(char c) { return c >= '0' && c <= '9'; }

class Parser {
 public:
  Parser(const std::string& text, const mjModel& model) : text_(text), model_(model) {}

  bool AtEnd() {
    SkipSpace();
    return at_ == text_.size();
  }
  std::size_t at() const { return at_; }

  bool Take(char c) {
    SkipSpace();
    if (at_ == text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void Expect(char c) {
    if (!Take(c)) Fail(std::string("'") + c + "'");
  }
  [[noreturn]] void Fail(const std::string& expected) {
    SkipSpace();
    const std::string rest = text_.substr(at_, 40);
    throw ExpressionError("expected " + expected + ", found " +
                          (rest.empty() ? "the end of '" + text_ + "'" : "'" + rest + "'"));
  }

  ExpressionPtr Sum() {
    ExpressionPtr left = Product();
    while (true) {
      if (Take('+')) {
        left = Join(std::move(left), Product(), [](double a, double b) { return a + b; });
      } else if (Take('-')) {
        left = Join(std::move(left), Product(), [](double a, double b) { return a - b; });
      } else {
        return left;
      }
    }
  }

  // A name as the model has it: in quotes, or up to a comma or a closing bracket.
  std::string Name() {
    SkipSpace();
    if (at_ < text_.size() && (text_[at_] == '\'' || text_[at_] == '"')) {
      const char quote = text_[at_++];
      const std::size_t end = text_.find(quote, at_);
      if (end == std::string::npos) Fail("a closing quote");
      std::string name = text_.substr(at_, end - at_);
      at_ = end + 1;
      return name;
    }
    const std::size_t begin = at_;
    while (at_ < text_.size() && std::string_view(",()'\"").find(text_[at_]) == std::string::npos) {
      ++at_;
    }
    std::size_t end = at_;
    while (end > begin && text_[end - 1] == ' ') --end;
    if (end == begin) Fail("a name");
    return text_.substr(begin, end - begin);
  }

 private:
  void SkipSpace() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) ++at_;
  }

  ExpressionPtr Product() {
    ExpressionPtr left = Factor();
    while (true) {
      if (Take('*')) {
        left = Join(std::move(left), Factor(), [](double a, double b) { return a * b; });
      } else if (Take('/')) {
        left = Join(std::move(left), Factor(), [](double a, double b) { return a / b; });
      } else {
        return left;
      }
    }
  }

  ExpressionPtr Factor() {
    if (++nesting_ > kMostNesting) {
      throw ExpressionError("expected at most " + std::to_string(kMostNesting) +
                            " expressions inside each other");
    }
    ExpressionPtr value;
    if (Take('-')) {
      value = std::make_unique<EntryByEntry>(Factor(), [](double x) { return -x; });
    } else {
      value = Primary();
      while (true) {
        if (Take('.')) {
          value = Field(std::move(value));
        } else if (Take('[')) {
          value = Index(std::move(value));
          Expect(']');
        } else {
          break;
        }
      }
    }
    --nesting_;
    return value;
  }

  ExpressionPtr Primary() {
    SkipSpace();
    if (Take('(')) {
      ExpressionPtr inner = Sum();
      Expect(')');
      return inner;
    }
    if (at_ < text_.size() && (IsDigit(text_[at_]) || text_[at_] == '.')) {
      return std::make_unique<Constant>(Number());
    }
    if (at_ == text_.size() || !IsLetter(text_[at_])) Fail("a number, a quantity or a function");
    const std::size_t begin = at_;
    const std::string word = Word();
    if (const auto whole = kWhole.find(word); whole != kWhole.end()) {
      return WithEntries(word, whole->second(model_));
    }
    if (const auto named = kNamed.find(word); named != kNamed.end()) {
      Expect('(');
      const std::string name = Name();
      Expect(')');
      return named->second(model_, name);
    }
    if (word == "tolerance") return SoftIndicator();
    if (word == "distance") {
      Expect('(');
      ExpressionPtr left = Sum();
      Expect(',');
      std::vector<ExpressionPtr> apart;
      apart.push_back(Join(std::move(left), Sum(), [](double a, double b) { return a - b; }));
      Expect(')');
      return std::make_unique<Summary>(std::move(apart), Norm);
    }
    if (const auto function = kFunctions.find(word); function != kFunctions.end()) {
      Expect('(');
      ExpressionPtr argument = Sum();
      Expect(')');
      return std::make_unique<EntryByEntry>(std::move(argument), function->second);
    }
    if (const auto summary = kSummaries.find(word); summary != kSummaries.end()) {
      Expect('(');
      std::vector<ExpressionPtr> arguments;
      do arguments.push_back(Sum());
      while (Take(','));
      Expect(')');
      return std::make_unique<Summary>(std::move(arguments), summary->second);
    }
    at_ = begin;
    throw ExpressionError("unknown '" + word + "'; quantities: " + Keys(kNamed) + ", " +
                          Keys(kWhole) + "; functions: tolerance, distance, " + Keys(kFunctions) +
                          ", " + Keys(kSummaries));
  }

  ExpressionPtr WithEntries(const std::string& word, ExpressionPtr value) const {
    if (value->size() == 0) throw ExpressionError("the model has no " + word);
    return value;
  }

  // tolerance(x, lower=, upper=, margin=, shape=, at_margin=)
  ExpressionPtr SoftIndicator() {
    Expect('(');
    ExpressionPtr argument = Sum();
    std::optional<double> lower, upper;
    double margin = 0, at_margin = 0.1;
    Falloff shape = Falloff::kGaussian;
    while (Take(',')) {
      SkipSpace();
      const std::size_t begin = at_;
      const std::string key = Word();
      if (key == "shape") {
        Expect('=');
        SkipSpace();
        const std::string name = Word();
        const auto known = kShapes.find(name);
        if (known == kShapes.end()) {
          throw ExpressionError("no shape '" + name + "'; there are: " + Keys(kShapes));
        }
        shape = known->second;
      } else if (key == "lower" || key == "upper" || key == "margin" || key == "at_margin") {
        Expect('=');
        const double number = SignedNumber();
        if (key == "lower") lower = number;
        if (key == "upper") upper = number;
        if (key == "margin") margin = number;
        if (key == "at_margin") at_margin = number;
      } else {
        at_ = begin;
        Fail("lower=, upper=, margin=, shape= or at_margin=");
      }
    }
    Expect(')');
    // Without bounds the indicator is of 0.
    const bool none = !lower && !upper;
    try {
      const Tolerance tolerance(none ? 0 : lower.value_or(-kInfinity),
                                none ? 0 : upper.value_or(kInfinity), margin, shape, at_margin);
      return std::make_unique<EntryByEntry>(std::move(argument),
                                            [=](double x) { return tolerance(x); });
    } catch (const std::invalid_argument& error) {
      throw ExpressionError(error.what());
    }
  }

  ExpressionPtr Field(ExpressionPtr value) {
    const std::string field = Word();
    constexpr std::string_view axes = "xyz";
    const auto axis = [&](std::size_t i) { return axes.find(field[i]); };
    if (field.size() == 1 && axis(0) != std::string::npos) {
      if (value->size() != 3) {
        throw ExpressionError("'." + field +
                              "' is of a place or a direction, of 3 numbers; found " +
                              std::to_string(value->size()));
      }
      return std::make_unique<Component>(std::move(value), axis(0));
    }
    const auto* location = dynamic_cast<const Location*>(value.get());
    if (field.size() == 2 && axis(0) != std::string::npos && axis(1) != std::string::npos) {
      if (location == nullptr) {
        throw ExpressionError("'." + field + "' is of body(...), geom(...) or site(...)");
      }
      return location->MatrixEntry(3 * axis(0) + axis(1));
    }
    throw ExpressionError("no '." + field +
                          "'; there are .x, .y, .z and, of body, geom and site, "
                          ".xx to .zz");
  }

  ExpressionPtr Index(ExpressionPtr value) {
    const double index = Number();
    if (index != std::floor(index) || index >= static_cast<double>(value->size())) {
      throw ExpressionError("expected an index from 0 to " + std::to_string(value->size() - 1));
    }
    return std::make_unique<Component>(std::move(value), static_cast<std::size_t>(index));
  }

  static ExpressionPtr Join(ExpressionPtr left, ExpressionPtr right, Pairwise::Function function) {
    if (left->size() != right->size() && left->size() != 1 && right->size() != 1) {
      throw ExpressionError("cannot combine " + std::to_string(left->size()) + " numbers with " +
                            std::to_string(right->size()));
    }
    return std::make_unique<Pairwise>(std::move(left), std::move(right), function);
  }

  std::string Word() {
    const std::size_t begin = at_;
    while (at_ < text_.size() && (IsLetter(text_[at_]) || IsDigit(text_[at_]))) ++at_;
    if (at_ == begin) Fail("a word");
    return text_.substr(begin, at_ - begin);
  }

  double Number() {
    SkipSpace();
    double number = 0;
    const char* begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), number);
    if (error != std::errc() || !std::isfinite(number) || *begin == '-') Fail("a number");
    at_ += static_cast<std::size_t>(end - begin);
    return number;
  }
  double SignedNumber() { return Take('-') ? -Number() : Number(); }

  const std::string text_;
  const mjModel& model_;
  std::size_t at_ = 0;
  int nesting_ = 0;
};

ExpressionPtr OneNumber(ExpressionPtr value) {
  if (value->size() == 1) return value;
  throw ExpressionError("expected one number, found " + std::to_string(value->size()) +
                        "; take one of them (.x, [0]), or their mean, sum or norm");
}

}  // namespace

bool Condition::Holds(const mjModel& model, const mjData& data) const {
  const double a = *left->Evaluate(model, data);
  const double b = *right->Evaluate(model, data);
  return less ? a < b : a > b;
}

ExpressionPtr ParseNumber(const std::string& text, const mjModel& model) {
  Parser parser(text, model);
  ExpressionPtr value = parser.Sum();
  if (!parser.AtEnd()) parser.Fail("an operator or the end");
  return OneNumber(std::move(value));
}

std::vector<Named> ParseList(const std::string& text, const mjModel& model) {
  Parser parser(text, model);
  std::vector<Named> list;
  if (parser.AtEnd()) return list;
  do {
    parser.AtEnd();  // passes over blanks
    const std::size_t begin = parser.at();
    ExpressionPtr value = parser.Sum();
    std::string written = text.substr(begin, parser.at() - begin);
    while (written.ends_with(' ')) written.pop_back();
    list.push_back({std::move(written), std::move(value)});
  } while (parser.Take(','));
  if (!parser.AtEnd()) parser.Fail("an operator, a comma or the end");
  return list;
}

std::vector<Condition> ParseConditions(const std::string& text, const mjModel& model) {
  Parser parser(text, model);
  std::vector<Condition> list;
  if (parser.AtEnd()) return list;
  do {
    Condition condition;
    condition.left = OneNumber(parser.Sum());
    condition.less = parser.Take('<');
    if (!condition.less && !parser.Take('>')) parser.Fail("< or >");
    condition.right = OneNumber(parser.Sum());
    list.push_back(std::move(condition));
  } while (parser.Take(','));
  if (!parser.AtEnd()) parser.Fail("an operator, a comma or the end");
  return list;
}

std::vector<int> ParseActuators(const std::string& text, const mjModel& model) {
  Parser parser(text, model);
  std::vector<int> ids;
  if (parser.AtEnd()) return ids;
  do {
    const int id = FindActuator(model, parser.Name());
    if (std::find(ids.begin(), ids.end(), id) != ids.end()) {
      throw ExpressionError(std::string("actuator '") + mj_id2name(&model, mjOBJ_ACTUATOR, id) +
                            "' is named twice");
    }
    ids.push_back(id);
  } while (parser.Take(','));
  if (!parser.AtEnd()) parser.Fail("a comma or the end");
  return ids;
}

int ParseKeyframe(const std::string& name, const mjModel& model) {
  return Find(model, mjOBJ_KEY, model.nkey, "keyframe", name);
}

}  // namespace dreamsearch::mjcf
