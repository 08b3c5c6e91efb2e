#!/usr/bin/env python3
"""Checkpoints whose fields were changed and whose checksums were made anew.

resigned_checkpoints.py BIN_DIR [--changes N] [--seed N]

No checksum tells such a file from a good one. A run that is given one is resumed or refused: no
worker may crash, hang, or take all memory, whatever the numbers in it.
"""
import argparse
import hashlib
import os
import random
import shutil
import struct
import sys

import scripted_run as run

TEXT = 6
SIZES = {1: 8, 2: 8, 3: 8, 4: 4, 5: 1, TEXT: 1}  # bytes of an entry, by FieldType


def fields(part):
    """(name, type, where its count stands, where its entries stand, how many) of a part."""
    at = 0
    while at < len(part):
        length = part[at]
        name = part[at + 1:at + 1 + length].decode()
        kind = part[at + 1 + length]
        count_at = at + 2 + length
        count = struct.unpack_from("<Q", part, count_at)[0]
        entries = count_at + 8
        if kind not in SIZES:  # a stream: pieces of a length and bytes
            yield name, kind, count_at, entries, 0
            end = entries
            while True:
                size = struct.unpack_from("<I", part, end)[0]
                end += 4 + size
                if size == 0:
                    break
            at = end
            continue
        yield name, kind, count_at, entries, count
        at = entries + count * SIZES[kind]


def parts_of(data):
    build = struct.unpack_from("<H", data, 8)[0]
    head = data[:10 + build]
    list_bytes = struct.unpack_from("<Q", data, len(data) - 16)[0]
    listed = data[len(data) - 48 - list_bytes:len(data) - 48]
    found = []
    entry = []
    for name, kind, count_at, entries, count in list(fields(listed))[1:]:
        entry.append(listed[entries:entries + count].decode() if kind == TEXT
                     else struct.unpack_from("<Q", listed, entries)[0])
        if len(entry) == 4:
            found.append(entry)
            entry = []
    parts, at = [], len(head)
    for name, version, size, _ in found:
        parts.append([name, version, bytearray(data[at:at + size])])
        at += size
    return head, parts


def field(name, kind, value):
    raw = value.encode() if kind == TEXT else struct.pack("<Q", value)
    return (bytes([len(name)]) + name.encode() + bytes([kind]) +
            struct.pack("<Q", len(raw) if kind == TEXT else 1) + raw)


def signed(head, parts):
    listed = field("count", 1, len(parts))
    for name, version, data in parts:
        listed += (field("part", TEXT, name) + field("version", 1, version) +
                   field("bytes", 1, len(data)) +
                   field("sha256", TEXT, hashlib.sha256(data).hexdigest()))
    body = b"".join(bytes(data) for _, _, data in parts)
    digest = hashlib.sha256(head + listed).digest()
    return head + body + listed + digest + struct.pack("<Q", len(listed)) + b"DSCKPEND"


def change(parts, draw):
    """Changes one number, length or byte of a part; says which."""
    name, version, data = draw.choice([part for part in parts if part[2]])
    chosen = draw.choice(list(fields(bytes(data))))
    what, kind, count_at, entries, count = chosen
    odd = [0, 1, 2**31, 2**32, 2**62, 2**63, 2**64 - 1, draw.randrange(10**6)]
    if count == 0 or draw.random() < 0.25:
        struct.pack_into("<Q", data, count_at, draw.choice(odd))
        return "%s.%s: another length" % (name, what)
    at = entries + draw.randrange(count) * SIZES[kind]
    if SIZES[kind] == 8:
        number = draw.choice(odd)
        if kind == 3:
            number = struct.unpack("<Q", struct.pack("<d", draw.choice(
                [float("nan"), float("inf"), -1e308, 0.0])))[0]
        struct.pack_into("<Q", data, at, number)
    else:
        for k in range(SIZES[kind]):
            data[at + k] = draw.randrange(256)
    return "%s.%s: another value" % (name, what)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--changes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    words = run.training(steps=1500, planner="mcts_pw")
    faults = run.Faults()
    draw = random.Random(options.seed)
    codes = {}
    with run.Place() as stage:
        process = programs.start(stage, "runner", *words)
        while process.poll() is None and not list(stage.glob("r.db.files/*/checkpoint-1*.ckpt")):
            pass
        process.terminate()  # a checkpoint in the middle of an episode
        process.communicate()
        if process.returncode != 75:
            sys.exit("the run was not interrupted: exit %d" % process.returncode)
        for path in sorted(stage.glob("r.db.files/*/checkpoint-*.ckpt"),
                           key=lambda path: int(path.stem.split("-")[1]))[:-1]:
            path.unlink()
        for i in range(options.changes):
            with run.Place() as folder:
                shutil.copytree(stage, folder, dirs_exist_ok=True)
                path = next(folder.glob("r.db.files/*/checkpoint-*.ckpt"))
                head, parts = parts_of(path.read_bytes())
                where = "change %d, %s" % (i, change(parts, draw))
                path.write_bytes(signed(head, parts))
                code, out, err = programs.call(folder, "runner", *words, "--memory-limit", "1G",
                                               "--hang-timeout", "10", "--time-limit", "20", timeout=90)
                codes[code] = codes.get(code, 0) + 1
                if code == 71 or code < 0 or code >= 128:
                    faults.add(where, "exit %d: %s" % (code, err.strip()[-400:]))
    print("%d changed checkpoints, exit codes %s, %d faults" %
          (options.changes, dict(sorted(codes.items())), len(faults.found)))
    return faults.status()


if __name__ == "__main__":
    sys.exit(main())
