"""Prints how robots move in every engine, as the short drive before a run measures it.

The table gives the share of the commanded motion (speed straight ahead and back, yaw rate at a
quarter of full lock, half and full lock) and the drift at rest, at default steps. Without
arguments it has the bundled robots. Each argument has the overrides of one more robot:

    python benchmarks/fidelity/drive_table.py "robot=own robot.description=src/my_robot.urdf"
"""

import sys
from collections.abc import Iterator, Sequence

from evoros.base.errors import InputError, SimulationError, single_line
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.plugins.gazebo.simulator import Gazebo
from evoros.preflight.drive import choose_speed, empty_world
from evoros.preflight.trial_drive import MANOEUVRES, Trial
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator
from evoros.simulator.pybullet import PyBullet

BUNDLED = ("robot=erle_rover", "robot=courier", "robot=mule", "robot=two_wheeler")
ENGINES: dict[str, Simulator] = {
    "planar, 20 ms": Planar(),
    "PyBullet, 25 ms": PyBullet(),
    "PyBullet, 2.5 ms": PyBullet(time_step=0.0025, solver_iterations=50),
    "MuJoCo, 10 ms": Mujoco(),
    "Gazebo, 5 ms": Gazebo(),
}


def build(overrides: str) -> Experiment:
    """Build an experiment with a robot and sensors that suit any robot."""
    return compose([*overrides.split(), "design=around", "simulator=planar"]).build()


def make_rows(experiment: Experiment) -> Iterator[Sequence[str]]:
    """Yield the row of each engine."""
    robot, speed = experiment.robot, choose_speed(experiment.members[0])
    world = empty_world(next(iter(experiment.world.values())))
    for engine, simulator in ENGINES.items():
        try:
            trial = Trial(simulator, robot, world, speed).run()
        except SimulationError as error:
            yield engine, single_line(error)
            continue
        shares = (f"{trial.shares[manoeuvre]:.2f}" for manoeuvre in MANOEUVRES)
        yield engine, f"{speed:g}", *shares, f"{1e3 * trial.rest.drift_mps:.1f}"


def main(robots: Sequence[str]) -> None:
    names = " | ".join(manoeuvre.name for manoeuvre in MANOEUVRES)
    print(f"| robot | drive | engine | speed [m/s] | {names} | drift at rest [mm/s] |")
    print("|---" * (5 + len(MANOEUVRES)) + "|")
    for overrides in robots:
        try:
            experiment = build(overrides)
        except InputError as error:
            print(f"| {overrides} | {single_line(error)} |", flush=True)
            continue
        robot = experiment.robot
        for row in make_rows(experiment):
            kind = type(robot.drive).__name__
            print(f"| {robot.name} | {kind} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or BUNDLED)
