"""A mission is at rest when all its processes sleep and nothing is being worked on."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from busy import busy_cores
from helpers import ROOT

from evoros.bridge.process import start_process
from evoros.plugins.ros.bridge.rest import WatchedThread, tells_places

SCRIPTS = ROOT / "evoros" / "plugins" / "ros" / "bridge"
RING = ROOT / "tests" / "nodes" / "rest_ring.py"


def output(kind: str, where: str) -> list[str]:
    """Return the lines that the ring prints in its own namespaces or in the common ones."""
    command = [sys.executable, str(RING), kind, where, str(SCRIPTS.parent)]
    if kind == "hide" and os.geteuid() == 0:  # root may look at all without it
        command = ["setpriv", "--bounding-set=-sys_ptrace", *command]
    with start_process(command, isolate=where == "isolated") as process:
        assert not process.running(wait_s=200.0)
        return process.read_log().splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("where", ["isolated", "shared"])
def test_at_rest_all_work_is_done_also_on_busy_cores(where: str) -> None:
    with busy_cores():
        assert output("ring", where) == ["True", "0"]  # never too early


@pytest.mark.slow
@pytest.mark.parametrize("where", ["isolated", "shared"])
def test_a_process_that_computes_is_not_at_rest_and_named(where: str) -> None:
    assert output("spin", where) == ["True", f"{sys.executable} {RING} spinner"]


def test_a_stopped_process_is_not_at_rest_and_named() -> None:
    rested, name = output("stop", "isolated")
    assert rested == "True"
    assert f"{RING} station" in name


@pytest.mark.parametrize("where", ["isolated", "shared"])
def test_a_process_that_hides_in_mid_mission_is_named_in_one_line(where: str) -> None:
    rested, line = output("hide", where)
    assert rested == "True"
    assert f"{RING} station" in line
    assert "syscall" in line


@pytest.mark.parametrize("places", [True, False])
@pytest.mark.parametrize(("sleep_s", "waits"), [(3600.0, True), (0.0003, False)])
def test_a_long_sleep_is_rest_and_a_short_one_is_work(
    sleep_s: float, waits: bool, places: bool
) -> None:
    """rospy.spin() and a publisher of rospy sleep so, and the kernel reports the same of both.

    In a process of its own, because a thread here would also wait for the interpreter's lock.
    """
    code = f"import time\nprint(flush=True)\nwhile True: time.sleep({sleep_s})"
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        watched = WatchedThread(process.pid, process.pid)
        told = places and tells_places()
        while waits and not watched.waits(told):
            pass  # it falls asleep soon
        looks = []
        for _ in range(300):
            time.sleep(0.0002)
            looks.append(watched.waits(told))
        watched.close()
        process.kill()
    # A look at a busy machine may meet the end of one call and, a moment later, the next sleep.
    assert looks.count(not waits) <= (0 if waits else 3)


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.py")), ids=lambda path: path.name)
def test_the_scripts_for_ros_parse_with_the_oldest_python_that_has_it(script: Path) -> None:
    ast.parse(script.read_text(), feature_version=(3, 8))
