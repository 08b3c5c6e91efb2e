#!/usr/bin/env python3
"""The rooms of host and results: an include may reach its own room and those below.

rooms.py ROOT prints every include that climbs, every room with more than 20 files, every
file of a room that is spelled otherwise than from the root, every folder of tests that no room
has, and every file of over 400 lines whose first comment does not say why, and fails if there is
one.
"""
import pathlib
import re
import sys

# From the lowest up. Host may include every room of results but its program.
ROOMS = {
    "results": ["system", "text", "statistics", "command_line", "database", "upkeep", "analysis", "figures", "report", "program"],
    "host": ["plugins", "settings", "saving", "acting", "training", "processes", "films", "sweeps", "clusters", "flags", "commands", ""],
}
MOST_FILES = 20
MOST_LINES = 400


def long_files(root):
    for top in ("host", "results", "sdk", "plugins", "tests"):
        for path in sorted(p for p in (root / top).rglob("*") if p.suffix in (".h", ".cc", ".py")):
            text = path.read_text()
            lines = text.count("\n")
            # The first comment ends where code begins.
            first = re.split("^(?:#include|#pragma|import |from )", text, maxsplit=1,
                             flags=re.MULTILINE)[0]
            words = " ".join(first.replace("//", " ").lower().split())
            if lines > MOST_LINES and f"over {MOST_LINES} lines" not in words:
                yield (f"{path.relative_to(root)}: {lines} lines, and its first comment does not "
                       f"say why it has over {MOST_LINES}")


def faults(root):
    for side, order in ROOMS.items():
        for folder in sorted(p for p in (root / side).iterdir() if p.is_dir()):
            files = [p for p in folder.rglob("*") if p.suffix in (".h", ".cc")]
            if files and folder.name not in order:
                yield f"{folder}: no such room is known; add it to {__file__}"
            if len(files) > MOST_FILES:
                yield f"{folder}: {len(files)} files, at most {MOST_FILES} expected"
        for folder in sorted(p for p in (root / "tests" / side).iterdir() if p.is_dir()):
            if folder.name not in order:
                yield f"{folder}: tests of no room; tests are laid out like the code"
        for path in sorted(p for p in (root / side).rglob("*") if p.suffix in (".h", ".cc")):
            parts = path.relative_to(root / side).parts
            room = parts[0] if len(parts) > 1 else ""
            for number, line in enumerate(path.read_text().splitlines(), 1):
                found = re.match(r'#include "([^"]+)"', line)
                if not found:
                    continue
                where = f"{path.relative_to(root)}:{number}: {found[1]}"
                target = found[1].split("/")
                if target[0] in ("dreamsearch", "dreamsearch_build_info.h"):
                    continue
                if target[0] not in ROOMS or len(target) < 3:
                    yield f"{where} is not spelled from the root"
                elif target[0] == side:
                    if order.index(target[1]) > order.index(room):
                        yield f"{where} climbs"
                elif side == "results" or target[1] == "program":
                    yield f"{where} reaches into another house"


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    found = [*faults(root), *long_files(root)]
    print("\n".join(found) if found else "every include stays in its room or goes down")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
