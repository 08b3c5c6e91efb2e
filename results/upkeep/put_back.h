// put_back.h - a database taken to another place as one file, and put back as one.
//
// Errors   Failure, as database.h says; what is put back is there whole or not at all.
#pragma once

#include <string>

namespace dreamsearch::results {

// What a database holds, in short: equal as long as nobody writes to it. Empty for a file that
// is not there.
using Fingerprint = std::string;

// Copies the database `from` to the file `to`, which is then complete by itself. Nobody writes to
// `from` meanwhile. Works also where files cannot be locked, unless a journal beside it shows that
// somebody writes. Returns what it copied; empty, with no copy, if there is no such file.
Fingerprint TakeDatabase(const std::string& from, const std::string& to);

// Copies the database `from`, to which others may be writing, in the place of `to`: under another
// name, and then renamed, so that a reader or a crash at any moment finds the old or the new.
// That is done if `to` is still what `expected` says and nobody has it open. Otherwise the runs
// are merged into it one by one (merge.h). Returns what `to` now is.
Fingerprint PutBackDatabase(const std::string& from, const std::string& to,
                            const Fingerprint& expected);

}  // namespace dreamsearch::results
