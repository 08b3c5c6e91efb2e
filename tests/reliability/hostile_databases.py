#!/usr/bin/env python3
"""Databases that are none, damaged or in the way: every command says so, and quickly.

hostile_databases.py BIN_DIR

No command may crash, take longer than ten seconds, or call it a defect of its own (70); who only
reads leaves the file as it was; and each exit code is one of those that the case may have.
"""
import argparse
import os
import random
import shutil
import sqlite3
import sys

import scripted_run as run


def sql(path, script):
    connection = sqlite3.connect(path)
    connection.executescript(script)
    connection.close()


def cases(folder, source):
    """(name, path, exit codes that a reader may have)."""
    draw = random.Random(0)
    data = source.read_bytes()

    def made(name, content=None):
        path = folder / name
        if content is not None:
            path.write_bytes(content)
        return path

    def changed(name, script):
        path = made(name, data)
        sql(path, script)
        return path

    yield "a missing folder", folder / "absent/x.db", {66}
    yield "a missing file", folder / "absent.db", {66}
    (folder / "folder.db").mkdir()
    yield "a folder", folder / "folder.db", {65}
    yield "an empty file", made("empty.db", b""), {65}
    yield "random bytes", made("random.db", draw.randbytes(50000)), {65}
    yield "a text", made("text.db", b"hello\n" * 1000), {65}
    for cut in (1, 15, 16, 99, 100, 512, 4095, 4096, 4097, len(data) // 2, len(data) - 1):
        yield "cut to %d bytes" % cut, made("cut%d.db" % cut, data[:cut]), {0, 65}
    for i in range(8):
        flipped = bytearray(data)
        for _ in range(50):
            flipped[draw.randrange(len(flipped))] ^= 1 << draw.randrange(8)
        yield "50 flipped bits, %d" % i, made("flipped%d.db" % i, bytes(flipped)), {0, 65, 73, 74}
    other = folder / "other.db"
    sql(other, "CREATE TABLE t (x); INSERT INTO t VALUES (1)")
    yield "another program's file", other, {65}
    for version in (0, 7, 99, 2147483647, -1, -2, -2147483648, -1000000):
        # 0 with our tables is a file rebuilt from SQL text, 7 is older than they are.
        yield "schema %d" % version, changed("schema%d.db" % version,
                                             "PRAGMA user_version = %d" % version), {0, 65}
    yield "another application", changed("application.db", "PRAGMA application_id = 7"), {0, 65}
    yield "without a table", changed("no_step.db", "PRAGMA foreign_keys = OFF; DROP TABLE step"), \
        {0, 65}
    yield "without a view", changed("no_view.db", "DROP VIEW v_run"), {0}
    yield "an endless view", changed(
        "endless.db", "DROP VIEW v_curve; CREATE VIEW v_curve AS WITH RECURSIVE n(i) AS (SELECT 1 "
        "UNION ALL SELECT i + 1 FROM n) SELECT i AS run_id FROM n"), {0}
    for name, text in (("nested", "'" + "[" * 100000 + "'"), ("empty", "''"), ("number", "'1e999'"),
                       ("bytes", "CAST(x'80ff00' AS TEXT)"),
                       ("long", "'{\"a\":\"' || hex(zeroblob(2000000)) || '\"}'")):
        yield "a configuration, " + name, changed("json_%s.db" % name,
                                                  "UPDATE config SET json = %s" % text), {0, 65}
    names = {"quotes": "a''b\"c", "semicolon": "x; DROP TABLE run; --", "newline": "a\nb",
             "long": "x" * 10000, "emoji": "🙂", "dots": "../../x", "format": "%s%n%d",
             "html": "<script>alert(1)</script>", "formula": "=1+1", "escape": "\x1b]0;x\x07"}
    for name, text in names.items():
        text = text.replace("'", "''").replace("''''", "''")
        yield "a name, " + name, changed("name_%s.db" % name,
                                         "UPDATE study SET name = '%s'; UPDATE task SET name = '%s'"
                                         % (text, text)), {0, 65}
    for uuid in ("../../x", "", "x" * 5000):
        yield "a UUID '%s'" % uuid[:9], changed("uuid%d.db" % len(uuid),
                                                "UPDATE run SET uuid = '%s'" % uuid), {0, 65}
    yield "a status of its own", changed(
        "status.db", "PRAGMA ignore_check_constraints = ON; UPDATE run SET status = 'odd'"), {65}
    yield "numbers out of range", changed(
        "numbers.db", "PRAGMA ignore_check_constraints = ON; UPDATE run SET env_steps_done = "
        "9223372036854775807, seed = -9223372036854775808"), {0, 65}
    yield "a parent of its own", changed("parent.db", "UPDATE run SET parent_run_id = run_id"), \
        {0, 65}
    loop = folder / "loop.db"
    loop.symlink_to(loop)
    yield "a link to itself", loop, {65, 66, 73, 74}
    fifo = folder / "fifo.db"
    os.mkfifo(fifo)
    yield "a named pipe", fifo, {65}
    yield "a device", "/dev/null", {65}
    yield "a long name", folder / ("x" * 300), {66, 73, 74}


# What opens these gives them the marks that their tables should have.
MARKS_MENDED = ("schema 0", "schema 7", "another application")
READERS = (("list",), ("list", "--missing"), ("show", "1"), ("curves",), ("compare",),
           ("report", "--out", "REPORT"), ("verify",), ("export", "--out", "EXPORT"),
           ("sql", "SELECT * FROM v_run"), ("delete", "1"))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin_dir")
    options = parser.parse_args()
    programs = run.Programs(options.bin_dir)
    faults = run.Faults()
    count = commands = 0
    with run.Place() as folder:
        words = run.training("source.db", steps=120)
        code, out, err = programs.call(folder, "runner", *words)
        if code != 0:
            sys.exit("the source: exit %d: %s" % (code, err))
        sql(folder / "source.db", "PRAGMA wal_checkpoint(TRUNCATE); PRAGMA journal_mode = DELETE")
        for name, path, allowed in cases(folder, folder / "source.db"):
            count += 1
            regular = os.path.isfile(path) and not os.path.islink(path)
            before = open(path, "rb").read() if regular else None
            for number, words in enumerate((*READERS, "status", "resume")):
                program = "runner" if isinstance(words, str) else "results"
                words = (words,) if isinstance(words, str) else words
                made = [str(folder / ("made%d_%d" % (count, number))) if word.isupper() and
                        "SELECT" not in word else word for word in words]
                code, out, err = programs.call(folder, program, *made, "--db", path, timeout=10)
                commands += 1
                where = "%s: %s %s" % (name, program, words[0])
                if code < 0 or code >= 128 or code == 70:
                    faults.add(where, "exit %d: %s" % (code, err.strip()[-300:]))
                elif words == ("list",) and code not in allowed:
                    faults.add(where, "exit %d, expected one of %s: %s" %
                               (code, sorted(allowed), err.strip()[-300:]))
                if code not in (0, 2, 65, 66, 69, 70, 73, 74, 75, 77, 78) and code >= 0:
                    faults.add(where, "exit %d is not in the list" % code)
                # `delete` opens it to write, also when it only says what it would delete.
                if words[0] not in ("resume", "delete") and before is not None and \
                        open(path, "rb").read() != before and name not in MARKS_MENDED:
                    faults.add(where, "who only reads has changed the file")
                    before = open(path, "rb").read()
                if words[0] == "delete" and before is not None:
                    before = open(path, "rb").read()
                if words[0] == "resume":
                    shutil.rmtree(str(path) + ".files", ignore_errors=True)
    print("%d databases, %d commands, %d faults" % (count, commands, len(faults.found)))
    return faults.status()


if __name__ == "__main__":
    sys.exit(main())
