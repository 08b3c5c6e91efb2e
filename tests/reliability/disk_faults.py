#!/usr/bin/env python3
"""ENOSPC and EIO from the N-th write-class system call of a worker on, and a disk that is full.

disk_faults.py BIN_DIR [--points N]

A run that meets one is interrupted: exit 74, a message with the path, and once the fault is gone
the same command finishes it with the result of an undisturbed one. For a full disk the message
has the bytes that are free. --points spreads that many faults of each kind over the calls that
concern files.
"""
import argparse
import ctypes
import os
import resource
import sys

import scripted_run as run

# Without `write`: the worker's log and its reports to the supervisor are no files of the run.
CALLS = "pwrite64,pwritev,fsync,fdatasync,ftruncate,fallocate,rename,renameat,renameat2"


def inject(programs, folder, words, fault):
    process = programs.start(folder, "runner", *words)
    worker = run.worker_of(process)
    injected = None
    if worker is not None:
        injected = run.Injected(worker, fault, CALLS)
        os.kill(worker, 18)
    out, err = process.communicate(timeout=300)
    if injected:
        injected.wait()
    return process.returncode, err


def check_message(where, error, err, faults):
    if "/r.db" not in err:
        faults.add(where, "the message names no path: " + err.strip()[-300:])
    if error == "ENOSPC" and "bytes free" not in err:
        faults.add(where, "the message has no free bytes: " + err.strip()[-300:])


def injected_faults(programs, words, expected, points, faults):
    interrupted = 0
    for error in ("ENOSPC", "EIO"):
        n, step, clean = 1, 1, 0
        done = 0
        while done < points and clean < 2:
            where = "%s from call %d on" % (error, n)
            with run.Place() as folder:
                with run.Witness(folder / "r.db") as witness:
                    code, err = inject(programs, folder, words, "error=%s:when=%d+" % (error, n))
                if code == 0:
                    clean += 1  # it had made all its calls
                elif code == 74:
                    interrupted += 1
                    check_message(where, error, err, faults)
                else:
                    faults.add(where, "exit %d, expected 74: %s" % (code, err.strip()[-300:]))
                status = run.value(folder / "r.db", "SELECT status FROM run")
                if code == 74 and status != "interrupted":
                    faults.add(where, "the run is '%s', expected 'interrupted'" % status)
                run.wait_until_nobody_works(folder)
                run.check_whole(programs, folder, "r.db", witness.seen, where, faults)
                run.check_resumes(programs, folder, words, expected, where, faults)
            n += step
            done += 1
            if done % 10 == 0:
                step += 1
    print("injected: %d interrupted runs" % interrupted, flush=True)
    return interrupted


class SmallDisk:
    """A file system of so many bytes, mounted at `folder`; not mounted where that is forbidden."""

    def __init__(self, folder, size):
        self.folder = folder
        folder.mkdir()
        libc = ctypes.CDLL(None, use_errno=True)
        self.libc = libc
        self.mounted = libc.mount(b"tmpfs", str(folder).encode(), b"tmpfs", 0,
                                  b"size=%d" % size) == 0

    def close(self):
        if self.mounted:
            self.libc.umount2(str(self.folder).encode(), 2)


def full_disk(programs, words, expected, faults):
    """A file fills the disk while the run goes on; then it is taken away."""
    with run.Place() as folder:
        disk = SmallDisk(folder / "disk", 3 << 20)
        try:
            if not disk.mounted:
                print("no small disk can be mounted here: a limit on the size of files (RLIMIT_FSIZE) "
                      "stands for it")
                return full_by_limit(programs, words, expected, faults)
            words = [word if word != "r.db" else "disk/r.db" for word in words]
            process = programs.start(folder, "runner", *words)
            worker = run.worker_of(process)
            filler = folder / "disk/filler"
            with open(filler, "wb", buffering=0) as file:
                try:
                    while True:
                        file.write(b"\0" * 4096)
                except OSError:
                    pass
            if worker is not None:
                os.kill(worker, 18)
            out, err = process.communicate(timeout=300)
            where = "a full disk"
            if process.returncode != 74:
                faults.add(where, "exit %d, expected 74: %s" % (process.returncode, err[-300:]))
            check_message(where, "ENOSPC", err, faults)
            run.wait_until_nobody_works(folder)
            filler.unlink()
            run.check_whole(programs, folder, "disk/r.db", 0, where, faults)
            run.check_resumes(programs, folder, words, expected, where, faults, "disk/r.db")
            print("full disk: exit %d, then resumed" % process.returncode, flush=True)
        finally:
            disk.close()


def full_by_limit(programs, words, expected, faults):
    with run.Place() as folder:
        process = programs.start(folder, "runner", *words)
        worker = run.worker_of(process)
        if worker is not None:
            resource.prlimit(worker, resource.RLIMIT_FSIZE, (200000, 200000))
            os.kill(worker, 18)
        out, err = process.communicate(timeout=300)
        if process.returncode not in (71, 74):
            faults.add("file size limit", "exit %d: %s" % (process.returncode, err[-300:]))
        run.check_resumes(programs, folder, words, expected, "file size limit", faults)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--points", type=int, default=100)
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    words = run.training()
    expected = run.undisturbed(programs, words)
    faults = run.Faults()
    full_disk(programs, words, expected, faults)
    why_not = run.tracing_is_allowed()
    if why_not:
        print("no faults were injected: " + why_not)
    elif injected_faults(programs, words, expected, options.points, faults) == 0:
        faults.add("injection", "no run was interrupted: nothing was tried")
    print("%d faults" % len(faults.found))
    return faults.status()


if __name__ == "__main__":
    sys.exit(main())
