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
from evoros.design.space import DesignSpace
from evoros.design.team import TeamSpace
from evoros.evolution.experiment import Experiment
from evoros.evolution.home_check import check_home
from evoros.evolution.measure_check import check_measures
from evoros.evolution.route_check import check_routes
from evoros.evolution.self_sight_check import check_housings, check_self_sight
from evoros.evolution.sight_check import check_sight
from evoros.evolution.told_check import check_told
from evoros.failure.protocol import SystematicFailure
from evoros.mission.compiled_loop import explain_interpreted, prepare
from evoros.mission.engine_calls import ENGINE_RULES
from evoros.mission.live_layers import open_layers
from evoros.mission.loop_inputs import Stages, collect_inputs
from evoros.mission.member import MIN_RECORD_S
from evoros.mission.outcome import AGENT_COLUMNS
from evoros.mission.pipeline import (
    Draws,
    draw_faults,
    start_localization,
    start_sensor_filters,
)
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import RuleSimulation, RuleSimulator, SimulationRules

MAX_TRAJECTORY_BYTES = 2**30
"""The most memory that the trajectory of one mission may take."""


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
    experiment.optimizer.start(experiment.space, experiment.goals, draws("optimizer"))
    for warning in check_measures(experiment):
        LOGGER.warning("%s", warning)
    teams: dict[str, list[Stages]] = {}  # of all robots, by the key of the scenario
    told: set[str] = set()
    _check_length(experiment)
    for name, member in experiment.members.items():
        robot = f"agents.{name}." if name else ""
        for key, scenario in _list_scenarios(member).items():
            try:
                _try_genes(member, scenario)
                teams.setdefault(key, []).append(_start_stages(member, scenario, draws))
            except InputError as error:
                raise InputError(f"{robot}{key}{error}") from None
        for warning in _list_doubts(member):
            if warning not in told:  # robots of one kind and design share most of them
                LOGGER.warning("%s%s", robot, warning)
            told.add(warning)
    # Each pair of rules of motion and controller once.
    scenarios = _list_scenarios(experiment)
    rules = {key: _find_rules(experiment, each) for key, each in scenarios.items()}
    pairs = {(rules[key], id(scenarios[key].controller)): key for key in reversed(scenarios)}
    interpreted = [
        line
        for key in pairs.values()
        for motion in rules[key]
        for line in _compile(motion, scenarios[key], teams[key])
    ]
    for line in dict.fromkeys(interpreted):
        LOGGER.warning("%s; missions run step by step, several times slower", line)


def _check_length(experiment: Experiment) -> None:
    """Require that the trajectory of a mission fits into memory.

    Raises:
        InputError: the time limit of a course is too long.
    """
    robot = experiment.scenario.equip(_choose_middle(experiment.space))[""].robot
    columns = len(AGENT_COLUMNS) + robot.channel_count
    period = max(experiment.controller.period_s, MIN_RECORD_S)
    limit = MAX_TRAJECTORY_BYTES / (8 * columns) * period
    for name, world in experiment.world.items():
        if world.course.time_limit_s > limit:
            raise InputError(
                f"world.{name}.course.time_limit_s: must be at most {limit:.0f} s, so that the "
                f"trajectory of a mission fits into {MAX_TRAJECTORY_BYTES // 2**20} MiB, not "
                f"{world.course.time_limit_s:g}; lower it (course.time_limit_s)"
            )


def _list_doubts(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each doubt about the robot, its sensors, its courses and its controller.

    Raises:
        InputError: the robot touches an obstacle at home.
    """
    yield from _describe_mount(experiment)
    yield from _describe_cases(experiment)
    checks = check_home, check_routes, check_sight, check_self_sight, check_housings, check_told
    for check in checks:
        yield from check(experiment)


def _describe_cases(experiment: Experiment) -> Iterator[str]:
    """Yield how many cases of a systematic failure the trials leave out."""
    failure, trials = experiment.failure, experiment.trials
    if isinstance(failure, SystematicFailure):
        sensors = len(_choose_middle(experiment.own_space).mounts)
        cases = failure.count_cases(sensors)
        if trials < cases:
            yield (
                f"failure: {sensors} sensors can fail in {cases} ways, and designs meet the first "
                f"{trials} of them, one in each trial; set trials={cases} for all"
            )


def _list_scenarios(experiment: Experiment) -> dict[str, Scenario]:
    """Return the scenarios of a run, by what comes before their keys in a message."""
    if experiment.confirming is experiment.scenario:
        return {"": experiment.scenario}
    return {"": experiment.scenario, "confirmation.": experiment.confirming}


def _try_genes(experiment: Experiment, scenario: Scenario) -> None:
    parts = {name: getattr(scenario, name) for name in ("robot", "controller", "design")}
    check_genes(experiment.own_space.genes, parts)


def _describe_mount(experiment: Experiment) -> Iterator[str]:
    """Yield the parts of the default mount that were chosen for the robot."""
    robot = experiment.robot
    if not robot.chosen_mount:
        return
    pitch = robot.default_pitch(experiment.design.sensors.values())
    values = {"link": robot.mount_link, "z_m": f"{robot.mount_z_m:.4g}", "pitch_deg": f"{pitch:g}"}
    chosen = ", ".join(f"robot.mount.{name}={values[name]}" for name in robot.chosen_mount)
    yield f"{robot.name}: chosen for the robot and its sensors: {chosen}"


def _start_stages(experiment: Experiment, scenario: Scenario, draws: Draws) -> Stages:
    """Start the filters of sensors and localization, and the controller.

    The design is in the middle of the search space. The filters have one sensor of each type, and
    the controller has all that are in the design.
    """
    middle = _choose_middle(experiment.own_space)
    mounts = tuple(
        replace(mount, sensor=name)
        for mount in middle.mounts[:1]  # none if no sensors are placed
        for name in experiment.design.sensors
    )
    robot = scenario.with_design(Design(mounts, middle.values)).robot
    equipped = scenario.with_design(middle)
    drawn = draw_faults(scenario.failure, equipped.robot, draws, 0)
    faults = [replace(fault, onset=np.zeros(len(mounts))) for fault in drawn]
    signals, readings = np.zeros(robot.signal_count), np.zeros(robot.channel_count)
    filters = start_sensor_filters(
        robot, faults, signals, readings, scenario.simulator.time_step, draws
    )
    told, pose = np.zeros(equipped.robot.channel_count), np.zeros(POSE_SIZE)
    localization = start_localization(equipped.controller, equipped.robot, told, pose, draws)
    layers = _start_layers(equipped, draws)
    return Stages(filters, localization, layers)


def _choose_middle(space: DesignSpace | TeamSpace) -> Design:
    return space.decode(np.full(space.size, 0.5))


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


def _find_rules(experiment: Experiment, scenario: Scenario) -> tuple[SimulationRules, ...]:
    """Return the different rules of motion in the worlds; an engine has the same in all.

    Raises:
        InputError: the simulator cannot simulate so many robots in a world.
    """
    simulator = scenario.simulator
    if not isinstance(simulator, RuleSimulator):
        return (ENGINE_RULES,)
    team = scenario.equip(_choose_middle(experiment.space))
    robots = [each.robot for each in team.values()]
    worlds = [world.at(f"try out/{name}") for name, world in scenario.world.items()]
    return tuple(dict.fromkeys(simulator.choose_rules(world, robots) for world in worlds))


def _compile(rules: SimulationRules, scenario: Scenario, team: Sequence[Stages]) -> Iterator[str]:
    """Compile the rules and the loops that missions use; yield why rules are interpreted.

    With an engine, interpreted rules are hardly slower. A live controller has no rules at all.
    """
    inputs = collect_inputs(RuleSimulation(rules, np.zeros(0), np.zeros(0)), team)
    prepare(inputs)
    count = len(inputs.filters)
    while count:  # designs without some type of sensor, or without faults, have less
        count //= 2
        prepare(inputs._replace(filters=inputs.filters[:count]))
    if rules is ENGINE_RULES:
        return
    controllers = [each.controller for each in (scenario, *scenario.agents.values())]
    told = [
        layer
        for stages, controller in zip(team, controllers, strict=True)
        if not isinstance(controller, LiveController)
        for layer in stages.layers
    ]
    yield from explain_interpreted(inputs._replace(layers=tuple(told)))
