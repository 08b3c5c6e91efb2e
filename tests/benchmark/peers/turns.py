"""The worker's side of compare.py: a process that times its cases when it is its turn.

A line of JSON each way on standard streams. First the worker says who it is, {"facts": {...}},
or why it cannot run, {"error": "..."}. Then it answers each {"case": NAME, "seconds": S,
"least": N} with {"seconds": [...]}: what single calls cost, N of them at least and S seconds
of them at least. Between its turns it waits for a line and costs nothing.

Times are processor time of the whole process, so that threads of a library count and other
programs on the machine do not.
"""
import json
import os
import sys
import time


def serve(prepare):
    """prepare() returns facts and the cases: a name to (function, how many units a call does)."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what libraries print is no answer

    def answer(value):
        answers.write(json.dumps(value) + "\n")

    try:
        facts, cases = prepare()
        for function, _ in cases.values():
            function()  # compiles, allocates
    except (Exception, SystemExit) as error:  # whatever a library that does not fit here raises
        answer({"error": f"{type(error).__name__}: {error}".splitlines()[0]})
        raise SystemExit(1) from error
    answer({"facts": facts})
    for line in sys.stdin:
        request = json.loads(line)
        function, units = cases[request["case"]]
        seconds, spent = [], 0.0
        while len(seconds) < request["least"] or spent < request["seconds"]:
            begin = time.process_time()
            function()
            seconds.append((time.process_time() - begin) / units)
            spent += seconds[-1] * units
        answer({"seconds": seconds})
