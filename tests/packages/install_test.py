#!/usr/bin/env python3
"""An installation works without the tree it was built in, and so does a plugin built against it.

install_test.py SOURCE BUILD installs into a folder with spaces, hides SOURCE, and tries. Ends with
77 where folders cannot be hidden.
"""
import gzip
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
import promises
from machine import Machine

HERE = pathlib.Path(__file__).resolve().parent


def builds_a_plugin(machine, prefix, folder):
    """find_package and dreamsearch_add_plugin, outside the tree. The plugin's path."""
    shutil.copytree(HERE / "outside/still", folder / "outside")
    machine.call("cmake", "-S", folder / "outside", "-B", folder / "outside/build",
                 "-DCMAKE_BUILD_TYPE=Release",
                 "-DCMAKE_CXX_FLAGS=-march=x86-64-v3 -D_GLIBCXX_ASSERTIONS",
                 "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", f"-DCMAKE_PREFIX_PATH={prefix}")
    machine.call("cmake", "--build", folder / "outside/build")
    plugin = folder / "outside/build/still.so"
    command = json.loads((plugin.parent / "compile_commands.json").read_text())[0]["command"]
    for flag in ("-std=c++20", "-ffp-contract=off", "-fvisibility=hidden",
                 "-fvisibility-inlines-hidden", "-fPIC"):
        assert f" {flag} " in command, f"no {flag} in: {command}"
    fused = re.findall(r"\bvfn?m(?:add|sub)\w+", machine.call("objdump", "-d", plugin))
    assert not fused, fused
    assert "SONAME" not in machine.call("readelf", "-d", plugin)
    symbols = machine.call("nm", "-D", "--defined-only", plugin)
    own = [line for line in symbols.splitlines() if " W " not in line and " V " not in line]
    assert len(own) == 1 and "dreamsearch" in own[0], symbols
    return plugin


def has_what_the_page_refers_to(machine, prefix, place):
    """Pages and experiments stand where the installed README.md links to, and run from there."""
    docs = prefix / "share/doc/dreamsearch"
    links = set(re.findall(r"\]\(([^):#]+\.(?:md|cfg))", (docs / "README.md").read_text()))
    missing = [link for link in links
               if not link.startswith(("results/", "CO", "CH")) and not (docs / link).exists()]
    assert len(links) > 15 and not missing, (len(links), missing)
    machine.call(prefix / "bin/runner", "--config", docs / "plugins/env_mjcf/example/crane.cfg",
                 "--planner", "random", "--steps", "6000", "--dry-run", cwd=place)


def refuses_another_version(machine, prefix, folder):
    """A plugin that asks for a newer release is not built against this one."""
    text = (folder / "outside/CMakeLists.txt").read_text()
    (folder / "other").mkdir()
    (folder / "other/CMakeLists.txt").write_text(text.replace("dreamsearch 0.1", "dreamsearch 9.0"))
    said = machine.call("cmake", "-S", folder / "other", "-B", folder / "other/build",
                        f"-DCMAKE_PREFIX_PATH={prefix}", expect=1)
    assert re.search(r"compatible with requested\s+version \"9\.0\"", said), said


def main():
    source, build = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    machine = Machine(hidden=source)
    if machine.missing():
        print("skipped:", machine.missing())
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        prefix = folder / "a folder/dream search"
        subprocess.run(["cmake", "--install", build, "--prefix", prefix], check=True,
                       stdout=subprocess.DEVNULL)
        assert machine.call("ls", source) == "", "the sources are in sight"
        place = folder / "a place of work"
        place.mkdir()

        promises.lists_every_plugin(machine, prefix / "bin", cwd=place)
        promises.trains_and_reads(machine, prefix / "bin", cwd=place)
        has_what_the_page_refers_to(machine, prefix, place)
        plugin = builds_a_plugin(machine, prefix, folder)
        promises.loads(machine, prefix / "bin", plugin, cwd=place)
        refuses_another_version(machine, prefix, folder)
        promises.has_man_pages(machine, prefix / "bin", lambda page: gzip.decompress(
            (prefix / f"share/man/man1/{page}.1.gz").read_bytes()).decode())
    print("an installation works without its build tree, and builds a plugin that loads")
    return 0


if __name__ == "__main__":
    sys.exit(main())
