#!/usr/bin/env python3
"""dreamsearch.read gives every view of a database, with the numbers that `results sql` gives.

tables_test.py BIN [PACKAGE] makes a database with BIN/runner. PACKAGE is the folder of the module,
if it is not installed. Ends with 77 where there is no pandas.
"""
import csv
import io
import pathlib
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
sys.path[:0] = sys.argv[2:3]
try:
    import pandas
except ImportError:
    print("skipped: no pandas; Debian: python3-pandas")
    sys.exit(77)
import dreamsearch

RUN = ["--env", "cartpole_balance", "--planner", "dreamer,random", "--steps", "2000",
       "--study", "ä b"]
SETTINGS = ["run.prefill_steps=1000", "run.train_every=250", "run.batch_size=4",
            "run.sequence_length=8", "run.eval_episodes=1", "run.eval_every=1000",
            "run.pretrain_updates=4", "model.hidden=16", "model.deterministic=16",
            "model.stochastic=4", "model.imagination_starts=8", "model.horizon=3"]


def call(folder, program, *words):
    done = subprocess.run([program, *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stderr[-2000:])
    return done.stdout


def same(cell, text):
    """A cell of a table, and the same as `results sql` writes it."""
    if cell is None or cell != cell:
        return text == ""
    if isinstance(cell, (int, float)):
        return abs(float(text) - cell) <= 1e-9 * max(1, abs(cell))
    return str(cell) == text


def main():
    binaries = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        database = folder / "a #1 database?.db"
        words = [*RUN, "--db", str(database)]
        for setting in SETTINGS:
            words += ["--set", setting]
        call(folder, binaries / "runner", *words)
        before = database.read_bytes()

        views = dreamsearch.views(database)
        assert {"v_run", "v_curve", "v_final", "v_time", "v_matrix"} <= set(views), views
        for view in views:
            table = dreamsearch.read(view, db=database)
            rows = list(csv.reader(io.StringIO(call(
                folder, binaries / "results", "sql", "--db", str(database), "--format", "csv",
                f"select * from {view}"))))
            assert list(table.columns) == rows[0], (view, rows[0])
            assert len(table) == len(rows) - 1 and len(table) > 0, view
            for found, expected in zip(table.itertuples(index=False), rows[1:]):
                assert all(map(same, found, expected)), (view, found, expected)
        final = dreamsearch.read("v_final", db=database)
        assert set(final["planner"]) == {"dreamer", "random"} and set(final["study"]) == {"ä b"}
        assert pandas.api.types.is_float_dtype(final["score"]), final.dtypes

        chosen = dreamsearch.query("select count(*) as n from v_run where planner = ?", database,
                                   ["random"])
        assert chosen["n"].tolist() == [1]
        for wrong, expected in (
                (lambda: dreamsearch.read("run", database), "Known: v_curve"),
                (lambda: dreamsearch.read("v_run", folder / "none.db"), "none.db"),
                (lambda: dreamsearch.query("delete from run", database), "readonly")):
            try:
                wrong()
            except Exception as error:
                assert expected in str(error), error
            else:
                raise AssertionError(f"no complaint: {expected}")
        assert database.read_bytes() == before
        assert not (folder / "none.db").exists()
    return 0


if __name__ == "__main__":
    sys.exit(main())
