// names.h - what to say to a name that nobody knows.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace dreamsearch {

// The known names that `wanted` may be a misspelling of: those whose edit
// distance (insert, delete, change, swap neighbours; case ignored) is smallest
// and at most a third of the longer name's length; if there are none, those that
// begin with `wanted`. In the order of `known`.
std::vector<std::string> NearestNames(std::string_view wanted,
                                      const std::vector<std::string>& known);

// "Known: cem, dreamer, mcts_pw. Did you mean mcts_pw?", the question only when
// something is near; "Known: none." when nothing is.
std::string KnownNames(std::string_view wanted, const std::vector<std::string>& known);

// " Did you mean mcts_pw?", to follow a sentence; empty when nothing is near.
std::string DidYouMean(std::string_view wanted, const std::vector<std::string>& known);

// "one, two, three".
std::string JoinNames(const std::vector<std::string>& names);

}  // namespace dreamsearch
