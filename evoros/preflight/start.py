"""Starts a mission before the run, by the code of missions, and compiles its rules."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from evoros.base.errors import InputError, PilotLost, SimulationError
from evoros.controller.protocol import LiveController
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.compiled_loop import explain_interpreted, prepare
from evoros.mission.inputs import LayerStage
from evoros.mission.live_layers import open_layers
from evoros.mission.member import Member
from evoros.mission.participant import Participant, enter
from evoros.mission.plan import Plan
from evoros.mission.python_calls import ENGINE_RULES
from evoros.mission.scenario import Scenario
from evoros.mission.stages import Stages, collect_inputs
from evoros.mission.start import start
from evoros.preflight.subject import Subject, choose_middle
from evoros.preflight.walkers import place_robots
from evoros.simulator.protocol import RuleSimulation, RuleSimulator, SimulationRules


def check_start(experiment: Experiment) -> Iterator[str]:
    """Start the first mission of a design, and compile its rules, which workers then find on disk.

    Yield the reasons why rules can only be interpreted; a part that refuses to start raises an
    InputError.
    """
    compiled: set[tuple[SimulationRules, tuple[int, ...]]] = set()
    reasons: dict[str, None] = {}
    for key, scenario in list_scenarios(experiment).items():
        members = scenario.equip(choose_middle(experiment.space))
        stages = [_start_robot(key, scenario, member, experiment.plan) for member in members]
        controllers = tuple(id(member.controller) for member in scenario.members)
        for rules in _choose_rules(scenario, members):
            if (rules, controllers) not in compiled:
                compiled.add((rules, controllers))
                reasons |= dict.fromkeys(_compile(rules, members, stages))
    for reason in reasons:
        yield f"{reason}; missions are several times slower"


def list_scenarios(experiment: Experiment | Subject) -> dict[str, Scenario]:
    """Return the scenarios of a run, by the prefix of their keys in messages."""
    if experiment.confirming is experiment.scenario:
        return {"": experiment.scenario}
    return {"": experiment.scenario, "confirmation.": experiment.confirming}


def _start_robot(key: str, scenario: Scenario, member: Member, plan: Plan) -> Stages:
    """Start a robot as for its first mission, with faults that act from the beginning.

    The filters of types of sensors that its design lacks are started, too.
    """
    mounts = member.robot.mounts
    (mission, *_) = plan.selection(0, 0, Design(mounts), range(1))
    world = scenario.world[mission.world].at(mission.draws)
    try:
        participant = enter(member, scenario.failure, world, mission)
        layers = _open_controller(participant)
        lacking = member.design.sensors.keys() - {mount.sensor for mount in mounts}
        if lacking:
            further = [replace(mount, sensor=kind) for mount in mounts[:1] for kind in lacking]
            whole = member.with_design(Design((*mounts, *further)))
            participant = enter(whole, scenario.failure, world, mission)
        faults = [replace(fault, onset=np.zeros_like(fault.onset)) for fault in participant.faults]
        participant = replace(participant, faults=faults)
        (stages,) = start(scenario, [participant], [layers], world).stages
    except InputError as error:
        raise InputError(f"{member.key}{key}{error}") from None
    return stages


def _open_controller(participant: Participant) -> Sequence[LayerStage]:
    """Start the controller of a robot, end it, and require a mode for each of its layers."""
    try:
        with open_layers(participant) as opened:
            layers = opened
    except (InputError, PilotLost, SimulationError) as error:
        raise InputError(f"controller: {error}") from None
    controller = participant.member.controller
    if len(controller.modes) != len(layers):
        raise InputError(
            f"controller.modes: must name one mode for each of the {len(layers)} layers, not "
            f"{list(controller.modes)}; correct {type(controller).__name__}"
        )
    return layers


def _choose_rules(scenario: Scenario, members: Sequence[Member]) -> Sequence[SimulationRules]:
    """Return the different rules of motion in the worlds; an engine has the same in all."""
    simulator = scenario.simulator
    if not isinstance(simulator, RuleSimulator):
        return [ENGINE_RULES]
    robots = [member.robot for member in members]
    placed = place_robots(scenario, members)
    worlds = [
        scenario.draw_world(name, f"preflight/{name}", robots) for name, robots in placed.items()
    ]
    return list(dict.fromkeys(simulator.choose_rules(world, robots) for world in worlds))


def _compile(
    rules: SimulationRules, members: Sequence[Member], stages: Sequence[Stages]
) -> list[str]:
    """Compile the rules and the loops that missions use; list the reasons why some are interpreted.

    With an engine, interpreted rules are hardly slower. A live controller has no rules at all.
    """
    inputs = collect_inputs(RuleSimulation(rules, np.zeros(0), np.zeros(0)), stages)
    prepare(inputs)
    count = len(inputs.filters)
    while count:  # designs without some type of sensor, or without faults, have fewer
        count //= 2
        prepare(inputs._replace(filters=inputs.filters[:count]))
    if rules is ENGINE_RULES:
        return []
    layers = [
        layer
        for member, started in zip(members, stages, strict=True)
        if not isinstance(member.controller, LiveController)
        for layer in started.layers
    ]
    return explain_interpreted(inputs._replace(layers=tuple(layers)))
