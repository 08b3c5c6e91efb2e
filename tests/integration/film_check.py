#!/usr/bin/env python3
"""Films an episode as a user does, and plays the file in headless Chromium to its end.

usage: film_check.py RUNNER

Exits 77, which CTest reports as skipped, without Chromium or where no film can be made.
"""
import os
import subprocess
import sys
import tempfile

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../chromium"))
from browser import Browser, chromium

MODEL = """<mujoco><worldbody><light pos="0 0 3"/>
<body pos="0 0 1"><joint name="swing" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.05"/></body>
</worldbody><actuator><motor joint="swing" ctrlrange="-1 1" ctrllimited="true" gear="3"/></actuator></mujoco>
"""

PAGE = """<video src="film.mp4" muted></video><script>
const film = document.querySelector("video");
const end = (how) => { film.dataset.end ||= how; };
film.onerror = () => end("error: " + film.error.message);
film.onended = () => end("played");
film.play().catch((error) => end("refused: " + error));
</script>"""

if chromium is None:
    print("skipped: no chromium")
    sys.exit(77)

# Chromium's helpers may still write to the profile after it has gone.
with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
    for name, text in {"pole.xml": MODEL, "page.html": PAGE}.items():
        with open(os.path.join(folder, name), "w") as file:
            file.write(text)
    settings = ["model=pole.xml", "reward=1", "control_step=0.02", "episode_steps=100"]
    made = subprocess.run(
        [sys.argv[1], "render", "--env", "mjcf:pole", "--planner", "random", "--width", "160",
         "--out", "film.mp4", *(word for text in settings for word in ("--set", "mjcf." + text))],
        cwd=folder, stderr=subprocess.PIPE, text=True)
    if made.returncode == 69:
        print("skipped: " + made.stderr.strip())
        sys.exit(77)
    assert made.returncode == 0, made.stderr

    browser = Browser(os.path.join(folder, "profile"))
    try:
        browser.open("file://" + os.path.join(folder, "page.html"))
        film = "document.querySelector('video')"
        assert browser.until(f"Boolean({film}.dataset.end)"), "the film does not come to its end"
        found = browser.value(f"({{end: {film}.dataset.end, seconds: {film}.duration,"
                              f" width: {film}.videoWidth}})")
    finally:
        browser.close()
    print(found)
    assert found["end"] == "played", found
    assert abs(found["seconds"] - 2) < 0.2, found  # 100 steps of 0.02 s, in simulated time
    assert found["width"] == 160, found
