// runner watch: a sweep seen from another terminal, which it cannot disturb.
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>

#include "results/text/text.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

// `runner watch` in a terminal of its own.
class Terminal {
 public:
  Terminal(const Workplace& place, unsigned short columns, unsigned short lines = 24) {
    const winsize size = {lines, columns, 0, 0};
    pid_ = ::forkpty(&terminal_, nullptr, nullptr, &size);
    if (pid_ != 0) return;
    if (::chdir(place.folder().c_str()) != 0) ::_exit(120);
    ::setenv("TERM", "xterm", 1);
    ::setenv("LC_ALL", "C.UTF-8", 1);
    const std::string program = DREAMSEARCH_TEST_BIN_DIR "/runner";
    ::execl(program.c_str(), "runner", "watch", "--db", "m.db", nullptr);
    ::_exit(121);
  }
  ~Terminal() {
    if (pid_ > 0) ::kill(pid_, SIGKILL);
    if (pid_ > 0) ::waitpid(pid_, nullptr, 0);
    ::close(terminal_);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  void Resize(unsigned short columns) const {
    const winsize size = {24, columns, 0, 0};
    ::ioctl(terminal_, TIOCSWINSZ, &size);
  }
  void Press(const std::string& keys) const {
    EXPECT_EQ(::write(terminal_, keys.data(), keys.size()), static_cast<ssize_t>(keys.size()));
  }
  bool Echoes() const {
    termios state;
    ::tcgetattr(terminal_, &state);
    return (state.c_lflag & ECHO) != 0;
  }
  // Until what was written since the last call fits, or 20 s have passed; all of it.
  std::string Read(const std::function<bool(const std::string&)>& fits) {
    std::string text;
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
         !fits(text) && std::chrono::steady_clock::now() < end;) {
      pollfd polled{terminal_, POLLIN, 0};
      if (::poll(&polled, 1, 100) <= 0) continue;
      char buffer[4096];
      const ssize_t got = ::read(terminal_, buffer, sizeof buffer);
      if (got <= 0) break;
      text.append(buffer, static_cast<std::size_t>(got));
    }
    return text;
  }
  int End() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t pid_ = -1;
  int terminal_ = -1;
};

std::function<bool(const std::string&)> Has(const std::string& part, std::size_t times = 1) {
  return [part, times](const std::string& text) {
    std::size_t count = 0;
    for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; ++at) ++count;
    return count >= times;
  };
}

// The longest line of the last whole picture.
std::size_t WidestLine(const std::string& text) {
  const std::size_t end = text.rfind("\033[J");
  const std::size_t begin = text.rfind("\033[H", end);
  std::istringstream picture(text.substr(begin + 3, end - begin - 3));
  std::size_t widest = 0;
  for (std::string line; std::getline(picture, line);) {
    line.erase(std::remove(line.begin(), line.end(), '\r'), line.end());
    if (line.starts_with("\033[2K")) line.erase(0, 4);
    EXPECT_EQ(line.find('\033'), std::string::npos) << line;
    widest = std::max(widest, Width(line));
  }
  return widest;
}

void MakeRuns(const Workplace& place) {
  const ProgramResult result =
      place.Runner(TinyRun("cartpole_balance", "random", "m.db", {"--seeds", "2"}));
  ASSERT_EQ(result.exit_status, 0) << result.err;
}

std::string Bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

TEST(Watch, PrintsOnceWhereTheOutputIsNoTerminalAndWritesNothing) {
  const Workplace place;
  MakeRuns(place);
  const std::string before = Bytes(place.Path("m.db"));
  const ProgramResult result = place.Runner({"watch", "--db", "m.db"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(result.out.find("2 runs: 2 finished\n"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("cartpole_balance random seed 1"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("4,000 of 4,000"), std::string::npos) << result.out;
  EXPECT_EQ(result.out.find('\033'), std::string::npos) << result.out;
  EXPECT_EQ(Bytes(place.Path("m.db")), before);
}

TEST(Watch, WithoutADatabaseSaysSo) {
  const Workplace place;
  EXPECT_EQ(place.Runner({"watch", "--db", "none.db"}).exit_status, 66);
  EXPECT_EQ(place.Runner({"watch", "--folder", "."}).exit_status, 66);
}

TEST(Watch, IsRedrawnFollowsTheWidthAndEndsWithAKey) {
  const Workplace place;
  MakeRuns(place);
  for (const char* key : {"q", "\003"}) {
    Terminal terminal(place, 120);
    const std::string wide = terminal.Read(Has("\033[J", 2));
    EXPECT_NE(wide.find("\033[?1049h"), std::string::npos) << wide;
    EXPECT_NE(wide.find("█"), std::string::npos) << wide;
    EXPECT_GT(WidestLine(wide), 80u);
    EXPECT_LE(WidestLine(wide), 120u);
    EXPECT_FALSE(terminal.Echoes());
    terminal.Resize(40);
    EXPECT_EQ(WidestLine(terminal.Read(Has("\033[J", 2))), 40u);
    terminal.Press(key);
    const std::string last = terminal.Read(Has("\033[?1049l"));
    EXPECT_NE(last.find("\033[?25h\033[?1049l"), std::string::npos) << last;
    EXPECT_EQ(terminal.End(), 0);
    EXPECT_TRUE(terminal.Echoes());
  }
}

TEST(Watch, TextOfTheDatabaseCannotSteerTheTerminal) {
  const Workplace place;
  MakeRuns(place);
  place.Query("m.db",
              "update run set planner = char(27) || '[2Jred' || char(155) || '31m', error = "
              "char(27) || ']0;title' || char(7) || char(10) || 'next'");
  Terminal terminal(place, 200);
  const std::string text = terminal.Read(Has("\033[J", 2));
  EXPECT_NE(text.find("\\x1b[2Jred?31m"), std::string::npos) << text;
  EXPECT_NE(text.find("\\x1b]0;title\\x07\\nnext"), std::string::npos) << text;
  EXPECT_EQ(text.find("\033[2J"), std::string::npos);
  EXPECT_EQ(text.find("\033]"), std::string::npos);
  EXPECT_EQ(text.find("\xc2\x9b"), std::string::npos);
}

TEST(Watch, ARunThatIsWatchedIsTheSame) {
  std::vector<std::string> run = TinyRun("cartpole_balance", "random", "m.db");
  std::replace(run.begin(), run.end(), std::string("4000"), std::string("20000"));
  const auto digest = [&](bool watched) {
    const Workplace place;
    const pid_t pid = place.Start(run);
    if (watched) {
      for (int i = 0; i < 3000 && place.Value("m.db", "select 1 from segment").empty(); ++i) {
        ::usleep(10000);
      }
      Terminal terminal(place, 150);
      const std::string text = terminal.Read(Has("running"));
      EXPECT_NE(text.find("1 run: 1 running"), std::string::npos) << text;
      const std::string last = terminal.Read([](const std::string& read) {
        return Has("1 finished")(read) && Has("20,000 of 20,000")(read);
      });
      EXPECT_NE(last.find("20,000 of 20,000"), std::string::npos) << last;
    }
    EXPECT_EQ(place.Wait(pid).exit_status, 0);
    return place.Value("m.db", "select result_digest from run");
  };
  const std::string alone = digest(false);
  EXPECT_FALSE(alone.empty());
  EXPECT_EQ(digest(true), alone);
}

}  // namespace
}  // namespace dreamsearch
