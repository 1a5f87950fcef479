"""Finds bad input before a run starts, by all that a mission needs short of its engine."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from evoros.base.arrays import POSE_SIZE
from evoros.base.errors import InputError
from evoros.base.log import LOGGER
from evoros.base.rng import generator
from evoros.controller.protocol import StartedLayer
from evoros.design.design import Design
from evoros.design.genes import check_genes
from evoros.evolution.experiment import Experiment
from evoros.evolution.route_check import check_routes
from evoros.evolution.sight_check import check_sight
from evoros.mission.compiled_loop import explain_interpreted, prepare
from evoros.mission.loop import FilterStage, LoopInputs
from evoros.mission.loop_inputs import collect_inputs
from evoros.mission.pipeline import (
    Draws,
    describe_sensors,
    start_localization,
    start_sensor_filters,
)
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import RuleSimulation, RuleSimulator

Stages = tuple[Sequence[FilterStage], Sequence[FilterStage], Sequence[StartedLayer]]


def preflight(experiment: Experiment) -> None:
    """Start every part of an experiment once, so that bad input does not stop its run later.

    This tries the ends of all evolved ranges, starts the search, equips the robot, draws faults,
    opens the controller and compiles the rules, which the workers then find on disk. It logs the
    rules that cannot be compiled, and a warning for each doubt about the robot, its sensors and
    the courses.

    Raises:
        InputError: a part refuses what it is given.
    """
    parts = {name: getattr(experiment, name) for name in ("robot", "controller", "design")}
    check_genes(experiment.design.genes, parts)
    draws: Draws = partial(generator, "try out")
    experiment.optimizer.start(experiment.space, draws("optimizer"))
    stages = _start_stages(_try_design(experiment), draws)
    _report_mount(experiment)
    for check in (check_routes, check_sight):
        for warning in check(experiment):
            LOGGER.warning("%s", warning)
    simulators = (experiment.simulator, experiment.confirming.simulator)
    motions = [each.rules for each in simulators if isinstance(each, RuleSimulator)]
    for motion in dict.fromkeys(motions):
        simulation = RuleSimulation(motion, np.zeros(0), np.zeros(0))
        _compile(collect_inputs(simulation, *stages))


def _report_mount(experiment: Experiment) -> None:
    """Log the parts of the default mount that were chosen for the robot."""
    robot = experiment.robot
    if not robot.chosen_mount:
        return
    pitch = robot.default_pitch(experiment.design.sensors.values())
    values = {"link": robot.mount_link, "z_m": f"{robot.mount_z_m:.4g}", "pitch_deg": f"{pitch:g}"}
    chosen = ", ".join(f"robot.mount.{name}={values[name]}" for name in robot.chosen_mount)
    LOGGER.warning("%s: chosen for the robot and its sensors: %s", robot.name, chosen)


def _try_design(experiment: Experiment) -> Scenario:
    """Equip the robot with a design in the middle of the search space, one sensor of each type."""
    middle = experiment.space.decode(np.full(experiment.space.size, 0.5))
    mounts = tuple(
        replace(mount, sensor=name)
        for mount in middle.mounts[:1]  # none if no sensors are placed
        for name in experiment.design.sensors
    )
    return experiment.scenario.with_design(Design(mounts, middle.values))


def _start_stages(scenario: Scenario, draws: Draws) -> Stages:
    """Start the filters of sensors and localization, and the controller's layers."""
    robot, controller = scenario.robot, scenario.controller
    faults = scenario.failure.draw(describe_sensors(robot), draws("failure"))
    readings, tick = np.zeros(len(robot.mounts)), scenario.simulator.time_step
    filters = start_sensor_filters(robot, faults, readings, readings, tick, draws)
    localization = start_localization(controller, np.zeros(POSE_SIZE), draws)
    try:
        with controller.open(robot, draws) as opened:
            layers = list(opened)
    except InputError as error:
        raise InputError(f"controller: {error}") from None
    if len(controller.modes) != len(layers):
        raise InputError(
            f"controller.modes: must name one mode for each of the {len(layers)} layers, not "
            f"{list(controller.modes)}; correct {type(controller).__name__}"
        )
    return filters, localization, layers


def _compile(inputs: LoopInputs) -> None:
    """Compile the rules and the loops that missions use; report the rules that are interpreted."""
    prepare(inputs)
    count = len(inputs.filters)  # designs without some type of sensor, or without faults, have less
    while count:
        count //= 2
        prepare(inputs._replace(filters=inputs.filters[:count]))
    for line in explain_interpreted(inputs):
        LOGGER.warning("%s; missions run step by step, several times slower", line)
