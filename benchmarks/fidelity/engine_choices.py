"""The time of a PyBullet step with and without each choice in setting up the engine."""

from time import thread_time
from typing import Any

import numpy as np
from lxml import etree

from evoros.robot.model import Robot
from evoros.simulator.engines import pybullet_bodies, pybullet_model, pybullet_robot
from evoros.simulator.engines.pybullet_model import import_pybullet
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World


class Without:
    """The engine's module without one of the choices in building bodies."""

    def __init__(self, bullet: Any, choice: str) -> None:
        self._bullet, self._choice = bullet, choice

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bullet, name)

    def createMultiBody(self, *args: Any, **named: Any) -> Any:  # noqa: N802
        """Create a body, for one choice in the engine's usual coordinates."""
        if self._choice == "reduced":
            named["useMaximalCoordinates"] = False
        return self._bullet.createMultiBody(*args, **named)

    def changeDynamics(self, *args: Any, **named: Any) -> Any:  # noqa: N802
        """Change the dynamics, for one choice without putting bodies to sleep."""
        if self._choice == "awake" and "activationState" in named:
            return None
        return self._bullet.changeDynamics(*args, **named)

    def setCollisionFilterGroupMask(self, *args: Any, **named: Any) -> None:  # noqa: N802
        """Set the masks, for one choice so that everything meets everything."""
        body, link, group, meets = args
        if self._choice == "pairs" and group in (pybullet_bodies.FIXED, pybullet_bodies.GROUND):
            meets = 0xFFFF
        self._bullet.setCollisionFilterGroupMask(body, link, group, meets, **named)


CHOICES = {
    "the set-up of evoros": "",
    "sensors as links of their own": "links",
    "pairs of fixed bodies tested": "pairs",
    "world in reduced coordinates": "reduced",
    "movable bodies awake": "awake",
    "wheels as cylinders": "cylinder",
    "50 solver iterations": "50",
    "10 solver iterations": "10",
}


def running(choice: str, robots: dict[str, Robot], world: World) -> tuple[Any, Any]:
    """An engine whose robot drives a curve at home, and its function that makes a step."""
    engine = pybullet_model.Engine(Without(import_pybullet(), choice))
    settings = pybullet_model.Settings(0.025, int(choice) if choice.isdigit() else 20, 1.0, 0.05)
    robot = robots["cylinder" if choice == "cylinder" else "sphere"]
    merge = vars(pybullet_robot)["merge_fixed_links"]
    if choice == "links":
        vars(pybullet_robot)["merge_fixed_links"] = lambda root, kept: etree.tostring(root).decode()
    try:
        model = engine.prepare([PlacedRobot(robot, world.course.home)], world, settings)
    finally:
        vars(pybullet_robot)["merge_fixed_links"] = merge
    simulation = PyBulletSimulation(engine, model, [robot], settings)
    simulation.advance(np.array([0.1, 0.6]), 2.0)
    return engine, engine.bullet.stepSimulation


def costs(robots: dict[str, Robot], world: World) -> dict[str, float]:
    """The time [us] of a step for each choice.

    The choices run in turn, so that a busy machine slows all of them.
    """
    engines = {name: running(choice, robots, world) for name, choice in CHOICES.items()}
    spent: dict[str, list[float]] = {name: [] for name in CHOICES}
    for _ in range(80):
        for name, (_, step) in engines.items():
            begin = thread_time()
            for _ in range(10):
                step()
            spent[name].append((thread_time() - begin) / 10)
    for engine, _ in engines.values():
        engine.close()
    return {name: 1e6 * float(np.percentile(times, 20)) for name, times in spent.items()}
