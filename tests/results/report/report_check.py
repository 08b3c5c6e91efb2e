#!/usr/bin/env python3
"""Opens a report in headless Chromium, hovers, clicks and checks what is shown.

usage: report_check.py RESULTS_PROGRAM DATABASE [SCREENSHOT_FOLDER]

Talks to Chromium over its debugging pipe with the standard library alone. The
network is cut off, so whatever the page needs must be in it. Exits 77 without
Chromium, which CTest reports as skipped.
"""
import base64
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time

program, database = sys.argv[1:3]
screenshots = sys.argv[3] if len(sys.argv) > 3 else None
chromium = shutil.which("chromium") or shutil.which("chromium-browser")
if chromium is None:
    print("skipped: no chromium")
    sys.exit(77)

failures = 0


def check(what, ok, found=""):
    global failures
    if not ok:
        failures += 1
        print(f"FAILED: {what}: {found}")


class Browser:
    """Chromium's debugging protocol over file descriptors 3 and 4."""

    def __init__(self, folder):
        to_browser, self.write_end = os.pipe()
        self.read_end, from_browser = os.pipe()
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe",
                 "--disable-dev-shm-usage", "--host-resolver-rules=MAP * ~NOTFOUND",
                 f"--user-data-dir={folder}", "--no-first-run", "about:blank"]

        def descriptors():
            os.dup2(to_browser, 13)
            os.dup2(from_browser, 14)
            os.dup2(13, 3)
            os.dup2(14, 4)

        self.process = subprocess.Popen([chromium, *flags], preexec_fn=descriptors,
                                        close_fds=False, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self.buffer = b""
        self.number = 0
        self.session = None
        self.errors = []

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session and not method.startswith("Target."):
            message["sessionId"] = self.session
        os.write(self.write_end, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def receive(self):
        while b"\0" not in self.buffer:
            chunk = os.read(self.read_end, 1 << 16)
            if not chunk:
                raise RuntimeError("Chromium went away")
            self.buffer += chunk
        raw, self.buffer = self.buffer.split(b"\0", 1)
        message = json.loads(raw)
        if message.get("method") == "Runtime.exceptionThrown":
            details = message["params"]["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", str(details)))
        return message

    def open(self, url, width=1200, height=900, scripting=True, dark=False):
        if self.session:
            self.call("Target.closeTarget", targetId=self.target)
            self.session = None
        self.target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=self.target,
                                 flatten=True)["sessionId"]
        self.call("Runtime.enable")
        self.call("Page.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=width < 600)
        self.call("Emulation.setScriptExecutionDisabled", value=not scripting)
        self.call("Emulation.setEmulatedMedia",
                  features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        self.call("Page.navigate", url=url)
        while self.receive().get("method") != "Page.loadEventFired":
            pass

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True,
                           awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def until(self, expression, seconds=60):
        end = time.time() + seconds
        while time.time() < end:
            if self.value(expression):
                return True
            time.sleep(0.05)
        return False

    def move(self, x, y):
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def click(self, selector):
        x, y = self.value(f"(() => {{ const e = {selector}; e.scrollIntoView({{block: 'center'}});"
                          " const r = e.getBoundingClientRect();"
                          " return [r.x + r.width / 2, r.y + r.height / 2]; })()")
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def picture(self, name):
        if screenshots is None:
            return
        data = self.call("Page.captureScreenshot", format="png")["data"]
        with open(os.path.join(screenshots, name), "wb") as file:
            file.write(base64.b64decode(data))

    def close(self):
        self.session = None
        os.write(self.write_end, json.dumps({"id": 0, "method": "Browser.close"}).encode() + b"\0")
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


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
    try:
        browser.open(url)
        check("the first chart is drawn", browser.until(f"Boolean({chart})"))
        check("the time chart is drawn", browser.until(
            "Boolean(Chart.getChart(document.getElementById('time-chart')))"))
        check("no two elements have the same id", browser.value(
            "(() => { const ids = [...document.querySelectorAll('[id]')].filter((e) => "
            "!e.closest('svg')).map((e) => e.id); return ids.length === new Set(ids).size; })()"))
        browser.picture("page.png")
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
        browser.picture("hover.png")

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
        browser.picture("single.png")
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
        browser.picture("dark.png")
        browser.open(url, width=390, height=800, dark=True)
        check("it is drawn on a phone", browser.until(f"Boolean({chart})"))
        check("it fits a phone",
              browser.value("document.documentElement.scrollWidth <= innerWidth"),
              browser.value("document.documentElement.scrollWidth"))
        check("dark paper is dark",
              browser.value("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 27)")
        browser.picture("phone-dark.png")

        browser.open(url, scripting=False)
        document = browser.call("DOM.getDocument", depth=-1)
        count = len(browser.call("DOM.querySelectorAll", nodeId=document["root"]["nodeId"],
                                 selector="noscript svg")["nodeIds"])
        check("without scripting there are pictures", count >= 2, count)
        check("and no empty charts", browser.value(
            "getComputedStyle(document.querySelector('#task-charts')).display") == "none")
        browser.picture("without-scripting.png")
        check("no script failed", not browser.errors, browser.errors)
    finally:
        browser.close()

print(f"{failures} failures")
sys.exit(1 if failures else 0)
