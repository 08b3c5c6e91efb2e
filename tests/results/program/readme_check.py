#!/usr/bin/env python3
"""Runs every query of results/README.md and its Python example on a database.

usage: readme_check.py RESULTS_PROGRAM DATABASE README

The Python example is run with a stand-in for matplotlib that counts what is
plotted, so that only the database is tested.
"""
import json
import re
import subprocess
import sys
import types

program, database, readme = sys.argv[1:4]
text = open(readme, encoding="utf-8").read()
failures = 0

queries = re.findall(r"-- (\d+) (.*?)\n(.*?;)", re.search(r"```sql\n(.*?)```", text, re.S)[1], re.S)
if len(queries) != 10:
    print(f"expected 10 queries, found {len(queries)}")
    failures += 1
for number, title, sql in queries:
    # The made-up runs end at step 10,000.
    sql = sql.replace("env_step = 100000", "env_step = 10000")
    done = subprocess.run([program, "sql", sql, "--db", database, "--format", "json"],
                          capture_output=True, text=True)
    rows = json.loads(done.stdout) if done.returncode == 0 else None
    # The made-up runs never diverge.
    if rows is None or (not rows and number != "7"):
        failures += 1
        print(f"query {number} ({title}): exit {done.returncode}, {done.stderr or 'no rows'}")

plotted = {"lines": 0, "bands": 0}
pyplot = types.ModuleType("matplotlib.pyplot")
pyplot.plot = lambda *a, **k: plotted.update(lines=plotted["lines"] + 1)
pyplot.fill_between = lambda *a, **k: plotted.update(bands=plotted["bands"] + 1)
for name in ("xlabel", "ylabel", "legend", "savefig"):
    setattr(pyplot, name, lambda *a, **k: None)
matplotlib = types.ModuleType("matplotlib")
matplotlib.pyplot = pyplot
sys.modules.update({"matplotlib": matplotlib, "matplotlib.pyplot": pyplot})
example = re.search(r"```python\n(.*?)```", text, re.S)[1]
exec(example.replace("results/dreamsearch.db", database), {})
if plotted["lines"] < 2 or plotted["bands"] < 2:
    failures += 1
    print(f"the Python example plotted {plotted}")

print(f"{failures} failures")
sys.exit(1 if failures else 0)
