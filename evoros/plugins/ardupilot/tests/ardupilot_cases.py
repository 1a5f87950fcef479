"""ArduPilot, or what stands in for it, and short missions that it drives."""

import os
import shlex
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from helpers import with_parts

from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.controller.protocol import Briefing, Pilot
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.scenario import Scenario
from evoros.plugins.ardupilot.controller import ArduPilot
from evoros.sensor.protocol import Mount

REAL = os.environ.get("EVOROS_ARDUROVER")
"""The path of a real ardurover, on which the tests then run."""
VERSION = "ArduRover V4.7.5 (a1b2c3d4)"
PERIOD_S = 0.02
PEER = Path(__file__).parent / "peer" / "ardurover"


def make_binary(folder: Path) -> Path:
    """The real ardurover, or an executable that runs the peer by this Python."""
    if REAL:
        return Path(REAL).absolute()
    path = folder / "ardurover"
    peer = shlex.join([sys.executable, str(PEER)])
    path.write_text(f'#!/bin/sh\n# {VERSION}\nexec {peer} "$@"\n')
    path.chmod(0o755)
    return path


def compose_experiment(binary: Path, *more: str) -> Experiment:
    """The case study's course in one world, driven by ArduPilot without a mission's start."""
    overrides = ("world=boxes", "controller=ardupilot", f"controller.binary={binary}")
    return compose([*overrides, "simulator.time_step=0.02", *more]).build()


def open_field(experiment: Experiment, limit_s: float | None = None) -> Scenario:
    """The scenario without obstacles, with another time limit."""
    world = experiment.world["boxes"]
    limit = world.course.time_limit_s if limit_s is None else limit_s
    course = replace(world.course, time_limit_s=limit)
    ground = tuple(body for body in world.bodies if body.is_ground)
    return replace(
        experiment.scenario, world={"boxes": replace(world, bodies=ground, course=course)}
    )


def with_settings(scenario: Scenario, **changes: object) -> Scenario:
    """The scenario with other values of its controller."""
    (member,) = scenario.members
    controller = member.controller
    assert isinstance(controller, ArduPilot)
    return with_parts(scenario, controller=replace(controller, **changes))  # type: ignore[arg-type]


def with_fault(scenario: Scenario, fault: str) -> Scenario:
    """The scenario with a fault of the peer (``peer/rover_peer/faults.py``)."""
    limit = 4.0 if fault.startswith(("hang", "stop")) else 60.0
    return with_settings(scenario, environment={"PEER_FAULT": fault}, answer_limit_s=limit)


def mission(sonars: int = 6, draws: str = "test") -> Mission:
    """A mission with sonars all around."""
    yaws = np.linspace(-90.0, 90.0, sonars) if sonars > 1 else np.zeros(sonars)
    mounts = tuple(Mount("sonar", "base_link", 0.1, 0.0, 0.166, float(yaw), 12.5) for yaw in yaws)
    return Mission(0, 0, Design(mounts), "boxes", 0, "evaluation", draws)


def find_processes(binary: Path) -> list[int]:
    """The processes that run the binary, or the peer for it, in any namespace below this one."""
    names = {str(binary), str(PEER)}
    processes = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (folder / "cmdline").read_text(errors="replace").split("\0")
            if names & set(words) and "keeper.py" not in words:
                processes.append(int(folder.name))
    return processes


@dataclass(frozen=True, kw_only=True)
class Interrupted(ArduPilot):
    """An ArduPilot whose processes get a signal before one of its decisions."""

    tick: int
    number: signal.Signals

    @contextmanager
    def launch(self, briefing: Briefing) -> Iterator[Pilot]:
        with super().launch(briefing) as pilot:
            yield InterruptedPilot(pilot, self)


class InterruptedPilot:
    """Sends the signal, and lets the pilot go on."""

    def __init__(self, pilot: Pilot, settings: Interrupted) -> None:
        self._pilot, self._settings, self._tick = pilot, settings, 0

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        if self._tick == self._settings.tick:
            processes = find_processes(Path(self._settings.binary))
            assert processes
            for process in processes:
                with suppress(ProcessLookupError):
                    os.kill(process, self._settings.number)
        self._tick += 1
        return self._pilot.exchange(time, state, leg, readings, command)
