"""Measures what a mission in Gazebo costs besides the library, and how fast missions are.

Runs random designs through the three worlds of the case study. The time of a mission is that of the
processor in this process and in the server, which opens the world for each design. The bare calls
are the same steps, asked of the server alone, and the calls of MuJoCo that cast the rays; the
script checks that both end in the same pose, to the last bit:

    python benchmarks/performance/gazebo_overhead.py [designs] [time steps in ms ...]
"""

import os
import sys
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.simulator import gazebo
from evoros.simulator.engines.gazebo_server import GazeboServer, Operation
from evoros.simulator.engines.mujoco_sight import MujocoSight

TICKS = os.sysconf("SC_CLK_TCK")


class Log:
    """The requests to the server and the ray casts of missions, with the ray casts' time [s]."""

    def __init__(self) -> None:
        self.requests: list[tuple[Any, ...]] = []
        self.server: GazeboServer | None = None
        self.answer: Array = np.zeros(0)
        self.casting_s = 0.0
        self.ask, self.cast = GazeboServer.ask, MujocoSight.cast

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

        GazeboServer.ask, MujocoSight.cast = ask, cast  # type: ignore[method-assign,assignment]

    def stop(self) -> None:
        """Let missions run as they do."""
        GazeboServer.ask, MujocoSight.cast = self.ask, self.cast  # type: ignore[method-assign]


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


def measure(experiment: Experiment, missions: list[Mission]) -> tuple[float, float, float, float]:
    """Return the times [s] of missions, of their bare calls, on the wall, and simulated."""
    whole = bare = wall = simulated = 0.0
    for mission in missions:
        gazebo.forget_models()
        before, begin, started = server_time(), thread_time(), perf_counter()
        (outcome,), _ = run_mission(experiment.scenario, mission)
        wall += perf_counter() - started
        whole += thread_time() - begin + server_time() - before
        simulated += outcome.time_s
        log = Log()
        log.start()
        run_mission(experiment.scenario, mission)
        log.stop()
        assert log.server is not None
        number, last = log.requests[0][0], log.answer
        log.server.ask(Operation.RESET, number)
        before = server_time()
        for arguments in log.requests:
            answer = log.server.ask(Operation.ADVANCE, *arguments)
        bare += server_time() - before + log.casting_s
        assert answer.tobytes() == last.tobytes(), "the bare calls led to another state"
    return whole, bare, wall, simulated


def main(designs: int, steps: list[float]) -> None:
    print("| step [ms] | missions | simulated s a s of the processor | of the wall | overhead |")
    print("|---|---|---|---|---|")
    for step in steps:
        experiment = compose(
            ["failure=random", "simulator=gazebo", f"simulator.time_step={step / 1000}"]
        ).build()
        rng, missions = np.random.default_rng(1), list[Mission]()
        for i in range(designs):
            design = experiment.space.decode(rng.random(experiment.space.size))
            missions += [
                Mission(0, i, design, world, 0, "evaluation", f"overhead:{i}")
                for world in experiment.world
            ]
        run_mission(experiment.scenario, missions[0])  # compiled
        whole, bare, wall, simulated = measure(experiment, missions)
        print(
            f"| {step:g} | {len(missions)} | {simulated / whole:.0f} | {simulated / wall:.0f} | "
            f"{whole / bare:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 4,
        [float(word) for word in sys.argv[2:]] or [1.0, 4.0, 5.0],
    )
