"""Finds bad input before a run starts, by all that a mission needs short of its engine."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from evoros.base.arrays import POSE_SIZE
from evoros.base.errors import InputError, PilotLost, SimulationError
from evoros.base.log import LOGGER
from evoros.base.rng import generator
from evoros.controller.protocol import LiveController, StartedLayer
from evoros.design.design import Design
from evoros.design.genes import check_genes
from evoros.evolution.experiment import Experiment
from evoros.evolution.route_check import check_routes
from evoros.evolution.sight_check import check_sight
from evoros.evolution.told_check import check_told
from evoros.mission.compiled_loop import explain_interpreted, prepare
from evoros.mission.live_layers import open_layers
from evoros.mission.loop import FilterStage
from evoros.mission.loop_inputs import collect_inputs
from evoros.mission.pipeline import (
    Draws,
    describe_sensors,
    start_localization,
    start_sensor_filters,
)
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import RuleSimulation, RuleSimulator, SimulationRules

Stages = tuple[Sequence[FilterStage], Sequence[FilterStage], Sequence[StartedLayer]]


def preflight(experiment: Experiment) -> None:
    """Start every part of an experiment once, so that bad input does not stop its run later.

    This tries the ends of all evolved ranges, starts the search, equips the robot, draws faults,
    starts the controllers and compiles the rules, which the workers then find on disk. It logs the
    rules that cannot be compiled, and a warning for each doubt about the robot, its sensors,
    the courses and what the controller is told.

    Raises:
        InputError: a part refuses what it is given.
    """
    draws: Draws = partial(generator, "try out")
    experiment.optimizer.start(experiment.space, draws("optimizer"))
    stages = {}
    for key, scenario in _list_scenarios(experiment).items():
        try:
            _try_genes(experiment, scenario)
            stages[scenario] = _start_stages(experiment, scenario, draws)
        except InputError as error:
            raise InputError(f"{key}{error}") from None
    _report_mount(experiment)
    for check in (check_routes, check_sight, check_told):
        for warning in check(experiment):
            LOGGER.warning("%s", warning)
    # Each pair of rules of motion and controller once.
    pairs = {(_rules(each), id(each.controller)): each for each in reversed(stages)}
    interpreted = [line for each in pairs.values() for line in _compile(each, stages[each])]
    for line in dict.fromkeys(interpreted):
        LOGGER.warning("%s; missions run step by step, several times slower", line)


def _list_scenarios(experiment: Experiment) -> dict[str, Scenario]:
    """Return the scenarios of a run, by what comes before their keys in a message."""
    if experiment.confirming is experiment.scenario:
        return {"": experiment.scenario}
    return {"": experiment.scenario, "confirmation.": experiment.confirming}


def _try_genes(experiment: Experiment, scenario: Scenario) -> None:
    parts = {name: getattr(scenario, name) for name in ("robot", "controller", "design")}
    check_genes(experiment.design.genes, parts)


def _report_mount(experiment: Experiment) -> None:
    """Log the parts of the default mount that were chosen for the robot."""
    robot = experiment.robot
    if not robot.chosen_mount:
        return
    pitch = robot.default_pitch(experiment.design.sensors.values())
    values = {"link": robot.mount_link, "z_m": f"{robot.mount_z_m:.4g}", "pitch_deg": f"{pitch:g}"}
    chosen = ", ".join(f"robot.mount.{name}={values[name]}" for name in robot.chosen_mount)
    LOGGER.warning("%s: chosen for the robot and its sensors: %s", robot.name, chosen)


def _start_stages(experiment: Experiment, scenario: Scenario, draws: Draws) -> Stages:
    """Start the filters of sensors and localization, and the controller.

    The design is in the middle of the search space. The filters have one sensor of each type, and
    the controller has all that are in the design.
    """
    middle = experiment.space.decode(np.full(experiment.space.size, 0.5))
    mounts = tuple(
        replace(mount, sensor=name)
        for mount in middle.mounts[:1]  # none if no sensors are placed
        for name in experiment.design.sensors
    )
    robot = scenario.with_design(Design(mounts, middle.values)).robot
    faults = scenario.failure.draw(describe_sensors(robot), draws("failure"))
    ranges, readings = np.zeros(robot.beam_count), np.zeros(robot.channel_count)
    filters = start_sensor_filters(
        robot, faults, ranges, readings, scenario.simulator.time_step, draws
    )
    equipped = scenario.with_design(middle)
    localization = start_localization(equipped.controller, np.zeros(POSE_SIZE), draws)
    return filters, localization, _start_layers(equipped, draws)


def _start_layers(scenario: Scenario, draws: Draws) -> Sequence[StartedLayer]:
    """Start the controller in the first world.

    Raises:
        InputError: it refuses to start, is not ready in time, or has other layers than modes.
    """
    controller, (name, world) = scenario.controller, next(iter(scenario.world.items()))
    course = world.at(f"try out/{name}").course
    route = course.route(course.goes_forward(0, draws("course")))
    try:
        with open_layers(scenario, course, route, draws) as opened:
            layers = list(opened)
    except (InputError, PilotLost, SimulationError) as error:
        raise InputError(f"controller: {error}") from None
    if len(controller.modes) != len(layers):
        raise InputError(
            f"controller.modes: must name one mode for each of the {len(layers)} layers, not "
            f"{list(controller.modes)}; correct {type(controller).__name__}"
        )
    return layers


def _rules(scenario: Scenario) -> tuple[SimulationRules, ...]:
    """Return the different rules of motion in the worlds, of a simulator that has any."""
    simulator = scenario.simulator
    if not isinstance(simulator, RuleSimulator):
        return ()
    worlds = (world.at(f"try out/{name}") for name, world in scenario.world.items())
    return tuple(dict.fromkeys(map(simulator.choose_rules, worlds)))


def _compile(scenario: Scenario, stages: Stages) -> Iterator[str]:
    """Compile the rules and the loops that missions use; yield why rules are interpreted.

    A live engine has no rules of motion, and a live controller has no rules at all.
    """
    for rules in _rules(scenario):
        yield from _compile_with(rules, scenario, stages)


def _compile_with(rules: SimulationRules, scenario: Scenario, stages: Stages) -> Iterator[str]:
    simulation = RuleSimulation(rules, np.zeros(0), np.zeros(0))
    inputs = collect_inputs(simulation, *stages)
    prepare(inputs)
    count = len(inputs.filters)  # designs without some type of sensor, or without faults, have less
    while count:
        count //= 2
        prepare(inputs._replace(filters=inputs.filters[:count]))
    live = isinstance(scenario.controller, LiveController)
    yield from explain_interpreted(inputs._replace(layers=()) if live else inputs)
