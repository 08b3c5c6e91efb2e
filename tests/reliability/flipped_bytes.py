#!/usr/bin/env python3
"""Flipped and cut bytes in the database and in the checkpoints of a run.

flipped_bytes.py BIN_DIR [--flips N] [--seed N]

A database: every command says so or works, without a crash, a defect (70) or a hang; what changes
the content that SQLite reads is found by `results verify`. A checkpoint: the run resumes from the
newest whole one, to the result of an undisturbed run.
"""
import argparse
import os
import random
import shutil
import sqlite3
import sys

import scripted_run as run


def content(path):
    """All that a reader gets from the file; an error is content too."""
    try:
        connection = sqlite3.connect("file:%s?mode=ro&immutable=1" % path, uri=True)
        connection.text_factory = bytes
        try:
            schema = connection.execute(
                "SELECT type, name, tbl_name, sql FROM sqlite_schema ORDER BY 1, 2").fetchall()
            rows = {}
            for kind, name, *_ in schema:
                if kind == b"table":
                    rows[name] = sorted(map(repr, connection.execute(
                        'SELECT * FROM "%s"' % name.decode())))
            marks = [connection.execute("PRAGMA " + mark).fetchone()
                     for mark in ("user_version", "application_id")]
            return schema, rows, marks
        finally:
            connection.close()
    except (sqlite3.Error, UnicodeError, OverflowError) as error:
        return repr(error)


READERS = (("list",), ("show", "1"), ("curves",), ("report", "r.html"), ("compare",))


def flip_database(programs, source, flips, draw, faults):
    pristine = content(source)
    data = source.read_bytes()
    found = unchanged = missed = 0
    with run.Place() as folder:
        for i in range(flips):
            place, bit = draw.randrange(len(data)), draw.randrange(8)
            changed = bytearray(data)
            changed[place] ^= 1 << bit
            (folder / "r.db").write_bytes(changed)
            for name in ("r.db-wal", "r.db-shm"):
                if (folder / name).exists():
                    os.unlink(folder / name)
            where = "bit %d of byte %d of the database" % (bit, place)
            differs = content(folder / "r.db") != pristine
            code, out, err = programs.call(folder, "results", "verify", "--db", "r.db", timeout=20)
            if code not in (0, 65, 66, 73, 74, 77, 78):
                faults.add(where, "results verify: exit %d: %s" % (code, (out + err)[-300:]))
            if not differs:
                unchanged += 1
            elif code != 0:
                found += 1
            else:
                missed += 1
                print("missed: %s" % where)
            reader = READERS[i % len(READERS)]
            code, out, err = programs.call(folder, "results", *reader, "--db", "r.db", timeout=20)
            if code == 70 or code < 0 or code > 100:
                faults.add(where, "results %s: exit %d: %s" % (reader[0], code, err[-300:]))
            (folder / "r.db").unlink()
    print("database: %d flips, %d changed what is read: %d found, %d missed" %
          (flips, found + missed, found, missed), flush=True)
    return missed


def flip_checkpoints(programs, stage, words, expected, flips, draw, faults):
    for i in range(flips):
        with run.Place() as folder:
            shutil.copytree(stage, folder, dirs_exist_ok=True)
            checkpoints = sorted(folder.glob("r.db.files/*/checkpoint-*.ckpt"),
                                 key=lambda path: int(path.stem.split("-")[1]))
            newest = checkpoints[-1]
            data = bytearray(newest.read_bytes())
            if i % 2 == 0:
                place = draw.randrange(len(data))
                data[place] ^= 1 << draw.randrange(8)
                where = "byte %d of a checkpoint" % place
            else:
                del data[draw.randrange(len(data)):]
                where = "a checkpoint cut to %d bytes" % len(data)
            newest.write_bytes(data)
            run.check_resumes(programs, folder, words, expected, where, faults)
    print("checkpoints: %d flipped or cut" % flips, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    parser.add_argument("--flips", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    words = run.training(steps=1500)
    expected = run.undisturbed(programs, words)
    faults = run.Faults()
    draw = random.Random(options.seed)
    with run.Place() as stage:
        process = programs.start(stage, "runner", *words)
        while process.poll() is None and len(list(stage.glob("r.db.files/*/checkpoint-*.ckpt"))) < 2:
            pass
        process.kill()
        for pid in run.query(stage / "r.db", "SELECT pid FROM segment"):
            try:
                os.kill(pid[0], 9)
            except OSError:
                pass
        process.communicate()
        run.wait_until_nobody_works(stage)
        if run.value(stage / "r.db", "SELECT status FROM run") != "finished":
            flip_checkpoints(programs, stage, words, expected, max(2, options.flips // 10), draw,
                             faults)
        else:
            faults.add("checkpoints", "the run finished before it was killed")
        code, out, err = programs.call(stage, "runner", *words)
        connection = sqlite3.connect(stage / "r.db")
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        connection.execute("PRAGMA journal_mode = DELETE")
        connection.close()
        missed = flip_database(programs, stage / "r.db", options.flips, draw, faults)
        if missed:
            faults.add("database", "%d changes were not found by results verify" % missed)
    print("%d faults" % len(faults.found))
    return faults.status()


if __name__ == "__main__":
    sys.exit(main())
