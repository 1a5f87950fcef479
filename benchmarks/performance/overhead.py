"""Measures what a mission costs besides the engine.

Runs random designs through the three worlds of the case study. Each mission is timed as a whole
(``run_mission``: robot, building, filters, controller, metrics). Its calls of the engine, which are
``stepSimulation`` and ``rayTestBatch`` or ``mj_step`` and ``mj_multiRay``, are then repeated and
timed alone, with the same robot under the same commands. The script checks that the robot ends in
the same pose, to the last bit. The two alternate, and the processor's time is measured, so that a
busy machine slows both:

    python benchmarks/performance/overhead.py [designs] [pybullet|mujoco]
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from time import thread_time
from typing import Any

import numpy as np

from evoros.base.arrays import STATE_SIZE, Array, X, Y
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import AT_X, AT_Y, Mission
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_bodies import VISIBLE
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.mujoco import models as mujoco_models
from evoros.simulator.protocol import PlacedRobot, Simulator, open_alone
from evoros.simulator.pybullet import IDLE, PyBullet
from evoros.world.model import World

Command = tuple[Array, float]


class Recorder(Simulator):
    """A simulator that records the commands of its simulation."""

    packages = ()

    def __init__(self, simulator: PyBullet | Mujoco) -> None:
        self.simulator, self.time_step = simulator, simulator.time_step
        self.commands: list[Command] = []

    def open(self, robots: Sequence[PlacedRobot], world: World) -> Any:
        """Open a simulation of the simulator, with an empty record."""
        self.commands = []
        return _Recording(self.simulator.open(robots, world), self.commands)


class _Recording:
    """A simulation that records its commands."""

    def __init__(self, opened: Any, commands: list[Command]) -> None:
        self.opened, self.commands = opened, commands

    def __enter__(self) -> "_Recording":
        simulation = self.opened.__enter__()
        self.observe, self.sense = simulation.observe, simulation.sense
        self._advance = simulation.advance
        return self

    def __exit__(self, *error: Any) -> Any:
        return self.opened.__exit__(*error)

    def advance(self, command: Array, duration: float) -> None:
        """Record the command and follow it."""
        self.commands.append((command.copy(), duration))
        self._advance(command, duration)


def bare(
    scenario: Scenario, robot: Robot, world: World, commands: list[Command], sense_every: int
) -> tuple[float, Array]:
    """The time [s] in the engine's two calls alone, and the state at the end."""
    state = np.zeros(STATE_SIZE)
    spent = 0.0
    with open_alone(scenario.simulator.open, robot, world) as opened:
        simulation: Any = opened
        bullet, body = simulation._bullet, simulation._model.robots[0].body
        rays = [(starts, ends) for starts, ends, _ in simulation._vehicles[0]._rays._batches]
        step = scenario.simulator.time_step
        for index, (command, duration) in enumerate(commands):
            if index % sense_every == 0:
                begin = thread_time()
                for starts, ends in rays:
                    bullet.rayTestBatch(
                        starts,
                        ends,
                        parentObjectUniqueId=body,
                        parentLinkIndex=-1,
                        collisionFilterMask=VISIBLE,
                    )
                spent += thread_time() - begin
            simulation.advance(command, 0.0)
            begin = thread_time()
            for _ in range(round(duration / step)):
                bullet.stepSimulation()
            spent += thread_time() - begin
        simulation.observe(state)
    return spent, state


def bare_mujoco(
    scenario: Scenario, robot: Robot, world: World, commands: list[Command]
) -> tuple[float, Array]:
    """The time [s] in MuJoCo's two calls alone, and the state at the end."""
    state, ranges, spent = np.zeros(STATE_SIZE), np.zeros(robot.beam_count), 0.0
    with open_alone(scenario.simulator.open, robot, world) as opened:
        simulation: Any = opened
        engine, data = simulation._model.model, simulation._model.data
        beams = simulation._vehicles[0]._rays
        cast = beams._call
        step, move = scenario.simulator.time_step, simulation._step
        calls: list[tuple[Any, ...]] = []
        beams._call = lambda *arguments: calls.append(arguments)
        for command, duration in commands:
            calls.clear()
            beams._normals[:] = 0.0  # of the calls before: no ray starts inside a shape
            simulation.sense(ranges)
            begin = thread_time()
            for arguments in calls:
                cast(*arguments)
            spent += thread_time() - begin
            simulation.advance(command, 0.0)
            begin = thread_time()
            for _ in range(round(duration / step)):
                move(engine, data)
            spent += thread_time() - begin
        simulation.observe(state)
    return spent, state


def pair(experiment: Experiment, recorder: Recorder, mission: Mission) -> tuple[float, ...]:
    """The time [s] of the mission, of its bare calls, and that it simulates."""
    scenario = experiment.scenario
    _, track = run_mission(replace(scenario, simulator=recorder), mission)
    IDLE.forget()  # so that building the model counts, as for every new design
    mujoco_models.cache_clear()
    begin = thread_time()
    (outcome,), _ = run_mission(scenario, mission)
    whole = thread_time() - begin
    (equipped,) = scenario.equip(mission.design)
    robot, world = equipped.robot, scenario.world[mission.world]
    if isinstance(scenario.simulator, Mujoco):
        spent, state = bare_mujoco(scenario, robot, world, recorder.commands)
    else:
        spent, state = bare(scenario, robot, world, recorder.commands, 1)
    assert (track[-1, [AT_X, AT_Y]] == state[[X, Y]]).all(), "the bare calls led to another state"
    return whole, spent, outcome.time_s


def main(designs: int, engine: str) -> None:
    experiment = compose(["failure=random", f"simulator={engine}"]).build()
    assert isinstance(experiment.simulator, PyBullet | Mujoco)
    recorder = Recorder(experiment.simulator)
    rng = np.random.default_rng(1)
    rows: dict[str, list[tuple[float, ...]]] = {world: [] for world in experiment.world}
    for design_id in range(designs):
        design = experiment.space.decode(rng.random(experiment.space.size))
        for world in experiment.world:
            mission = Mission(0, design_id, design, world, 0, "evaluation", f"overhead:{design_id}")
            rows[world].append(pair(experiment, recorder, mission))
    print("world     missions  simulated [s]   ratio: median, min, max, of the sums   sim s/s")
    for world, measured in [
        *rows.items(),
        ("all", [row for world_rows in rows.values() for row in world_rows]),
    ]:
        whole, spent, simulated = np.array(measured).T
        ratio = whole / spent
        print(
            f"{world:<10}{len(measured):>8}{simulated.sum():>15.0f}{np.median(ratio):>16.3f}"
            f"{ratio.min():>7.3f}{ratio.max():>10.3f}{whole.sum() / spent.sum():>13.3f}"
            f"{simulated.sum() / whole.sum():>10.0f}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 8, (sys.argv[2:] or ["pybullet"])[0])
