"""A mission is at rest when all its processes sleep and nothing is being worked on."""

import ast
import os
import sys
from pathlib import Path

import pytest
from helpers import ROOT
from ros_cases import busy_cores

from evoros.bridge.process import start_process

SCRIPTS = ROOT / "evoros" / "bridge" / "ros"
RING = ROOT / "tests" / "nodes" / "rest_ring.py"


def output(kind: str, where: str) -> list[str]:
    """The lines that the ring printed, watched in namespaces of its own or in those of all."""
    command = [sys.executable, str(RING), kind, where, str(SCRIPTS)]
    if kind == "hide" and os.geteuid() == 0:  # root may look at all without it
        command = ["setpriv", "--bounding-set=-sys_ptrace", *command]
    with start_process(command, isolate=where == "isolated") as process:
        assert not process.running(wait_s=60.0)
        return process.read_log().splitlines()


@pytest.mark.parametrize("where", ["isolated", "shared"])
def test_at_rest_all_work_is_done_also_on_busy_cores(where: str) -> None:
    with busy_cores():
        assert output("ring", where) == ["True", "0"]  # never too early


@pytest.mark.parametrize("where", ["isolated", "shared"])
def test_a_process_that_computes_is_not_at_rest_and_named(where: str) -> None:
    rested, *names = output("spin", where)
    assert rested == "False"
    assert names == [f"{sys.executable} {RING} spinner"]


def test_a_stopped_process_is_not_at_rest_and_named() -> None:
    rested, name = output("stop", "isolated")
    assert rested == "False"
    assert f"{RING} station" in name


@pytest.mark.parametrize("where", ["isolated", "shared"])
def test_a_process_that_hides_in_mid_mission_is_named_in_one_line(where: str) -> None:
    rested, line = output("hide", where)
    assert rested == "True"
    assert f"{RING} station" in line
    assert "syscall" in line


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.py")), ids=lambda path: path.name)
def test_the_scripts_for_ros_parse_with_the_oldest_python_that_has_it(script: Path) -> None:
    ast.parse(script.read_text(), feature_version=(3, 8))
