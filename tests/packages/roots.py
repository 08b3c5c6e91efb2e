"""Root folders of fresh Debian systems, made once by mmdebstrap and unpacked for each test."""
import contextlib
import os
import pathlib
import shutil
import subprocess
import tempfile

from machine import Machine

MIRROR = "http://deb.debian.org/debian"

CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"


class Unavailable(Exception):
    """What keeps a test from running here."""


def archive(release, folder):
    """A minimal system of `release` as a tar archive in `folder`."""
    if os.getuid() != 0:
        raise Unavailable("a root folder is made as root")
    if shutil.which("mmdebstrap") is None:
        raise Unavailable("no program mmdebstrap; Debian: mmdebstrap")
    path = folder / f"{release}.tar"
    if not path.exists():
        print(f"making a minimal Debian {release}", flush=True)
        made = path.with_suffix(".made.tar")
        done = subprocess.run(["mmdebstrap", "--variant=minbase", "--quiet", release, made, MIRROR],
                              capture_output=True, text=True)
        if done.returncode != 0:
            made.unlink(missing_ok=True)
            raise Unavailable(f"no Debian {release} from {MIRROR}: {done.stderr.strip()[-300:]}")
        made.rename(path)
    return path


@contextlib.contextmanager
def fresh(release, folder):
    """A machine on which nothing but a minimal `release` is installed. Reaches the network."""
    path = archive(release, folder)
    with tempfile.TemporaryDirectory(dir=folder) as name:
        root = pathlib.Path(name)
        subprocess.run(["tar", "-C", root, "-xf", path], check=True)
        # The network as it is here.
        shutil.copy("/etc/resolv.conf", root / "etc/resolv.conf")
        shutil.copy(CERTIFICATES, root / "etc/certificates-of-the-host.crt")
        machine = Machine(root=root,
                          environment={"PIP_CERT": "/etc/certificates-of-the-host.crt"})
        if machine.missing():
            raise Unavailable(machine.missing())
        yield machine
