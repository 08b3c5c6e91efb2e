// Manual pages: what they are made of, and that every letter means itself.
#include "results/command_line/man_page.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "results/system/file.h"
#include "results/system/temporary_folder.h"

namespace dreamsearch {
namespace {

Program Cook() {
  const CommandSpec boil = {.name = "cook boil",
                            .summary = "boils an egg",
                            .examples = {"cook boil --note 'soft\\hard'"},
                            .about = "It takes ~4 minutes.\n'Soft' is ^less.",
                            .groups = {{"How", {{"note", "TEXT", {}, ".5 or `more`"}}}}};
  return {.version = "cook 1.2",
          .root = {{.name = "cook", .summary = "cooks"}, nullptr},
          .commands = {{boil, nullptr}}};
}

TEST(ManPage, SaysWhatTheHelpSaysWithExamplesLast) {
  EXPECT_EQ(ManPage(Cook(), Cook().commands[0]), R"(.TH "cook\-boil" 1 "" "cook 1.2" "User Commands"
.SH "NAME"
cook\-boil \- boils an egg
.SH "SYNOPSIS"
.nf
cook boil [flags]
.fi
.SH "DESCRIPTION"
It takes \(ti4 minutes.
.PP
\&\(aqSoft\(aq is \(haless.
.SH "HOW"
.TP
\fB\-\-note TEXT\fR
\&.5 or \(gamore\(ga
.SH "GENERAL"
.TP
\fB\-h, \-\-help\fR
show this text
.TP
\fB\-\-version\fR
show the version
.SH "EXAMPLES"
.nf
cook boil \-\-note \(aqsoft\ehard\(aq
.fi
.SH "SEE ALSO"
.BR cook (1)
)");
}

TEST(ManPage, OfTheProgramHasCommandsAndExitStatus) {
  const std::string page = ManPage(Cook());
  EXPECT_NE(page.find(".SH \"COMMANDS\"\n.TP\n\\fBboil\\fR\nboils an egg\n"), std::string::npos)
      << page;
  EXPECT_NE(page.find(".SH \"EXIT STATUS\"\n.TP\n\\fB0\\fR\n"), std::string::npos) << page;
  EXPECT_NE(page.find(".SH \"SEE ALSO\"\n.BR cook\\-boil (1)\n"), std::string::npos) << page;
}

TEST(ManPage, IsWrittenForTheProgramAndEveryCommand) {
  const TemporaryFolder folder;
  const std::string pages = folder / "man/man1";
  EXPECT_EQ(RunProgram(Cook(), {"man-pages", pages}), 0);
  EXPECT_EQ(ReadWholeFile(pages + "/cook.1"), ManPage(Cook()));
  EXPECT_EQ(ReadWholeFile(pages + "/cook-boil.1"), ManPage(Cook(), Cook().commands[0]));
}

}  // namespace
}  // namespace dreamsearch
