"""Where the programs of a package are called: this machine without a folder, or another root.

What a program finds only because the build tree is there, it does not find here.
"""
import os
import pathlib
import subprocess

SCRIPT = """
if [ -n "$SHOWN" ]; then
  kept=$(mktemp -d) && mount --bind "$SHOWN" "$kept" || exit 125
fi
if [ -n "$HIDDEN" ]; then mount -t tmpfs -o mode=755 hidden "$HIDDEN" || exit 125; fi
if [ -n "$SHOWN" ]; then
  mkdir -p "$SHOWN" && mount --move "$kept" "$SHOWN" && rmdir "$kept" || exit 125
fi
if [ -n "$ROOT" ]; then
  mount -t proc proc "$ROOT/proc" && mount --rbind /dev "$ROOT/dev" || exit 125
  exec chroot "$ROOT" /bin/sh -c 'cd "$0" && exec "$@"' "$CWD" "$@"
fi
cd "$CWD" && exec "$@"
"""


class Machine:
    """`hidden` is to whatever is called a folder with nothing in it but `shown`, a folder below it;
    `root` is its root folder. Each may be None."""

    def __init__(self, hidden=None, shown=None, root=None, environment=None):
        self.hidden, self.shown, self.root = hidden, shown, root
        self.environment = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
                            "HOME": "/root", "LANG": "C.UTF-8", "DEBIAN_FRONTEND": "noninteractive",
                            **(environment or {})}
        self.unshare = ["unshare", "--mount"]
        if os.getuid() != 0:
            self.unshare += ["--map-root-user"]
        if root:
            self.unshare += ["--pid", "--fork", "--kill-child"]

    def missing(self):
        """Why nothing can be called here; empty if it can."""
        done = self.start(["true"], "/")
        return "" if done.returncode == 0 else f"no folder can be hidden: {done.stderr.strip()}"

    def start(self, words, cwd):
        environment = {**self.environment, "HIDDEN": str(self.hidden or ""),
                       "SHOWN": str(self.shown or ""), "ROOT": str(self.root or ""), "CWD": str(cwd)}
        return subprocess.run([*self.unshare, "sh", "-c", SCRIPT, "sh", *map(str, words)],
                              env=environment, cwd="/", capture_output=True, text=True)

    def call(self, *words, cwd="/tmp", expect=0):
        """What it wrote to standard output, or to standard error where it is to fail."""
        done = self.start(words, cwd)
        if done.returncode != expect:
            raise AssertionError(f"{' '.join(map(str, words))}: expected exit {expect}, found "
                                 f"{done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
        return done.stdout if expect == 0 else done.stderr

    def path(self, inside):
        """The path, seen from outside, of a file of this machine."""
        return pathlib.Path(self.root or "/") / str(inside).lstrip("/")
