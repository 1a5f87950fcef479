"""Checks the input of a run by starting everything that a mission uses, except the engine."""

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, product

import numpy as np

from evoros.base.checks import SCORE, ask
from evoros.base.errors import InputError, PilotLost, SimulationError, write_count
from evoros.base.rng import generator
from evoros.controller.protocol import LiveController
from evoros.design.design import Design
from evoros.design.genes import check_genes
from evoros.evolution.experiment import Experiment
from evoros.evolution.trials import equip_robots, list_measures
from evoros.executor.processes import Processes, available_cores
from evoros.failure.protocol import SystematicFailure
from evoros.measure.protocol import DESCRIPTORS, Evaluated, Measure
from evoros.mission.compiled_loop import explain_interpreted, prepare
from evoros.mission.inputs import ENGINE_RULES, LayerStage
from evoros.mission.member import Member
from evoros.mission.participant import Participant, enter, open_layers
from evoros.mission.plan import Plan
from evoros.mission.scenario import Scenario
from evoros.mission.setup import MIN_RECORD_S, Setup
from evoros.preflight import scene
from evoros.preflight.own_code import try_rules
from evoros.preflight.routes import check_home, check_routes
from evoros.preflight.sight import check_gaps, check_housings, check_self_sight, check_sight
from evoros.simulator.protocol import RuleSimulation, RuleSimulator, SimulationRules


def check_start(experiment: Experiment) -> Iterator[str]:
    """Start a first mission and compile its rules; yield why some must be interpreted."""
    compiled: set[tuple[SimulationRules, tuple[int, ...]]] = set()
    reasons: dict[str, None] = {}
    for key, scenario in list_scenarios(experiment).items():
        members = scenario.equip(scene.choose_middle(experiment.space))
        setups = [_set_up(key, scenario, member, experiment.plan) for member in members]
        controllers = tuple(id(member.controller) for member in scenario.members)
        chosen = [(rules, controllers) for rules in _choose_rules(scenario, members)]
        for (rules, _), setup in product([new for new in chosen if new not in compiled], setups):
            reasons |= dict.fromkeys(_compile(rules, setup))
        compiled.update(chosen)
    for reason in reasons:
        yield f"{reason}; missions are several times slower"


def list_scenarios(experiment: Experiment | scene.Subject) -> dict[str, Scenario]:
    """Return a run's scenarios by the prefix of their keys in messages."""
    if experiment.confirming is experiment.scenario:
        return {"": experiment.scenario}
    return {"": experiment.scenario, "confirmation.": experiment.confirming}


def _set_up(key: str, scenario: Scenario, member: Member, plan: Plan) -> Setup:
    """Set up a first mission with immediate faults; start the filters of all sensor types."""
    mounts = member.robot.mounts
    (mission, *_) = plan.selection(0, 0, Design(mounts), range(1))
    world = scenario.world[mission.world].at(mission.draws)
    try:
        participant = enter(member, scenario.failure, world.course, mission)
        layers = _open_controller(participant)
        lacking = member.design.sensors.keys() - {mount.sensor for mount in mounts}
        if lacking:
            further = [replace(mount, sensor=kind) for mount in mounts[:1] for kind in lacking]
            whole = member.with_design(Design((*mounts, *further)))
            participant = enter(whole, scenario.failure, world.course, mission)
        faults = [replace(fault, onset=np.zeros_like(fault.onset)) for fault in participant.faults]
        participant = replace(participant, faults=faults)
        return Setup(scenario, [participant], [layers], world)
    except InputError as error:
        raise InputError(f"{member.key}{key}{error}") from None


def _open_controller(participant: Participant) -> Sequence[LayerStage]:
    try:
        with open_layers(participant) as opened:
            layers = opened
    except (InputError, PilotLost, SimulationError) as error:
        raise InputError(f"controller: {error}") from None
    controller = participant.member.controller
    if len(controller.modes) != len(layers):
        raise InputError(
            f"controller.modes: must name one mode for each of the {len(layers)} layers, not "
            f"{list(controller.modes)}; change the modes of {type(controller).__name__}"
        )
    return layers


def _choose_rules(scenario: Scenario, members: Sequence[Member]) -> Sequence[SimulationRules]:
    """Return the distinct motion rules; an engine has the same rules in all worlds."""
    simulator = scenario.simulator
    if not isinstance(simulator, RuleSimulator):
        return [ENGINE_RULES]
    robots = [member.robot for member in members]
    placed = scene.place_robots(scenario, members)
    worlds = [
        scenario.draw_world(name, f"preflight/{name}", robots) for name, robots in placed.items()
    ]
    return list(dict.fromkeys(simulator.choose_rules(world, robots) for world in worlds))


def _compile(rules: SimulationRules, setup: Setup) -> list[str]:
    """Compile the rules and loops of missions; return why some rules are interpreted."""
    inputs = setup.collect_inputs(RuleSimulation(rules, np.zeros(0), np.zeros(0)))
    try_rules(inputs, len(setup.arrays.readings))
    prepare(inputs)
    if rules is ENGINE_RULES:
        return []
    if isinstance(setup.robots[0].participant.member.controller, LiveController):
        inputs = inputs._replace(layers=())
    return explain_interpreted(inputs)


DESIGNS = 32


def check_measures(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each objective with the same value for all tried designs."""
    measures = list_measures(experiment).items()
    named = {key: measure for key, measure in measures if measure.of_design}
    if not named or not experiment.space.size:
        return
    space, score, tried = experiment.space, experiment.scoring.score_trial, []
    for genome in generator("preflight", "measures").random((DESIGNS, space.size)):
        design = space.decode(genome)
        robots = equip_robots(experiment.scenario, design)
        tried.append(Evaluated(design, robots, (), math.nan, score))
    for key, measure in named.items():
        values = {_compute(key, measure, evaluated) for evaluated in tried}
        if len(values) > 1:
            continue
        problem = f"differ between designs, but is {values.pop():g} for all {DESIGNS} tried"
        if key.startswith(DESCRIPTORS):
            fix = "choose another descriptor, or a design that changes its value"
            raise InputError(f"{key}: must {problem}; {fix}")
        yield f"{key}: should {problem}; remove it (~{key}), or choose another design"


def _compute(key: str, measure: Measure, evaluated: Evaluated) -> float:
    try:
        return float(ask(key, measure.compute, SCORE, evaluated))
    except InputError as error:
        above = "" if str(error).startswith(f"{key}: ") else f"{key}."
        raise InputError(f"{above}{error}") from None


_MAX_RANGE_M = 1000.0  # range above which a sensor's range is probably in millimetres
_MAX_WORKERS_PER_CORE = 4


def check_units(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each angle above a full turn and each range above a kilometre."""
    for name, world in experiment.world.items():
        yaw = world.course.home_yaw_rad
        if abs(yaw) > 2 * math.pi:
            yield (
                f"world.{name}.course.home_yaw_rad: {yaw:g} rad is more than a full turn; if it is "
                f"in degrees, set it to {math.radians(yaw):.4g} in radians"
            )
    for subject in scene.list_subjects(experiment):
        for name, sensor in subject.member.design.sensors.items():
            reach = getattr(sensor, "range_max_m", 0.0)
            if reach > _MAX_RANGE_M:
                yield (
                    f"{subject.member.key}design.sensors.{name}.range_max_m: {reach:g} m is more "
                    f"than {_MAX_RANGE_M:g} m; if it is in millimetres, set it to "
                    f"{reach / 1000:g} in metres"
                )


def check_workers(experiment: Experiment) -> Iterator[str]:
    """Yield a warning if there are many more workers than cores."""
    executor, cores = experiment.executor, available_cores()
    if isinstance(executor, Processes) and executor.workers > _MAX_WORKERS_PER_CORE * cores:
        yield (
            f"executor.workers: {executor.workers} workers share {write_count(cores, 'core')}, "
            "and each worker needs memory; remove the key to get one worker per core"
        )


_LOG = logging.getLogger(__name__)

MAX_TRAJECTORY_BYTES = 2**30  # maximum memory [bytes] for the trajectory of a mission
Check = Callable[[Experiment], Iterator[str] | None]  # yields warnings; raises InputErrors
RobotCheck = Callable[[scene.Subject], Iterator[str] | None]


def preflight(experiment: Experiment) -> None:
    """Try every part of an experiment once, so that invalid input cannot stop the run later."""
    experiment.start_search()
    experiment.fitness.check_worlds(experiment.world)
    for check in CHECKS:
        for warning in check(experiment) or ():
            _LOG.warning("%s", warning)


def check_robots(experiment: Experiment) -> Iterator[str]:
    """Check each robot separately."""
    known = set()
    for subject in scene.list_subjects(experiment):
        try:
            for warning in chain.from_iterable(check(subject) or () for check in ROBOT_CHECKS):
                if warning not in known:  # robots of one kind and design share most warnings
                    yield f"{subject.member.key}{warning}"
                known.add(warning)
        except InputError as error:
            raise InputError(f"{subject.member.key}{error}") from None


def check_length(experiment: Experiment) -> None:
    """Check that the trajectory of a mission fits into memory."""
    design = scene.choose_middle(experiment.space)
    period = max(experiment.controller.period_s, MIN_RECORD_S)
    for name, world in experiment.world.items():
        columns = len(experiment.scenario.name_columns(design, name))
        limit = MAX_TRAJECTORY_BYTES / (8 * columns) * period
        if world.course.time_limit_s > limit:
            raise InputError(
                f"world.{name}.course.time_limit_s: must be at most {limit:.0f} s, not "
                f"{world.course.time_limit_s:g} s, so that a mission's trajectory fits into "
                f"{MAX_TRAJECTORY_BYTES // 2**20} MiB"
            )


def check_bounds(subject: scene.Subject) -> None:
    """Check that the parts accept the bounds of every evolved range."""
    for key, scenario in list_scenarios(subject).items():
        (member,) = scenario.members
        parts = {name: getattr(member, name) for name in ("robot", "controller", "design")}
        try:
            check_genes(subject.space.genes, parts)
        except InputError as error:
            raise InputError(f"{key}{error}") from None


def check_cases(subject: scene.Subject) -> Iterator[str]:
    """Yield a warning if there are fewer trials than cases of a systematic failure."""
    failure, trials = subject.scenario.failure, subject.trials
    if isinstance(failure, SystematicFailure):
        sensors = len(scene.choose_middle(subject.space).mounts)
        cases = failure.count_cases(sensors)
        if trials < cases:
            yield (
                f"failure: {write_count(sensors, 'sensor')} can fail in {cases} ways, but each "
                f"design is tested on only {trials}, drawn at random, one per trial; set "
                f"trials={cases} to test all"
            )


def check_mount(subject: scene.Subject) -> Iterator[str]:
    """Yield a line with the values that evoros chose for the default mount."""
    robot = subject.member.robot
    if not robot.chosen_mount:
        return
    pitch = robot.default_pitch(subject.member.design.sensors.values())
    values = {"link": robot.mount_link, "z_m": f"{robot.mount_z_m:.4g}", "pitch_deg": f"{pitch:g}"}
    chosen = ", ".join(f"robot.mount.{name}={values[name]}" for name in robot.chosen_mount)
    yield f"{robot.name}: the sensors get the default mount: {chosen}"


def check_told(subject: scene.Subject) -> Iterator[str]:
    """Yield a warning for each live controller that receives only some of the readings."""
    count = subject.member.design.max_number * (2 if subject.member.design.mirrored else 1)
    controllers = {
        "controller": subject.member.controller,
        "confirmation.controller": subject.confirming.members[0].controller,
    }
    told: dict[int, str] = {}
    for key, controller in controllers.items():
        limit = controller.told_sensors if isinstance(controller, LiveController) else None
        if limit is not None and limit < count:
            told.setdefault(limit, key)
    for limit, key in told.items():
        yield (
            f"{key}: the program receives only the readings of a design's first {limit} sensors, "
            f"but designs have up to {count}; the controller's layers receive all readings"
        )


CHECKS: Sequence[Check] = (
    check_measures,
    check_length,
    check_units,
    scene.check_waypoints,
    scene.check_room,
    check_workers,
    check_robots,
    check_start,
)

ROBOT_CHECKS: Sequence[RobotCheck] = (
    check_bounds,
    check_mount,
    check_cases,
    scene.check_onsets,
    check_home,
    check_routes,
    check_sight,
    check_gaps,
    check_self_sight,
    check_housings,
    scene.check_view,
    scene.check_meshes,
    check_told,
)
