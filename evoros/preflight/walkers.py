"""Draws walkers before a run, as many as a mission can have, to find out whether they have room."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from evoros.evolution.experiment import Experiment
from evoros.mission.member import Member
from evoros.mission.scenario import Scenario
from evoros.preflight.subject import choose_middle
from evoros.simulator.protocol import PlacedRobot

TRIALS = 3


def check_room(experiment: Experiment) -> Iterator[str]:
    """Require that there is room for the largest number of walkers in each world."""
    scenario = experiment.scenario
    if scenario.any_walkers:
        most = {
            name: replace(group, number=group.numbers[1])
            for name, group in scenario.walkers.items()
        }
        full = replace(scenario, walkers=most)
        members = scenario.equip(choose_middle(experiment.space))
        for name, robots in place_robots(scenario, members).items():
            for trial in range(TRIALS):
                full.draw_world(name, f"preflight/{trial}", robots)
    yield from ()


def place_robots(scenario: Scenario, members: Sequence[Member]) -> dict[str, list[PlacedRobot]]:
    """Place the robots at home in each world."""
    return {
        name: [PlacedRobot(member.robot, member.place(world.course).home) for member in members]
        for name, world in scenario.world.items()
    }
