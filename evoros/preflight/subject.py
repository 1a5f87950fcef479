"""The robots of an experiment by themselves, as preflight examines them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from evoros.controller.protocol import Controller, LiveController
from evoros.design.space import DesignSpace, SensorDesign
from evoros.evolution.experiment import Experiment
from evoros.failure.protocol import Failure
from evoros.mission.member import Member
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.world.model import World


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

    @property
    def space(self) -> DesignSpace:
        """The search space of the design.

        Raises:
            InputError: a region does not fit the robot.
        """
        return self.scenario.members[0].space


def list_subjects(experiment: Experiment) -> list[Subject]:
    """List the robots of an experiment."""
    subjects = []
    for i, member in enumerate(experiment.members):
        scenario = confirming = _isolate(experiment.scenario, i)
        if experiment.confirming is not experiment.scenario:
            confirming = _isolate(experiment.confirming, i)
        parts = (member.robot, member.design, member.controller)
        shared = (scenario.world, experiment.failure, experiment.trials)
        subjects.append(Subject(member.key, *parts, *shared, scenario, confirming))
    return subjects


def _isolate(scenario: Scenario, number: int) -> Scenario:
    """Return the scenario of one of the robots alone."""
    member = scenario.members[number]
    alone = Member(member.robot, member.design, member.controller)
    return replace(scenario, members=(alone,), world=scenario.place_worlds(member))
