"""Drives straight ahead until its fault, given as FAULT@TICK or FAULT@start.

The second argument is a file that gets a line at each start.
"""

import json
import os
import signal
import sys
import time

ANSWERS = {
    "rubbish": "what?\n",
    "nan": "[1, NaN, 0.0]\n",
    "infinity": "[1, 0.2, Infinity]\n",
    "mode": "[9, 0.2, 0.0]\n",
    "short": "[1]\n",
    "two": "[1, 0.2, 0.0]\n[1, 0.2, 0.0]\n",
    "flood": " " * (3 << 20),
    "refuse": '{"refused": "no\\nwheels"}\n',
}


def happen(fault: str) -> None:
    print("these are the\nlast words", flush=True)
    if fault in ANSWERS:
        os.write(answers.fileno(), ANSWERS[fault].encode())
    elif fault == "exit":
        os._exit(3)
    elif fault == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif fault == "stop":
        os.kill(os.getpid(), signal.SIGSTOP)
    elif fault == "close":
        lines.close()
        answers.close()
    time.sleep(600)


fault, _, when = sys.argv[1].partition("@")
with open(sys.argv[2], "a") as tally:
    tally.write("started\n")
lines = os.fdopen(int(os.environ["EVOROS_IN"]))
answers = os.fdopen(int(os.environ["EVOROS_OUT"]), "w", buffering=1)
parameters = json.loads(lines.readline())["parameters"]
if when == "start":
    happen(fault)
answers.write('{"ready": true}\n')
for tick, line in enumerate(lines):
    if str(tick) == when:
        happen(fault)
    decided = json.loads(line)[0] < parameters.get("until_s", 1e9)
    answers.write("[1, 0.2, 0.1]\n" if decided else "[0, 0, 0]\n")
