"""Runs one mission, from a design to its outcome."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, POSE_SIZE, STATE_SIZE, Array
from evoros.base.errors import InputError, SimulationError
from evoros.base.rng import generator
from evoros.mission import outcome as result
from evoros.mission.compiled_loop import Loop, prepare
from evoros.mission.loop import (
    COLLISION,
    COMPLETED,
    NOT_FINITE,
    TIME_LIMIT,
    Arrays,
    LoopInputs,
    LoopResult,
    Timing,
    loop_inputs,
)
from evoros.mission.metrics import Rollout, measure
from evoros.mission.mission import Mission
from evoros.mission.outcome import TRAJECTORY, Outcome
from evoros.mission.pipeline import localization_chain, sensor_chain, sensor_channels
from evoros.mission.scenario import Scenario
from evoros.world.model import World

ENDED = {
    COMPLETED: result.COMPLETED,
    COLLISION: result.COLLISION,
    TIME_LIMIT: result.TIME_LIMIT,
}
AVOIDING = "avoiding"
LEAST_RECORD_S = 0.05
"""A trajectory has a row for each decision, but not more than one in this time."""


Prepare = Callable[[LoopInputs], tuple[Loop, LoopInputs]]
"""Chooses the loop and makes the parts ready for it."""


def run_mission(
    scenario: Scenario, mission: Mission, prepare: Prepare = prepare
) -> tuple[Outcome, Array]:
    """Fly the mission; returns its outcome and its trajectory, (rows, columns + sensors).

    A failure of the simulation itself is an outcome, because it would recur; so are evolved values
    that a part refuses, which say nothing against the other designs.

    Raises:
        InputError: a part refuses to start, and it is not for an evolved value.
    """
    try:
        equipped = scenario.with_design(mission.design)
    except InputError as error:
        ended, reason = result.REFUSED, str(error)
    else:
        try:
            return _run(equipped, mission, prepare)
        except SimulationError as error:
            ended, reason = result.SIMULATION_FAILURE, str(error)
        except InputError as error:
            if not mission.design.values:
                raise
            ended, reason = result.REFUSED, str(error)
    return failed_mission(scenario, mission, ended, reason), empty_trajectory(mission)


def failed_mission(scenario: Scenario, mission: Mission, ended: str, reason: str) -> Outcome:
    """The outcome of a mission that could not be flown."""
    limit = scenario.world[mission.world].course.time_limit_s
    return Outcome.failure(ended, reason, limit, len(mission.design.mounts))


def empty_trajectory(mission: Mission) -> Array:
    """The trajectory of a mission that could not be flown: all columns and no row."""
    return np.empty((0, len(TRAJECTORY) + len(mission.design.mounts)))


def _run(scenario: Scenario, mission: Mission, prepare: Prepare) -> tuple[Outcome, Array]:
    """``scenario`` is equipped: its robot carries the design's sensors."""
    robot, controller = scenario.robot, scenario.controller
    world = scenario.world[mission.world].at(mission.draws)

    def draws(part: str) -> Generator:
        return generator(mission.draws, part)

    route = world.course.route(world.course.goes_forward(mission.generation, draws("course")))
    timing = _timing(scenario, world)
    arrays = _arrays(timing, world, route, len(robot.mounts))
    faults = scenario.failure.draw(sensor_channels(robot), draws("failure"))
    chain = sensor_chain(robot, faults, arrays.raw, arrays.readings, timing.tick, draws)
    pose = arrays.pose[:POSE_SIZE]
    localization = localization_chain(controller.localization, pose, controller.period_s, draws)
    with (
        controller.open(robot, lambda name: draws(f"controller.{name}")) as layers,
        scenario.simulator.open(robot, world) as simulation,
    ):
        fly, parts = prepare(loop_inputs(simulation, chain, localization, layers))
        count = fly(
            *parts,
            route,
            world.course.acceptance_m,
            world.course.end_on_collision,
            timing,
            arrays,
            modes := np.zeros(len(layers) + 1),
        )
    flight = _rollout(count, timing, arrays.trajectory, _avoiding(controller.modes, modes))
    return measure(flight, robot, world, route, faults), flight.trajectory


def _arrays(timing: Timing, world: World, route: Array, sensors: int) -> Arrays:
    rows = timing.limit // timing.record_every + 2
    return Arrays(
        state=np.zeros(STATE_SIZE),
        pose=np.zeros(STATE_SIZE),
        leg=np.array([*world.course.home[:2], *route[0]], dtype=float),
        command=np.zeros(COMMAND_SIZE),
        raw=np.zeros(sensors),
        readings=np.zeros(sensors),
        trajectory=np.empty((rows, len(TRAJECTORY) + sensors)),
    )


def _timing(scenario: Scenario, world: World) -> Timing:
    """All periods in ticks of their greatest common divisor."""
    decide = scenario.steps_of("controller.period_s", scenario.controller.period_s)
    used = {mount.sensor for mount in scenario.robot.mounts}
    periods = [
        scenario.steps_of(name, scenario.robot.sensors[name].period_s) for name in sorted(used)
    ]
    sense = math.gcd(*periods) if periods else decide
    common = math.gcd(decide, sense)
    tick = common * scenario.simulator.time_step
    limit = math.ceil(round(world.course.time_limit_s / tick, 6))
    decide //= common
    record = decide * math.ceil(LEAST_RECORD_S / (decide * tick) - 1e-9)
    return Timing(tick, sense // common, decide, record, limit)


def _rollout(count: LoopResult, timing: Timing, trajectory: Array, avoiding: float) -> Rollout:
    """What the loop left, in seconds.

    Raises:
        SimulationError: the simulation lost its state.
    """
    time, first = count.ticks * timing.tick, count.first_collision
    if count.ended == NOT_FINITE:
        raise SimulationError(f"the state is not finite after {time:g} s")
    return Rollout(
        ended=ENDED[count.ended],
        time=time,
        visited=count.visited,
        collisions=count.collisions,
        first_collision=first * timing.tick if first >= 0 else math.nan,
        avoiding=avoiding,
        trajectory=trajectory[: count.rows],
    )


def _avoiding(modes: Sequence[str], decisions: Array) -> float:
    """Return the share of the decisions (1 + layers,) that the avoiding layers took."""
    counts = zip(modes, decisions[1:], strict=True)
    avoiding = sum(float(count) for mode, count in counts if mode == AVOIDING)
    return avoiding / max(float(decisions.sum()), 1.0)
