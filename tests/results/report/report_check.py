#!/usr/bin/env python3
"""Opens a report in headless Chromium, hovers, clicks and checks what is shown.

usage: report_check.py RESULTS_PROGRAM DATABASE [SCREENSHOT_FOLDER]

Exits 77 without Chromium, which CTest reports as skipped.
"""
import csv
import json
import os
import subprocess
import sys
import tempfile
import time

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../chromium"))
from browser import Browser, chromium

program, database = sys.argv[1:3]
screenshots = sys.argv[3] if len(sys.argv) > 3 else None
if chromium is None:
    print("skipped: no chromium")
    sys.exit(77)

failures = 0


def check(what, ok, found=""):
    global failures
    if not ok:
        failures += 1
        print(f"FAILED: {what}: {found}")


# Chromium's helpers may still write to the profile after it has gone.
with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
    page = os.path.join(folder, "report.html")
    started = time.time()
    subprocess.run([program, "report", page, "--db", database], check=True,
                   stderr=subprocess.DEVNULL)
    size = os.path.getsize(page)
    print(f"{size / 1e3:.0f} kB in {time.time() - started:.1f} s")
    check("the page is under 1 MB", size < 1e6, size)

    browser = Browser(os.path.join(folder, "profile"))
    url = "file://" + page
    first = "document.querySelector('figure[data-chart=\"0\"]')"
    chart = f"Chart.getChart({first}.querySelector('canvas'))"
    data = "JSON.parse(document.getElementById('data').textContent)"

    def table(*arguments):
        """The rows of `results curves` as text."""
        path = os.path.join(folder, "curves.csv")
        subprocess.run([program, "curves", "--db", database, "--out", path, *arguments], check=True,
                       stderr=subprocess.DEVNULL)
        with open(path, newline="") as file:
            return list(csv.DictReader(file))

    def drawn(index):
        """What a chart shows: by planner its points, each x, y, lo, hi."""
        return browser.value(
            f"Object.fromEntries(Chart.getChart(document.querySelector('figure[data-chart=\"{index}\"] canvas'))"
            f".data.datasets.filter((d) => d.curve).map((d) => [{data}.lines[d.curve.line].label, "
            "d.data.map((p) => [p.x, p.y, p.lo, p.hi])]))")

    def compare_with_tables(axis):
        for index, name in enumerate(browser.value(f"{data}.charts.map((c) => c.name)")):
            over_tasks = browser.value(f"{data}.charts[{index}].over_tasks")
            browser.value(f"document.querySelector('figure[data-chart=\"{index}\"]').scrollIntoView()")
            browser.until("Boolean(Chart.getChart(document.querySelector("
                          f"'figure[data-chart=\"{index}\"] canvas')))")
            rows = table("--x", axis, *(["--kind", "mean"] if over_tasks else ["--env", name]))
            shown = drawn(index)
            check("the planners of the tables are drawn",
                  set(shown) == {row["line"] for row in rows}, (name, axis, list(shown)))
            for label, points in shown.items():
                mine = [row for row in rows if row["line"] == label]
                seeds_there = max(int(row["n"]) for row in mine)
                wanted = [[float(row[key]) for key in ("x", "mean", "lo", "hi")] for row in mine
                          if int(row["n"]) == seeds_there]
                check("the numbers drawn are those of the table, to the bit", points == wanted,
                      (name, axis, label, points, wanted))

    def picture(name):
        if screenshots is not None:
            browser.picture(os.path.join(screenshots, name))

    try:
        browser.open(url)
        check("the first chart is drawn", browser.until(f"Boolean({chart})"))
        check("the time chart is drawn", browser.until(
            "Boolean(Chart.getChart(document.getElementById('time-chart')))"))
        check("no two elements have the same id", browser.value(
            "(() => { const ids = [...document.querySelectorAll('[id]')].filter((e) => "
            "!e.closest('svg')).map((e) => e.id); return ids.length === new Set(ids).size; })()"))
        picture("page.png")
        labels = browser.value(f"{data}.lines.map((line) => line.label)")
        seeds = browser.value(f"{data}.seeds")
        counts = browser.value(f"{first}.querySelector('.counts').textContent")
        for label in labels:
            check("the caption names every planner with n", f"{label} n = " in counts, counts)
        check("nothing is loaded from elsewhere",
              browser.value("performance.getEntriesByType('resource').length") == 0)
        check("the page is no wider than the window",
              browser.value("document.documentElement.scrollWidth <= innerWidth"))

        # Hover over the middle of a line: the tooltip names it and its range.
        browser.value(f"{first}.scrollIntoView({{block: 'center'}})")
        x, y = browser.value(
            f"(() => {{ const c = {chart}; const s = c.data.datasets.findIndex((d) => d.curve);"
            " const p = c.getDatasetMeta(s).data; const m = p[Math.floor(p.length / 2)];"
            " const r = c.canvas.getBoundingClientRect(); return [r.x + m.x, r.y + m.y]; })()")
        browser.move(x, y)
        check("hovering shows a point",
              browser.until(f"{chart}.tooltip.opacity > 0 && {chart}.tooltip.body.length > 0"))
        text = browser.value(f"{chart}.tooltip.body.map((b) => b.lines.join()).join()")
        check("the tooltip says planner, range and n", "n = " in text and " to " in text and
              any(text.startswith(label) for label in labels), text)
        picture("hover.png")

        # Untick a planner: its line goes.
        shown = (f"{chart}.data.datasets.filter((d) => d.curve)"
                 f".map((d) => {data}.lines[d.curve.line].label)")
        check("all planners are shown at first", set(browser.value(shown)) == set(labels))
        browser.click("document.querySelector('input[name=line]')")
        check("unticking hides a planner", browser.until(
            f"!{shown}.includes({json.dumps(labels[0])})"), browser.value(shown))
        browser.click("document.querySelector('input[name=line]')")
        check("ticking shows it again", browser.until(
            f"{shown}.includes({json.dumps(labels[0])})"))

        # Tick a seed: its runs are drawn beside, and the statistics stay those of all seeds.
        count = f"{chart}.data.datasets.length"
        before, curves = browser.value(count), browser.value(shown)
        browser.click("document.querySelector('input[name=seed]')")
        check("ticking a seed draws its runs", browser.until(f"{count} === {before + len(curves)}"),
              browser.value(count))
        check("the caption still counts every seed",
              browser.value(f"{first}.querySelector('.counts').textContent") == counts)
        picture("single.png")
        browser.click("document.querySelector('input[name=seed]')")

        compare_with_tables("steps")
        for value, name in (("model transitions", "transitions"), ("seconds", "seconds")):
            browser.click(f"document.querySelector('input[name=axis][value=\"{value}\"]')")
            check(f"the x axis is in {name}",
                  browser.until(f"{chart}.options.scales.x.title.text.includes('{name}')"))
            compare_with_tables(name)
        browser.click("document.querySelector('input[name=scale][value=logarithmic]')")
        check("the x axis is logarithmic",
              browser.until(f"{chart}.options.scales.x.type === 'logarithmic'"))
        picked = f"{chart}.data.datasets.filter((d) => d.curve)[0]"
        before = browser.value(f"{picked}.data.map((p) => p.y)")
        browser.click("document.querySelector('input[name=statistic][value=\"interquartile mean\"]')")
        after = browser.value(f"{picked}.data.map((p) => p.y)")
        check("the interquartile mean is the one of the document",
              after == browser.value(f"{picked}.curve.iqm"), after)
        if len(seeds) >= 4:
            check("the interquartile mean is another curve", before != after)

        # By keyboard: the points are read out.
        browser.value(f"{first}.querySelector('canvas').focus()")
        for kind in ("keyDown", "keyUp"):
            browser.call("Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight")
        readout = browser.value(f"{first}.querySelector('.readout').textContent")
        check("an arrow key reads out a point", "n = " in readout, readout)
        browser.value(f"{first}.querySelector('details.points').open = true")
        check("the points are there as a table", browser.until(
            f"{first}.querySelectorAll('details.points tr').length > 5"))
        check("every canvas has a name", browser.value(
            "[...document.querySelectorAll('canvas')].every((c) => c.getAttribute('aria-label'))"))

        browser.open(url, dark=True)
        browser.until(f"Boolean({chart})")
        picture("dark.png")
        browser.open(url, width=390, height=800, dark=True)
        check("it is drawn on a phone", browser.until(f"Boolean({chart})"))
        check("it fits a phone",
              browser.value("document.documentElement.scrollWidth <= innerWidth"),
              browser.value("document.documentElement.scrollWidth"))
        check("dark paper is dark",
              browser.value("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 27)")
        picture("phone-dark.png")

        browser.open(url, scripting=False)
        document = browser.call("DOM.getDocument", depth=-1)
        count = len(browser.call("DOM.querySelectorAll", nodeId=document["root"]["nodeId"],
                                 selector="noscript svg")["nodeIds"])
        check("without scripting there are pictures", count >= 2, count)
        check("and no empty charts", browser.value(
            "getComputedStyle(document.querySelector('#task-charts')).display") == "none")
        picture("without-scripting.png")
        check("no script failed", not browser.errors, browser.errors)
    finally:
        browser.close()

print(f"{failures} failures")
sys.exit(1 if failures else 0)
