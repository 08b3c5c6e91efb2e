#!/usr/bin/env python3
"""Times `results merge` and a bare INSERT ... SELECT of the same rows in one run.

merge.py BIN SYNTHETIC [--runs N] [--steps N] [--turns N]

BIN has the program `results`, SYNTHETIC is the program synthetic_database. Made-up runs of
N steps, with a row a decision, are merged from one database, and from one database a run as
a cluster leaves them. "Bare" is one INSERT ... SELECT a table into an empty file with the same
tables, indices and triggers, a transaction a source, the same journal and the same care for
power cuts. Prints the seconds of each turn, and the median of bare / merge, of which 0.8 is
expected; ends with 1 if it is less. Processor time stands in brackets: on a busy machine it tells more.
"""
import argparse
import pathlib
import resource
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time


def processor(who):
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def remove(path):
    for part in ("", "-wal", "-shm", "-journal"):
        pathlib.Path(f"{path}{part}").unlink(missing_ok=True)


def schema(connection, prefix="main"):
    kinds = "CASE type WHEN 'table' THEN 0 WHEN 'index' THEN 1 ELSE 2 END"
    return [row[0] for row in connection.execute(
        f"SELECT sql FROM {prefix}.sqlite_schema WHERE sql IS NOT NULL AND type <> 'view'"
        f" AND name NOT LIKE 'sqlite%' ORDER BY {kinds}")]


def tables(connection):
    return [row[0] for row in connection.execute(
        "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%'"
        " AND name <> 'curve_bin'")]


def columns(connection, table):
    return [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]


class Bare:
    """Into `path`, from sources that are alike but for their runs."""

    def __init__(self, path, source):
        remove(path)
        with sqlite3.connect(source) as model:
            statements = schema(model)
        self.db = sqlite3.connect(path, isolation_level=None)
        self.db.execute("PRAGMA journal_mode = WAL")
        self.db.execute("PRAGMA synchronous = FULL")
        self.db.execute("PRAGMA cache_size = -16000")
        for statement in statements:
            self.db.execute(statement)
        self.tables = {name: columns(self.db, name) for name in tables(self.db)}

    def add(self, source, first):
        """A run is known by its place: its number is that of the source and `first`."""
        self.db.execute("ATTACH ? AS source", (str(source),))
        self.db.execute("BEGIN IMMEDIATE")
        for name, names in self.tables.items():
            shared = "run_id" not in names
            values = [f"run_id + {first}" if column == "run_id" else column for column in names]
            self.db.execute(f"INSERT {'OR IGNORE ' if shared else ''}INTO main.{name}"
                            f" ({', '.join(names)}) SELECT {', '.join(values)} FROM source.{name}")
        self.db.execute("COMMIT")
        self.db.execute("DETACH source")

    def close(self):
        self.db.close()


def split(source, folder):
    """A database a run."""
    with sqlite3.connect(source) as db:
        names = tables(db)
        with_run = [name for name in names if "run_id" in columns(db, name)]
        runs = [row[0] for row in db.execute("SELECT run_id FROM run ORDER BY run_id")]
        marks = [db.execute(f"PRAGMA {name}").fetchone()[0]
                 for name in ("application_id", "user_version")]
        views = [row[0] for row in db.execute("SELECT sql FROM sqlite_schema WHERE type = 'view'")]
        statements = schema(db) + views
        for run in runs:
            path = folder / f"{run}.db"
            db.execute("ATTACH ? AS part", (str(path),))
            for statement in statements:
                words = statement.split(None, 2 if not statement.startswith("CREATE UNIQUE") else 3)
                db.execute(" ".join(words[:-1]) + " part." + words[-1])
            for name in names:
                where = f" WHERE run_id = {run}" if name in with_run else ""
                db.execute(f"INSERT INTO part.{name} SELECT * FROM main.{name}{where}")
            db.execute(f"PRAGMA part.application_id = {marks[0]}")
            db.execute(f"PRAGMA part.user_version = {marks[1]}")
            db.commit()
            db.execute("DETACH part")
            yield path


def measure(what, results, sources, folder, turns):
    target, bare_target = folder / "all.db", folder / "bare.db"
    ratios, processor_ratios = [], []
    for turn in range(turns):
        remove(target)
        begun, used = time.perf_counter(), processor(resource.RUSAGE_CHILDREN)
        subprocess.run([results, "merge", *map(str, sources), "--db", str(target)], check=True,
                       stdout=subprocess.DEVNULL)
        merged = time.perf_counter() - begun
        merging = processor(resource.RUSAGE_CHILDREN) - used
        begun, used = time.perf_counter(), processor(resource.RUSAGE_SELF)
        bare = Bare(bare_target, sources[0])
        for number, source in enumerate(sources):
            # A database a run keeps the run's number of the whole.
            bare.add(source, 0)
        bare.close()
        copied = time.perf_counter() - begun
        copying = processor(resource.RUSAGE_SELF) - used
        ratios.append(copied / merged)
        processor_ratios.append(copying / merging)
        print(f"{what}: merge {merged:.2f} s ({merging:.2f} s of processor time), bare"
              f" {copied:.2f} s ({copying:.2f} s), ratio {ratios[-1]:.2f}"
              f" ({processor_ratios[-1]:.2f})", flush=True)
    with sqlite3.connect(target) as a, sqlite3.connect(bare_target) as b:
        for name in ("run", "step", "episode", "scalar", "curve_bin", "event"):
            counts = [db.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for db in (a, b)]
            assert counts[0] == counts[1], f"{name}: {counts} rows"
    return statistics.median(ratios), statistics.median(processor_ratios)


def main():
    arguments = argparse.ArgumentParser(description=__doc__,
                                        formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("bin", type=pathlib.Path)
    arguments.add_argument("synthetic")
    arguments.add_argument("--runs", type=int, default=240, help="a multiple of 12")
    arguments.add_argument("--steps", type=int, default=20000)
    arguments.add_argument("--turns", type=int, default=3)
    given = arguments.parse_args()
    results = given.bin / "results"
    with tempfile.TemporaryDirectory(prefix="merge-") as name:
        folder = pathlib.Path(name)
        whole = folder / "whole.db"
        subprocess.run([given.synthetic, str(whole), "3", "4", str(given.runs // 12),
                        str(given.steps), "decisions"], check=True, stdout=subprocess.DEVNULL)
        print(f"{given.runs} runs, {whole.stat().st_size / 1e6:.0f} MB")
        parts = list(split(whole, folder))
        medians = [measure("one database", results, [whole], folder, given.turns),
                   measure("a database a run", results, parts, folder, given.turns)]
    for what, (wall, processor_time) in zip(("one database", "a database a run"), medians):
        print(f"{what}: median of bare / merge {wall:.2f} ({processor_time:.2f} of processor time),"
              " expected 0.80 or more")
    return 0 if min(wall for wall, _ in medians) >= 0.8 else 1


if __name__ == "__main__":
    sys.exit(main())
