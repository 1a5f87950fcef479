"""The single robots of an experiment, designs to try, and values of controllers."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import NamedTuple

import numpy as np

from evoros.base.checks import is_number
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.design.team import TeamSpace
from evoros.evolution.experiment import Experiment
from evoros.mission.member import Member
from evoros.mission.scenario import Scenario

RANDOM_DESIGNS = 5


class Subject(NamedTuple):
    """A robot of an experiment on its own, named as if it were the only one."""

    member: Member  # the member of the team, with its key
    scenario: Scenario  # has worlds with the course of this robot
    confirming: Scenario
    trials: int

    @property
    def space(self) -> DesignSpace:
        """The design space of the robot."""
        return self.member.space


def list_subjects(experiment: Experiment) -> list[Subject]:
    """Return the robots of an experiment."""
    subjects = []
    for i, member in enumerate(experiment.members):
        scenario = confirming = _isolate(experiment.scenario, i)
        if experiment.confirming is not experiment.scenario:
            confirming = _isolate(experiment.confirming, i)
        subjects.append(Subject(member, scenario, confirming, experiment.trials))
    return subjects


def _isolate(scenario: Scenario, index: int) -> Scenario:
    member = scenario.members[index]
    alone = Member(member.robot, member.design, member.controller)
    return replace(scenario, members=(alone,), world=scenario.place_worlds(member))


def choose_middle(space: DesignSpace | TeamSpace) -> Design:
    """Return the design at the middle of a search space."""
    return space.decode(space.middle)


def try_designs(subject: Subject) -> Iterator[Member]:
    """Yield the robot with designs at the middle, at both ends and inside the space."""
    space, rng = subject.space, generator("preflight", "designs")
    genomes = [space.middle, *(np.full(space.size, share) for share in (0.0, 1.0))]
    for genome in (*genomes, *rng.random((RANDOM_DESIGNS, space.size))):
        try:
            yield from subject.scenario.equip(space.decode(genome))
        except InputError:
            continue  # the part will reject this design in its missions, too


def find_values(part: object, name: str, at: str) -> Iterator[tuple[str, float]]:
    """Yield the dotted key and value of each number called ``name`` in a description.

    ``at`` is the key of ``part``.
    """
    if is_dataclass(part):
        children = {field.name: getattr(part, field.name) for field in fields(part)}
    elif isinstance(part, Mapping):
        children = dict(part)
    else:
        return
    for key, child in children.items():
        if key == name and is_number(child):
            yield f"{at}.{key}", float(child)
        else:
            yield from find_values(child, name, f"{at}.{key}")


def find_avoidance_range(controller: object) -> tuple[str, float] | None:
    """Return the key and value [m] of the maximum ``range_m`` of a controller's layers."""
    ranges = find_values(controller, "range_m", "controller")
    return max(ranges, key=lambda entry: entry[1], default=None)
