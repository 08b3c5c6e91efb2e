// recorded_code.h - which code a recorded run may load.
//
// A run's folder names the plugins, and the programs that its settings name, by path. The folder
// may be a stranger's: unpacked beside a database, it would say what this machine loads. So code
// comes from the folders in which plugins are looked for anyway (PluginFolders) or from a folder
// that the user names with --plugin-path, and it is the file with the recorded digest. A Python
// module may be a name instead, and whatever is installed answers to one: the user names it with
// --trust-module.
#pragma once

#include <string>

#include "host/settings/run_options.h"
#include "host/settings/run_spec.h"

namespace dreamsearch {

// Lets the plugins of a recorded run be those of the trusted folders. One that is there with
// another digest is left to those who compare digests (ChangedFile).
//   kPluginRefused  a plugin lies in none of them, or a setting names a module or a program that
//                   lies neither there nor, a program, under /usr, or a module by a name that is
//                   not trusted; the message says what to name if it is to be.
//   kBadInput       a value of the run's own parameters is none that they can have; those of a
//                   component are checked where it is made.
// `who` begins the message: "run 3 of /path/x.db".
void TrustRecordedCode(const TrustedCode& trusted, const std::string& who, RunSpec* spec);

}  // namespace dreamsearch
