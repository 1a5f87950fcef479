"""Checks that the robots of an experiment fit together."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.evolution.agent import Agent
from evoros.evolution.declared_genes import find_declared_genes
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import Footprint
from evoros.robot.model import Robot
from evoros.world.model import World


def check_agents(
    agents: Mapping[str, Agent], robot: Robot, controller: object, worlds: Mapping[str, World]
) -> None:
    """Check the agents beside a first ``robot`` with its ``controller``.

    Raises:
        InputError: a design of another robot, genes without effect, or two robots that touch at
            home.
    """
    if not agents:
        return
    for name, agent in agents.items():
        _check_design(name, agent, robot, controller)
    for world_name, world in worlds.items():
        _check_homes(agents, robot, world_name, world)


def _check_design(name: str, agent: Agent, robot: Robot, controller: object) -> None:
    if agent.design is None and agent.robot not in (None, robot):
        raise InputError(
            f"agents.{name}.design: must be given for another robot than the first one, because "
            f"its regions are those of its robot; add for example /design@{name}.design: around "
            f"to the defaults"
        )
    evolves = agent.design is not None and (
        agent.design.max_number > 0
        or agent.design.genes
        or find_declared_genes(agent.controller or controller)
    )
    if evolves and not agent.scored:
        raise InputError(
            f"agents.{name}.scored: must be true if the robot's own design evolves, because "
            f"nothing would select it; set it to true, or use a design with number 0 and fixed "
            f"sensors"
        )


def _check_homes(agents: Mapping[str, Agent], robot: Robot, world_name: str, world: World) -> None:
    """Require that no two robots touch at home."""
    x, y, _, yaw = world.course.home
    placed = {"the first robot": (robot, [x, y, yaw])}
    for name, agent in agents.items():
        placed[f"agents.{name}"] = (agent.robot or robot, list(map(float, agent.home)))
    for (one, (first, at)), (other, (second, there)) in combinations(placed.items(), 2):
        if _touch(first, at, second, there):
            raise InputError(
                f"{other}.home: must be clear of {one} in world.{world_name}, not {there}, "
                f"where the two touch; move it"
            )


def _touch(first: Robot, at: Sequence[float], second: Robot, there: Sequence[float]) -> bool:
    x, y, yaw = there
    sin, cos = elementary.sin_cos(yaw)
    turn = np.array([[cos, -sin], [sin, cos]])
    footprint = Footprint(product(second.outline, turn.T) + np.array([x, y]), 0.0)
    return float(compute_clearances(first.outline, np.array([at]), [footprint])[0]) <= 0.0
