#!/usr/bin/env python3
"""Each package does what it promises on a fresh machine.

packages_test.py FOLDER [deb] [tarball] [wheel] tries the packages that `cpack` and build_wheel.sh
have put into FOLDER, each where nothing of the sources and the build is: in a minimal Debian 12, in
a minimal Debian 13, in a new virtual environment. tests/packages/run.sh makes them first. Ends with
77 if something could not be tried here, and says what.
"""
import gzip
import hashlib
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
import promises
from machine import Machine
from roots import Unavailable, fresh

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parents[1]
GLIBC = (2, 36)
INSTALL = ["apt-get", "install", "-qq", "--no-install-recommends"]
# What a package leaves to the system.
OF_THE_SYSTEM = r"lib(c|m|dl|rt|pthread|resolv|util|stdc\+\+|gcc_s)\.so|ld-linux"


def only(folder, pattern):
    found = sorted(folder.glob(pattern))
    assert len(found) == 1, f"expected one {pattern} in {folder}, found {len(found)}"
    return found[0]


def unpacked_man_page(folder):
    return lambda page: gzip.decompress((folder / f"{page}.1.gz").read_bytes()).decode()


def says(machine, program, place, sentence):
    """The command fails, and not as a defect."""
    done = machine.start(program, place)
    assert done.returncode not in (0, 70), (program, done.returncode, done.stderr)
    assert sentence in done.stderr, (program, done.stderr)


def says_which_package_is_missing(machine, programs, place):
    """Without gnuplot and GL; the database of trains_and_reads is there."""
    says(machine, [f"{programs}/results", "curves", "--out", "curves.png"], place,
         "Install the package gnuplot-nox")
    says(machine, [f"{programs}/runner", "render", "1", "--out", "film.png"], place,
         "install the packages libegl1 and libgl1-mesa-dri")


def draws_and_films(machine, programs, place):
    """With what those sentences ask for, and no more."""
    machine.call(*INSTALL, "libegl1", "libgl1-mesa-dri")
    film = [f"{programs}/runner", "render", "1", "--out", "film.mp4"]
    says(machine, film, place, "Install the package ffmpeg")
    machine.call(*INSTALL, "ffmpeg", "gnuplot-nox")
    machine.call(*film, cwd=place)
    machine.call(f"{programs}/results", "curves", "--out", "curves.png", cwd=place)
    machine.call(f"{programs}/results", "report", "report.html", cwd=place)
    for name in ("film.mp4", "curves.png", "report.html"):
        assert (machine.path(place) / name).stat().st_size > 5000, name


def builds_a_plugin(machine, folder, *options):
    """With compiler and CMake of the machine, from the package alone."""
    shutil.copytree(HERE / "outside/still", machine.path(folder))
    machine.call("cmake", "-S", folder, "-B", f"{folder}/build", "-DCMAKE_BUILD_TYPE=Release",
                 *options)
    machine.call("cmake", "--build", f"{folder}/build")
    return pathlib.Path(folder) / "build/still.so"


def try_deb(packages, _):
    """Debian 12: installs with what it depends on, works, and leaves nothing when removed."""
    package = only(packages, "*.deb")
    place = "/root/a place of work"
    with fresh("bookworm", packages) as machine:
        machine.path(place).mkdir()
        shutil.copy(package, machine.path("/root"))
        machine.call("apt-get", "update", "-qq")
        before = machine.call("find", "/usr", "/etc", "-name", "*dreamsearch*")
        machine.call(*INSTALL, f"/root/{package.name}")
        assert machine.call("dpkg", "--verify", "dreamsearch") == ""
        promises.lists_every_plugin(machine, "/usr/bin", cwd=place)
        promises.trains_and_reads(machine, "/usr/bin", place)
        promises.has_man_pages(machine, "/usr/bin",
                               unpacked_man_page(machine.path("/usr/share/man/man1")))
        says_which_package_is_missing(machine, "/usr/bin", place)

        draws_and_films(machine, "/usr/bin", place)

        machine.call(*INSTALL, "g++", "cmake", "make")
        plugin = builds_a_plugin(machine, "/root/still")
        promises.loads(machine, "/usr/bin", plugin, place)

        machine.call("apt-get", "purge", "-qq", "dreamsearch")
        assert machine.call("find", "/usr", "/etc", "-name", "*dreamsearch*") == before
        assert not machine.path("/usr/bin/runner").exists()


def carries_nothing_of_the_system(prefix):
    names = [path.name for path in (prefix / "lib/dreamsearch/libraries").iterdir()]
    assert any(name.startswith("libmujoco") for name in names), names
    assert not [name for name in names if re.match(OF_THE_SYSTEM, name)], names
    binaries = [prefix / "bin/runner", prefix / "bin/results",
                *(prefix / "lib/dreamsearch").rglob("*.so*")]
    versions = subprocess.run(["objdump", "-T", *binaries], check=True, capture_output=True,
                              text=True)
    newest = max(tuple(map(int, found.split(".")))
                 for found in re.findall(r"GLIBC_([0-9.]+)", versions.stdout))
    assert newest <= GLIBC, newest


def loads_its_own_libraries(machine, prefix):
    """The programs need nothing of the system but OF_THE_SYSTEM."""
    for program in ("runner", "results"):
        for line in machine.call("ldd", f"{prefix}/bin/{program}").splitlines():
            name, _, path = line.strip().partition(" => ")
            assert f"{prefix}/bin/../lib/dreamsearch/libraries/" in path or "vdso" in name or (
                re.match(OF_THE_SYSTEM, name.rsplit("/", 1)[-1])), line


def try_tarball(packages, host):
    """Debian 12 and 13 without anything installed: works from folders with spaces, and moves."""
    archive = only(packages, "*.tar.gz")
    # Built with the tools of this machine against the SDK in the archive.
    sdk = packages / "unpacked sdk"
    shutil.rmtree(sdk, ignore_errors=True)
    sdk.mkdir()
    host.call("tar", "-C", sdk, "-xf", archive)
    prefix = only(sdk, "*")
    carries_nothing_of_the_system(prefix)
    plugin = builds_a_plugin(host, sdk / "still", f"-DCMAKE_PREFIX_PATH={prefix}")
    for release in ("bookworm", "trixie"):
        with fresh(release, packages) as machine:
            for tool in ("g++", "cmake", "python3", "gnuplot"):
                assert machine.start(["which", tool], "/").returncode == 1, tool
            place, folder = "/root/a place of work", "/opt/two words/and more"
            machine.path(place).mkdir()
            machine.path(folder).mkdir(parents=True)
            shutil.copy(plugin, machine.path(place))
            subprocess.run(["tar", "-C", machine.path(folder), "-xf", archive], check=True)
            inside = f"{folder}/{prefix.name}"
            loads_its_own_libraries(machine, inside)
            promises.lists_every_plugin(machine, f"{inside}/bin", cwd=place)
            promises.trains_and_reads(machine, f"{inside}/bin", place)
            says_which_package_is_missing(machine, f"{inside}/bin", place)
            if release == "trixie":  # whose Mesa is newer than the libraries carried
                machine.call("apt-get", "update", "-qq")
                draws_and_films(machine, f"{inside}/bin", place)
            machine.path(inside).rename(machine.path("/srv/moved"))
            promises.loads(machine, "/srv/moved/bin", pathlib.Path(place) / "still.so", place)
            promises.has_man_pages(machine, "/srv/moved/bin",
                                   unpacked_man_page(machine.path("/srv/moved/share/man/man1")))
    shutil.rmtree(sdk)


def from_pypi(machine, python, *packages):
    """Installs them, or says that they cannot be had."""
    done = machine.start([python, "-m", "pip", "install", "-q", *packages], "/tmp")
    if done.returncode != 0:
        raise Unavailable(f"{' '.join(packages)} from PyPI: {done.stderr.strip()[-300:]}")


def worlds():
    """The versions of dm_control and others that are known to go together, written in one place."""
    script = (SOURCE / "tests/plugins/env_gym/install_worlds.sh").read_text()
    return re.search(r"^packages=\((.*)\)$", script, re.M)[1].split()


def try_wheel(packages, host):
    """A new virtual environment: programs on the path, tables, agents in dm_control and Gymnasium."""
    wheel = only(packages, "*.whl")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        venv = folder / "a virtual environment"
        host.call("python3", "-m", "venv", venv)
        python = venv / "bin/python"
        from_pypi(host, python, "pandas", *worlds())
        host.call(python, "-m", "pip", "install", "-q", "--no-index", wheel)
        carries_nothing_of_the_system(venv)
        place = folder / "a place of work"
        place.mkdir()
        promises.lists_every_plugin(host, venv / "bin", cwd=place)
        promises.trains_and_reads(host, venv / "bin", place)
        promises.has_man_pages(host, venv / "bin", unpacked_man_page(venv / "share/man/man1"))
        plugin = builds_a_plugin(host, folder / "still", f"-DCMAKE_PREFIX_PATH={venv}")
        promises.loads(host, venv / "bin", plugin, place)
        # The module's own tests, on what is installed.
        shutil.copytree(SOURCE / "tests/python", folder / "tests")
        for test in ("agent", "tables", "worlds"):
            print(host.call(python, folder / f"tests/{test}_test.py", venv / "bin", cwd=place),
                  end="", flush=True)
        host.call(python, "-m", "pip", "uninstall", "-q", "-y", "dreamsearch")
        left = [path for path in venv.rglob("*") if path.is_file()
                and ("dreamsearch" in str(path.relative_to(venv)) or path.name == "runner")]
        assert not left, left

    with fresh("trixie", packages) as machine:  # a newer Python
        shutil.copy(wheel, machine.path("/root"))
        machine.call("apt-get", "update", "-qq")
        machine.call(*INSTALL, "python3-venv")
        machine.call("python3", "-m", "venv", "/root/new")
        from_pypi(machine, "/root/new/bin/python", f"/root/{wheel.name}")
        promises.lists_every_plugin(machine, "/root/new/bin")
        promises.trains_and_reads(machine, "/root/new/bin", "/root")
        machine.call("/root/new/bin/python", "-c",
                     "import dreamsearch; assert len(dreamsearch.read('v_run')) == 2", cwd="/root")


def carry_the_same_plugins(packages):
    """So that a run of one package resumes under another: its record has the plugins' digests."""
    digests = {}
    with tempfile.TemporaryDirectory() as name:
        for pattern, unpack in (("*.deb", ["dpkg-deb", "-x"]), ("*.tar.gz", ["tar", "-xf"]),
                                ("*.whl", ["unzip", "-q"])):
            for package in packages.glob(pattern):
                folder = pathlib.Path(name) / package.name
                folder.mkdir()
                target = {"dpkg-deb": [folder], "tar": ["-C", folder], "unzip": ["-d", folder]}
                subprocess.run([*unpack, package, *target[unpack[0]]], check=True)
                digests[package.name] = {
                    path.name: hashlib.sha256(path.read_bytes()).hexdigest()
                    for path in folder.rglob("lib/dreamsearch/plugins/*.so")}
    first, *others = digests.values()
    assert len(first) >= 11, digests
    for name, other in digests.items():
        differing = [plugin for plugin in first if first[plugin] != other.get(plugin)]
        assert not differing, f"{name}: {differing}"
    print(f"{', '.join(digests)}: the same {len(first)} plugins, to the byte")


TRIALS = {"deb": try_deb, "tarball": try_tarball, "wheel": try_wheel}


def main():
    packages = pathlib.Path(sys.argv[1]).resolve()
    host = Machine(hidden=SOURCE, shown=packages if SOURCE in packages.parents else None)
    skipped = False
    carry_the_same_plugins(packages)
    for name in sys.argv[2:] or TRIALS:
        try:
            TRIALS[name](packages, host)
            print(f"{name}: {TRIALS[name].__doc__.splitlines()[0]} Passed.", flush=True)
        except Unavailable as reason:
            print(f"{name}: skipped, {reason}", flush=True)
            skipped = True
    return 77 if skipped else 0


if __name__ == "__main__":
    sys.exit(main())
