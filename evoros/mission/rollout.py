"""Runs one mission, from a design to its outcome."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, POSE_SIZE, STATE_SIZE, Array
from evoros.base.errors import InputError, LaunchError, SimulationError
from evoros.base.rng import generator
from evoros.mission import outcome
from evoros.mission.compiled_loop import Loop, prepare
from evoros.mission.live_layers import open_layers
from evoros.mission.loop import (
    COLLISION,
    COMPLETED,
    NOT_FINITE,
    TIME_LIMIT,
    Arrays,
    Goal,
    LoopInputs,
    LoopResult,
    Timing,
)
from evoros.mission.loop_inputs import collect_inputs
from evoros.mission.metrics import Rollout, measure
from evoros.mission.mission import Mission
from evoros.mission.outcome import TRAJECTORY, Outcome
from evoros.mission.pipeline import (
    Draws,
    describe_sensors,
    start_localization,
    start_sensor_filters,
)
from evoros.mission.plan import count_round
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.world.model import World

ENDED = {
    COMPLETED: outcome.COMPLETED,
    COLLISION: outcome.COLLISION,
    TIME_LIMIT: outcome.TIME_LIMIT,
}
AVOIDING = "avoiding"
MIN_RECORD_S = 0.05
"""A trajectory has a row for each decision, or fewer if decisions are closer than this time [s]."""

Prepare = Callable[[LoopInputs], tuple[Loop, LoopInputs]]
"""Chooses the loop for the inputs, and adapts these to it."""


def run_mission(
    scenario: Scenario, mission: Mission, prepare: Prepare = prepare
) -> tuple[Outcome, Array]:
    """Run a mission and return its outcome and its trajectory, (rows, columns + channels).

    A failure of the simulation is an outcome, because it would recur. So are evolved values that
    a part refuses, because other designs can still be evaluated.

    Raises:
        InputError: a part refuses to start for another reason than an evolved value.
        PilotLost: a controller outside of this process ended or did not answer.
    """
    try:
        equipped = scenario.with_design(mission.design)
    except InputError as error:
        ended, reason = outcome.REFUSED, str(error)
    else:
        try:
            return _run(equipped, mission, prepare)
        except SimulationError as error:
            ended, reason = outcome.SIMULATION_FAILURE, str(error)
        except LaunchError:
            raise
        except InputError as error:
            if not mission.design.values:
                raise
            ended, reason = outcome.REFUSED, str(error)
    return failed_mission(scenario, mission, ended, reason), empty_trajectory(scenario, mission)


def failed_mission(scenario: Scenario, mission: Mission, ended: str, reason: str) -> Outcome:
    """Create the outcome of a mission that could not be run."""
    limit = scenario.world[mission.world].course.time_limit_s
    return Outcome.failure(ended, reason, limit, len(mission.design.mounts))


def empty_trajectory(scenario: Scenario, mission: Mission) -> Array:
    """Create the trajectory of a mission that could not be run, with all columns and no row."""
    return np.empty((0, len(TRAJECTORY) + len(scenario.name_readings(mission.design))))


def _run(scenario: Scenario, mission: Mission, prepare: Prepare) -> tuple[Outcome, Array]:
    """Run a mission of a scenario whose robot has the sensors of the design."""
    robot, controller = scenario.robot, scenario.controller
    world = scenario.world[mission.world].at(mission.draws)
    course, timing = world.course, _compute_timing(scenario, world)
    draws: Draws = partial(generator, mission.draws)
    number = count_round(mission.purpose, mission.generation, mission.trial)
    route = course.route(course.goes_forward(number, draws("course")))
    goal = Goal(route, course.acceptance_m, course.end_on_collision)
    faults = scenario.failure.draw(describe_sensors(robot), draws("failure"))
    with open_layers(scenario, course, route, draws) as layers:
        arrays = _create_arrays(timing, world, route, robot, len(layers))
        ranges, readings, pose = arrays.ranges, arrays.readings, arrays.pose[:POSE_SIZE]
        filters = start_sensor_filters(robot, faults, ranges, readings, timing.tick, draws)
        localization = start_localization(controller, pose, draws)
        with scenario.simulator.open(robot, world) as simulation:
            loop, inputs = prepare(collect_inputs(simulation, filters, localization, layers))
            result = loop(inputs, goal, timing, arrays)
    rollout = _convert_result(result, timing, arrays, controller.modes)
    return measure(rollout, robot, world, route, faults), rollout.trajectory


def _create_arrays(timing: Timing, world: World, route: Array, robot: Robot, layers: int) -> Arrays:
    channels = robot.channel_count
    rows = timing.limit // timing.record_every + 2
    return Arrays(
        state=np.zeros(STATE_SIZE),
        pose=np.zeros(STATE_SIZE),
        leg=np.array([*world.course.home[:2], *route[0]], dtype=float),
        command=np.zeros(COMMAND_SIZE),
        ranges=np.zeros(robot.beam_count),
        readings=np.zeros(channels),
        decisions=np.zeros(1 + layers),
        trajectory=np.empty((rows, len(TRAJECTORY) + channels)),
    )


def _compute_timing(scenario: Scenario, world: World) -> Timing:
    """Express all periods in ticks of their greatest common divisor."""
    decide = scenario.count_steps("controller.period_s", scenario.controller.period_s)
    types = {mount.sensor for mount in scenario.robot.mounts}
    periods = [
        scenario.count_steps(name, scenario.robot.sensors[name].period_s) for name in sorted(types)
    ]
    sense = math.gcd(*periods) if periods else decide
    common = math.gcd(decide, sense)
    tick = common * scenario.simulator.time_step
    limit = math.ceil(round(world.course.time_limit_s / tick, 6))
    decide //= common
    record = decide * math.ceil(MIN_RECORD_S / (decide * tick) - 1e-9)
    return Timing(tick, sense // common, decide, record, limit)


def _convert_result(
    result: LoopResult, timing: Timing, arrays: Arrays, modes: Sequence[str]
) -> Rollout:
    """Convert what the loop counted to seconds and shares.

    Raises:
        SimulationError: the state of the simulation was not finite.
    """
    time, first = result.ticks * timing.tick, result.first_collision
    if result.ended == NOT_FINITE:
        raise SimulationError(f"the state is not finite after {time:g} s")
    return Rollout(
        ended=ENDED[result.ended],
        time=time,
        visited=result.visited,
        collisions=result.collisions,
        first_collision=first * timing.tick if first >= 0 else math.nan,
        avoiding=_share_avoiding(modes, arrays.decisions),
        trajectory=arrays.trajectory[: result.rows],
    )


def _share_avoiding(modes: Sequence[str], decisions: Array) -> float:
    """Return the share of the decisions (1 + layers,) that the avoiding layers took."""
    counts = zip(modes, decisions[1:], strict=True)
    avoiding = sum(float(count) for mode, count in counts if mode == AVOIDING)
    return avoiding / max(float(decisions.sum()), 1.0)
