"""Designs that stand for all of a search space."""

from collections.abc import Iterator

import numpy as np

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.design.team import TeamSpace
from evoros.mission.member import Member
from evoros.preflight.subject import Subject

RANDOM_DESIGNS = 5


def choose_middle(space: DesignSpace | TeamSpace) -> Design:
    """Return the design in the middle of a search space."""
    return space.decode(np.full(space.size, 0.5))


def try_designs(subject: Subject) -> Iterator[Member]:
    """Yield the robot with designs from the middle, both ends and the inside of the space."""
    space, rng = subject.space, generator("preflight", "designs")
    genomes = [np.full(space.size, share) for share in (0.5, 0.0, 1.0)]
    for genome in (*genomes, *rng.random((RANDOM_DESIGNS, space.size))):
        try:
            yield from subject.scenario.equip(space.decode(genome))
        except InputError:
            continue  # a part refuses this design, which is then an outcome of its missions
