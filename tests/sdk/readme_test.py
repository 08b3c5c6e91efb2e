#!/usr/bin/env python3
"""sdk/README.md is true: its commands work on an installation, its code stands in the examples.

readme_test.py SOURCE BUILD installs into a folder of its own, hides SOURCE, runs every block of
shell commands in the order of the page, and looks for every other block in the file that the
comment above it names. Ends with 77 where folders cannot be hidden.
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import textwrap
import time

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "packages"))
from machine import Machine

BLOCK = re.compile(r"(?:<!-- (?P<file>\S+) -->\n)?```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.S | re.M)
MOST_SECONDS = 60  # for one `runner check` of what `runner new` wrote


def quoted_blocks_stand_in_their_files(sdk, page):
    for block in BLOCK.finditer(page):
        if block["kind"] == "sh":
            continue
        assert block["file"], f"a block of {block['kind']} says not where it stands:\n{block['text']}"
        whole = (sdk / block["file"]).read_text()
        lines = textwrap.dedent(block["text"]).strip("\n")
        indents = {len(line) - len(line.lstrip()) for line in whole.splitlines()}
        assert any(textwrap.indent(lines, " " * n) in whole for n in indents), \
            f"{block['file']} does not have\n{block['text']}"


def commands_work(machine, page, place):
    blocks = [block for block in BLOCK.finditer(page) if block["kind"] == "sh"]
    assert len(blocks) >= 5, "the page has lost its commands"
    for block in blocks:
        begin = time.monotonic()
        said = machine.call("bash", "-euo", "pipefail", "-c", block["text"], cwd=place)
        print(f"{time.monotonic() - begin:6.1f} s  {block['text'].splitlines()[0]}", flush=True)
        for line in re.findall(r"^\S+: \d+ laws kept.*$", said, re.M):
            print("          ", line)
            assert " 0 not kept" in line, said


def templates_pass_their_tests(machine, place):
    for name in ("best_guess", "my_model", "my_task"):
        begin = time.monotonic()
        machine.call("runner", "check", f"{name}/build/{name}.so", cwd=place)
        seconds = time.monotonic() - begin
        assert seconds < MOST_SECONDS, f"runner check took {seconds:.0f} s"
        machine.call("ctest", "--test-dir", f"{name}/build", "--output-on-failure", cwd=place)


def new_refuses(machine, place):
    for words, code, why in [
            (("planner", "best_guess"), 73, "found something in it"),
            (("planner", "Best"), 2, "small letters"),
            (("planner", "test"), 2, "is taken"),
            (("plan", "x"), 2, "planner, model or environment")]:
        said = machine.call("runner", "new", *words, cwd=place, expect=code)
        assert why in said, said


def main():
    source, build = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        prefix, place = folder / "dream search", folder / "work"
        place.mkdir()
        machine = Machine(hidden=source, environment={
            "PATH": f"{prefix}/bin:/usr/local/bin:/usr/bin:/bin", "PREFIX": str(prefix),
            "CMAKE_PREFIX_PATH": str(prefix)})
        if machine.missing():
            print("skipped:", machine.missing())
            return 77
        subprocess.run(["cmake", "--install", build, "--prefix", prefix], check=True,
                       stdout=subprocess.DEVNULL)
        page = (source / "sdk/README.md").read_text()
        quoted_blocks_stand_in_their_files(source / "sdk", page)
        commands_work(machine, page, place)
        templates_pass_their_tests(machine, place)
        new_refuses(machine, place)
    print("every command of sdk/README.md works on an installation")
    return 0


if __name__ == "__main__":
    sys.exit(main())
