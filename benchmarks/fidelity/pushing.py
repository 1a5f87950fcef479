"""Compares how the plane and the engines push bodies, and where they report contact.

The rover drives 3.5 s straight on and meets a body in the middle, beside it, or with a corner. The
place of contact is the distance from a crate ahead at which contact is first reported, found by
bisection. Prints the tables of docs/fidelity.md:

    python benchmarks/fidelity/pushing.py
"""

import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests"))  # probes of engines
from pybullet_cases import box, going_on, level
from rigid_cases import RIGID, probe

from evoros.base.arrays import CONTACT, STATE_SIZE, Array
from evoros.base.packing import unpack
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.engines.planar_bodies import Placed
from evoros.simulator.engines.planar_layout import Memory
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator, open_alone

SECONDS, SPEED = 3.5, 0.3
AHEAD_M = 0.6
NEAR_M, FAR_M = 0.2, 0.3
"""Bounds of the distance of the crate's face at which the rover touches it."""


def crate(y: float) -> Body:
    """A crate of 1 kg whose centre is beside the rover's axis by ``y``."""
    size = (0.4, 0.4, 0.4)
    return replace(box(f"crate, {100 * y:g} cm aside", AHEAD_M, y, size, 1.0), friction=0.3)


BODIES = (
    crate(0.0),
    crate(0.1),
    crate(0.2),
    crate(-0.25),
    Body("barrel", Pose((AHEAD_M, 0.0, 0.2)), (Shape("cylinder", (0.2, 0.4)),), 1.0, 0.3),
)


def push(simulator: Simulator, experiment: Experiment, body: Body) -> Array:
    """Return the way (x, y) [m] that a body goes."""
    world = going_on(level(experiment, body))
    with open_alone(simulator.open, experiment.robot, world) as opened:
        simulation: Any = opened
        simulation.advance(np.array([SPEED, 0.0]), SECONDS)
        if isinstance(simulator, Planar):
            x, y = unpack(Placed, unpack(Memory, simulation.memory).movables).poses[0, :2]
        else:
            x, y, _ = probe(simulation).movable()[0].position
    start_x, start_y, _ = body.pose.position
    return np.array([x - start_x, y - start_y])


def find_contact(simulator: Simulator, experiment: Experiment) -> float:
    """Return the greatest distance [m] of a face ahead at which contact is reported at rest."""
    near, far = NEAR_M, FAR_M
    while far - near > 1e-6:
        middle = (near + far) / 2
        wall = box("wall", middle + 0.5)
        state = np.zeros(STATE_SIZE)
        with open_alone(simulator.open, experiment.robot, level(experiment, wall)) as simulation:
            simulation.advance(np.zeros(2), simulator.time_step)
            simulation.observe(state)
        near, far = (middle, far) if state[CONTACT] > 0.0 else (near, middle)
    return near


def main() -> None:
    """Print both tables."""
    experiment = compose(["simulator=planar"]).build()
    engines = {name: kind() for name, kind in RIGID.items()}
    simulators: Mapping[str, Simulator] = {"planar": Planar(), **engines}
    print("| body | " + " | ".join(simulators) + " |")
    print("|---" * (len(simulators) + 1) + "|")
    for body in BODIES:
        ways = [push(simulator, experiment, body) for simulator in simulators.values()]
        cells = [
            f"{math.hypot(*way):.3f} m, {math.degrees(math.atan2(way[1], way[0])):.1f} deg"
            for way in ways
        ]
        print(f"| {body.name} | " + " | ".join(cells) + " |")
    places = [find_contact(simulator, experiment) for simulator in simulators.values()]
    print("| contact with a wall | " + " | ".join(f"{1000 * x:.3f} mm" for x in places) + " |")


if __name__ == "__main__":
    main()
