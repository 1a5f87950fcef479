"""The robots of an experiment by themselves, designs to try, and values of controllers."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import NamedTuple

import numpy as np

from evoros.base.checks import is_number
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.controller.protocol import Controller, LiveController
from evoros.design.design import Design
from evoros.design.space import DesignSpace, SensorDesign
from evoros.design.team import TeamSpace
from evoros.evolution.experiment import Experiment
from evoros.failure.protocol import Failure
from evoros.mission.member import Member
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.world.model import World

RANDOM_DESIGNS = 5


class Subject(NamedTuple):
    """A robot of an experiment as if it were alone, with the names that it would have then."""

    key: str  # before its keys in messages
    robot: Robot
    design: SensorDesign
    controller: Controller | LiveController  # of the run
    world: Mapping[str, World]  # with its course
    failure: Failure
    trials: int
    scenario: Scenario
    confirming: Scenario
    member: Member  # as it is among the others

    @property
    def space(self) -> DesignSpace:
        """The search space of the design."""
        return self.member.space


def list_subjects(experiment: Experiment) -> list[Subject]:
    """List the robots of an experiment."""
    subjects = []
    for i, member in enumerate(experiment.members):
        scenario = confirming = _isolate(experiment.scenario, i)
        if experiment.confirming is not experiment.scenario:
            confirming = _isolate(experiment.confirming, i)
        parts = (member.robot, member.design, member.controller)
        shared = (scenario.world, experiment.failure, experiment.trials)
        subjects.append(Subject(member.key, *parts, *shared, scenario, confirming, member))
    return subjects


def _isolate(scenario: Scenario, index: int) -> Scenario:
    """Return the scenario of one of the robots alone."""
    member = scenario.members[index]
    alone = Member(member.robot, member.design, member.controller)
    return replace(scenario, members=(alone,), world=scenario.place_worlds(member))


def choose_middle(space: DesignSpace | TeamSpace) -> Design:
    """Return the design in the middle of a search space."""
    return space.decode(space.middle)


def try_designs(subject: Subject) -> Iterator[Member]:
    """Yield the robot with designs from the middle, both ends and the inside of the space."""
    space, rng = subject.space, generator("preflight", "designs")
    genomes = [space.middle, *(np.full(space.size, share) for share in (0.0, 1.0))]
    for genome in (*genomes, *rng.random((RANDOM_DESIGNS, space.size))):
        try:
            yield from subject.scenario.equip(space.decode(genome))
        except InputError:
            continue  # a part refuses this design, which is then an outcome of its missions


def find_values(part: object, name: str, at: str) -> Iterator[tuple[str, float]]:
    """Yield the dotted key and the value of each number called ``name`` in a description.

    ``at`` is the key of ``part`` itself.
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
    """Return the key and the value [m] of the maximum ``range_m`` of a controller's layers."""
    ranges = find_values(controller, "range_m", "controller")
    return max(ranges, key=lambda entry: entry[1], default=None)
