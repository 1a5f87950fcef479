"""Measures what a mission in Gazebo costs besides the library, and how fast missions are.

Runs random designs through the three worlds of the case study, for at most a minute of simulated
time. The time of a mission is that of the processor in this process and in the server, which has
the world open; opening it once for each design has a column of its own. The bare calls are the same
steps, asked of the server alone, and the calls of MuJoCo that cast the rays; the script checks that
both end in the same pose, to the last bit:

    python benchmarks/performance/gazebo_overhead.py [designs] [time steps in ms ...]
"""

import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.plugins.gazebo import simulator as gazebo
from evoros.plugins.gazebo.server import Engine, GazeboServer, Operation, Scene
from evoros.simulator.engines.mujoco_rays import MujocoSight

TICKS = os.sysconf("SC_CLK_TCK")
REPEATS, TIME_LIMIT_S = 3, 60


class Log:
    """A mission's requests to the server, and the times [s] to open its world and cast rays."""

    def __init__(self) -> None:
        self.requests: list[tuple[Any, ...]] = []
        self.server: GazeboServer | None = None
        self.answer: Array = np.zeros(0)
        self.casting_s = self.opening_s = 0.0
        self.ask, self.cast, self.prepare = GazeboServer.ask, MujocoSight.cast, Engine.prepare

    def start(self) -> None:
        """Begin a log of the missions to come."""
        log = self

        def ask(server: GazeboServer, operation: Operation, *arguments: Any) -> Array:
            log.server = server
            if operation is Operation.ADVANCE:
                log.requests.append(arguments)
            log.answer = log.ask(server, operation, *arguments)
            return log.answer

        def cast(sight: MujocoSight, ranges: Array) -> None:
            begin = thread_time()
            log.cast(sight, ranges)
            log.casting_s += thread_time() - begin

        def prepare(engine: Engine, *arguments: Any) -> Scene:
            begin = perf_counter()
            scene = log.prepare(engine, *arguments)
            log.opening_s = perf_counter() - begin
            return scene

        GazeboServer.ask, MujocoSight.cast = ask, cast  # type: ignore[method-assign,assignment]
        Engine.prepare = prepare  # type: ignore[method-assign,assignment]

    def stop(self) -> None:
        """Let missions run as they do."""
        GazeboServer.ask, MujocoSight.cast = self.ask, self.cast  # type: ignore[method-assign]
        Engine.prepare = self.prepare  # type: ignore[method-assign]


def server_time() -> float:
    """Return the processor's time of this process's only server [s], its grandchild."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, fields = path.read_text().rpartition(")")
            keeper = Path(f"/proc/{fields.split()[1]}/stat").read_text().rpartition(")")[2]
        except OSError:  # it has ended
            continue
        if "(gazebo_server" in name and int(keeper.split()[1]) == os.getpid():
            user, system = fields.split()[11:13]
            return (int(user) + int(system)) / TICKS
    return 0.0


def measure(experiment: Experiment, mission: Mission) -> Array:
    """Return the times [s] of a mission: as it is, its bare calls, on the wall, to open, simulated.

    The times of the processor are the least of ``REPEATS`` in turn.
    """
    times = []
    for _ in range(REPEATS):
        gazebo.IDLE.forget()
        log = Log()
        log.start()
        simulated = fly(experiment, mission)
        log.stop()
        started = perf_counter()
        whole = time_processors(lambda: fly(experiment, mission))
        wall = perf_counter() - started
        bare = time_processors(partial(repeat_requests, log), own=False) + log.casting_s
        times.append((whole, bare, wall, log.opening_s, simulated))
    least: Array = np.min(times, axis=0)
    return least


def time_processors(act: Callable[[], object], own: bool = True) -> float:
    """Return the time [s] of the server's processor, and of this thread's if it is to count."""
    server, here = server_time(), thread_time()
    act()
    return server_time() - server + own * (thread_time() - here)


def fly(experiment: Experiment, mission: Mission) -> float:
    """Run a mission, and return its simulated time [s]."""
    (outcome,), _ = run_mission(experiment.scenario, mission)
    return outcome.time_s


def repeat_requests(log: Log) -> None:
    """Ask the server for a mission's steps again, which must end in the same state."""
    assert log.server is not None
    log.server.ask(Operation.RESET, log.requests[0][0])
    for arguments in log.requests:
        answer = log.server.ask(Operation.ADVANCE, *arguments)
    assert answer.tobytes() == log.answer.tobytes(), "the bare calls led to another state"


def main(designs: int, steps: list[float]) -> None:
    print(
        "| step [ms] | missions | simulated s a s of the processor | of the wall | overhead | "
        "to open [s] |"
    )
    print("|---|---|---|---|---|---|")
    for step in steps:
        experiment = compose(
            [
                "failure=random",
                "simulator=gazebo",
                f"simulator.time_step={step / 1000}",
                f"course.time_limit_s={TIME_LIMIT_S}",
            ]
        ).build()
        rng, missions = np.random.default_rng(1), list[Mission]()
        for i in range(designs):
            design = experiment.space.decode(rng.random(experiment.space.size))
            missions += [
                Mission(0, i, design, world, 0, "evaluation", f"overhead:{i}")
                for world in experiment.world
            ]
        fly(experiment, missions[0])  # compiled
        times = np.array([measure(experiment, mission) for mission in missions])
        whole, bare, wall, opening, simulated = times.sum(axis=0)
        print(
            f"| {step:g} | {len(missions)} | {simulated / whole:.0f} | {simulated / wall:.0f} | "
            f"{whole / bare:.3f} | {opening / len(missions):.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 4,
        [float(word) for word in sys.argv[2:]] or [1.0, 4.0, 5.0],
    )
