"""Finds bad input before a run starts: tries all that a mission needs except its engine."""

import logging
from collections.abc import Callable, Iterator, Sequence
from itertools import chain

from evoros.base.errors import InputError
from evoros.controller.protocol import LimitedController
from evoros.design.genes import check_genes
from evoros.evolution.experiment import Experiment
from evoros.failure.protocol import SystematicFailure
from evoros.fitness.protocol import SelectiveFitness
from evoros.mission.start import MIN_RECORD_S
from evoros.preflight.home import check_home
from evoros.preflight.measures import check_measures
from evoros.preflight.onsets import check_onsets
from evoros.preflight.routes import check_routes
from evoros.preflight.scene import check_view, check_waypoints
from evoros.preflight.sight import check_housings, check_self_sight, check_sight
from evoros.preflight.start import check_start, list_scenarios
from evoros.preflight.subject import Subject, choose_middle, list_subjects
from evoros.preflight.units import check_units, check_workers
from evoros.preflight.walkers import check_room

_LOG = logging.getLogger(__name__)

MAX_TRAJECTORY_BYTES = 2**30
"""The maximum memory of the trajectory of one mission."""

Check = Callable[[Experiment], Iterator[str]]
"""Yields a warning for each doubt; raises an InputError, whose message names the key."""
RobotCheck = Callable[[Subject], Iterator[str]]


def preflight(experiment: Experiment) -> None:
    """Try every part of an experiment once, so that bad input does not stop its run later.

    The warnings of the checks are logged.

    Raises:
        InputError: a part refuses its input.
    """
    for check in CHECKS:
        for warning in check(experiment):
            _LOG.warning("%s", warning)


def check_search(experiment: Experiment) -> Iterator[str]:
    """Start the search."""
    experiment.start_search()
    yield from ()


def check_robots(experiment: Experiment) -> Iterator[str]:
    """Check each robot as if it were alone."""
    known = set()
    for subject in list_subjects(experiment):
        try:
            for warning in chain.from_iterable(check(subject) for check in ROBOT_CHECKS):
                if warning not in known:  # robots of one kind and design share most of them
                    yield f"{subject.key}{warning}"
                known.add(warning)
        except InputError as error:
            raise InputError(f"{subject.key}{error}") from None


def check_fitness(experiment: Experiment) -> Iterator[str]:
    """Require that the worlds have what the fitness needs."""
    if isinstance(experiment.fitness, SelectiveFitness):
        experiment.fitness.check_worlds(experiment.world)
    yield from ()


def check_length(experiment: Experiment) -> Iterator[str]:
    """Require that the trajectory of a mission fits into memory."""
    design = choose_middle(experiment.space)
    period = max(experiment.controller.period_s, MIN_RECORD_S)
    for name, world in experiment.world.items():
        columns = len(experiment.scenario.name_columns(design, name))
        limit = MAX_TRAJECTORY_BYTES / (8 * columns) * period
        if world.course.time_limit_s > limit:
            raise InputError(
                f"world.{name}.course.time_limit_s: must be at most {limit:.0f} s, so that the "
                f"trajectory of a mission fits into {MAX_TRAJECTORY_BYTES // 2**20} MiB, not "
                f"{world.course.time_limit_s:g}; lower it (course.time_limit_s)"
            )
    yield from ()


def check_bounds(subject: Subject) -> Iterator[str]:
    """Require that the parts accept the ends of all evolved ranges."""
    for key, scenario in list_scenarios(subject).items():
        (member,) = scenario.members
        parts = {name: getattr(member, name) for name in ("robot", "controller", "design")}
        try:
            check_genes(subject.space.genes, parts)
        except InputError as error:
            raise InputError(f"{key}{error}") from None
    yield from ()


def check_cases(subject: Subject) -> Iterator[str]:
    """Yield a warning if the trials leave out cases of a systematic failure."""
    failure, trials = subject.failure, subject.trials
    if isinstance(failure, SystematicFailure):
        sensors = len(choose_middle(subject.space).mounts)
        cases = failure.count_cases(sensors)
        if trials < cases:
            yield (
                f"failure: {sensors} sensors can fail in {cases} ways, and designs meet the first "
                f"{trials} of them, one in each trial; set trials={cases} for all"
            )


def check_mount(subject: Subject) -> Iterator[str]:
    """Yield the parts of the default mount that were chosen for the robot."""
    robot = subject.robot
    if not robot.chosen_mount:
        return
    pitch = robot.default_pitch(subject.design.sensors.values())
    values = {"link": robot.mount_link, "z_m": f"{robot.mount_z_m:.4g}", "pitch_deg": f"{pitch:g}"}
    chosen = ", ".join(f"robot.mount.{name}={values[name]}" for name in robot.chosen_mount)
    yield f"{robot.name}: chosen for the robot and its sensors: {chosen}"


def check_told(subject: Subject) -> Iterator[str]:
    """Yield a warning for each controller that is told fewer sensors than designs may have."""
    count = subject.design.max_number * (2 if subject.design.mirrored else 1)
    controllers = {
        "controller": subject.controller,
        "confirmation.controller": subject.confirming.members[0].controller,
    }
    told: dict[int, str] = {}
    for key, controller in controllers.items():
        if isinstance(controller, LimitedController) and controller.told_sensors < count:
            told.setdefault(controller.told_sensors, key)
    for limit, key in told.items():
        yield (
            f"{key}: {limit} sensors are told to its program, the first of each design, and "
            f"designs have up to {count}; its layers see all"
        )


CHECKS: Sequence[Check] = (
    check_search,
    check_measures,
    check_fitness,
    check_length,
    check_units,
    check_waypoints,
    check_room,
    check_workers,
    check_robots,
    check_start,
)

ROBOT_CHECKS: Sequence[RobotCheck] = (
    check_bounds,
    check_mount,
    check_cases,
    check_onsets,
    check_home,
    check_routes,
    check_sight,
    check_self_sight,
    check_housings,
    check_view,
    check_told,
)
