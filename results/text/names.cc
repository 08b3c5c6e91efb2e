#include "results/text/names.h"

#include <algorithm>
#include <cstddef>

#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::string LowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return lower;
}

// Damerau's distance in its restricted form (optimal string alignment).
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), previous(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) previous[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = previous[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({previous[j] + 1, row[j - 1] + 1, change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    before.swap(previous);
    previous.swap(row);
  }
  return previous[b.size()];
}

// Nothing a person types is longer; the distance costs the product of the sizes.
constexpr std::size_t kLongestName = 100;

}  // namespace

std::vector<std::string> NearestNames(std::string_view wanted,
                                      const std::vector<std::string>& known) {
  if (wanted.empty() || wanted.size() > kLongestName) return {};
  const std::string lower = LowerCase(wanted);
  std::vector<std::string> nearest;
  std::size_t best = kLongestName;
  for (const std::string& name : known) {
    if (name.size() > kLongestName) continue;
    const std::size_t distance = EditDistance(lower, LowerCase(name));
    if (3 * distance > std::max(lower.size(), name.size()) || distance > best) continue;
    if (distance < best) nearest.clear();
    best = distance;
    nearest.push_back(name);
  }
  if (!nearest.empty()) return nearest;
  for (const std::string& name : known) {
    if (LowerCase(name).starts_with(lower)) nearest.push_back(name);
  }
  return nearest;
}

std::string JoinNames(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) {
    if (!joined.empty()) joined += ", ";
    joined += name;
  }
  return joined;
}

std::string DidYouMean(std::string_view wanted, const std::vector<std::string>& known) {
  const std::vector<std::string> nearest = NearestNames(wanted, known);
  if (nearest.empty()) return "";
  std::string text = " Did you mean ";
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    if (i > 0) text += i + 1 == nearest.size() ? " or " : ", ";
    text += Printable(nearest[i]);
  }
  return text + "?";
}

std::string KnownNames(std::string_view wanted, const std::vector<std::string>& known) {
  if (known.empty()) return "Known: none.";
  std::vector<std::string> printable;
  for (const std::string& name : known) printable.push_back(Printable(name));
  return "Known: " + JoinNames(printable) + "." + DidYouMean(wanted, known);
}

}  // namespace dreamsearch
