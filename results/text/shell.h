// shell.h - command lines in messages, which people paste, and what their words may be.
#pragma once

#include <string>
#include <vector>

namespace dreamsearch {

// The text as one word of a shell's command line, quoted where that is needed: whoever pastes it
// gives the program this text. Bytes that are not printable are written as in $'\n'.
std::string ShellWord(const std::string& text);
// The words of a command line that can be pasted.
std::string ShellCommand(const std::vector<std::string>& words);
// The same of a list of words in JSON, which is what a run keeps of its command. Whatever else
// the text is comes back printable.
std::string ShellCommandOf(const std::string& json);
// "`results list --db 'my dir/y.db'`": the command on this database, for a message.
std::string CommandOn(const std::string& command, const std::string& database);
// Whether JSON and the database can hold the text.
bool IsUtf8(const std::string& text);

}  // namespace dreamsearch
