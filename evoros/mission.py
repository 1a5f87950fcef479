"""One mission: a design in a world under given draws, from the parts to the outcome."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from evoros import outcome as result
from evoros.design import SensorDesign
from evoros.errors import InputError, SimulationError, check, instance_of, mapping_of
from evoros.flight import (
    COLLISION,
    COMPLETED,
    NOT_FINITE,
    TIME_LIMIT,
    Arrays,
    Link,
    Step,
    Timing,
    fly,
    publish,
)
from evoros.genes import replaced
from evoros.outcome import TRAJECTORY, Flight, Outcome, measure
from evoros.rng import generator
from evoros.robot import Robot
from evoros.types import (
    COMMAND_SIZE,
    POSE_SIZE,
    STATE_SIZE,
    Array,
    Channels,
    Controller,
    Design,
    Failure,
    Fault,
    Filter,
    Simulator,
    StartedLayer,
)
from evoros.world import World

ENDED = {
    COMPLETED: result.COMPLETED,
    COLLISION: result.COLLISION,
    TIME_LIMIT: result.TIME_LIMIT,
}
AVOIDING = "avoiding"
Draws = Callable[[str], Generator]  # the generator of a named part


@dataclass(frozen=True)
class Task:
    """All that a mission needs besides the design, the world's name and the draws.

    The field names are the groups of the configuration, so that the key of an evolved value
    (``controller.avoidance.range_m``) is its place in here.

    Raises:
        InputError: a part of the wrong kind, or a period that is no multiple of the time step.
    """

    robot: Robot
    world: Mapping[str, World]
    design: SensorDesign
    failure: Failure
    controller: Controller
    simulator: Simulator

    def __post_init__(self) -> None:
        check(
            self,
            robot=instance_of(Robot, "a robot"),
            world=mapping_of(World, "worlds"),
            design=instance_of(SensorDesign, "a sensor design"),
            failure=instance_of(Failure, "a failure model (draw)"),
            controller=instance_of(Controller, "a controller (period_s, localization and open)"),
            simulator=instance_of(Simulator, "a simulator (time_step and open)"),
        )
        if not self.world:
            raise InputError("world: must have at least one world, not none; add world=case_study")
        self.steps_of("controller.period_s", self.controller.period_s)
        for name, sensor in self.design.sensors.items():
            self.steps_of(f"design.sensors.{name}.period_s", sensor.period_s)

    def steps_of(self, key: str, period: float) -> int:
        """How many time steps a period has.

        Raises:
            InputError: it is no whole multiple.
        """
        step = self.simulator.time_step
        count = round(period / step)
        if count < 1 or not math.isclose(count * step, period, rel_tol=1e-9):
            nearest = max(1, count) * step
            raise InputError(
                f"{key}: must be a whole multiple of simulator.time_step ({step:g} s), "
                f"not {period:g} s; set it to {nearest:g}, or choose another step"
            )
        return count

    def embody(self, design: Design) -> "Task":
        """This task with the robot carrying the design's sensors and its evolved values applied.

        Raises:
            InputError: a value that the part refuses, a sensor that cannot be mounted.
        """
        task = replaced(self, design.values)
        return replace(task, robot=task.robot.equipped(design.mounts, task.design.sensors))


@dataclass(frozen=True)
class Mission:
    """Which design in which world under which draws: with the task, all that an outcome needs."""

    generation: int
    design_id: int
    design: Design
    world: str
    trial: int
    purpose: str  # selection, validation or evaluation
    draws: str  # the key of all random draws

    @property
    def place(self) -> "Place":
        """What identifies the mission in its run."""
        return (self.generation, self.design_id, self.world, self.trial)


Place = tuple[int, int, str, int]  # generation, design, world, trial


def run_mission(task: Task, mission: Mission) -> tuple[Outcome, Array]:
    """Fly the mission; returns its outcome and its trajectory, (rows, columns + sensors).

    A failure of the simulation itself is an outcome, because it would recur.
    """
    try:
        return _run(task.embody(mission.design), mission)
    except SimulationError as error:
        return not_flown(task, mission, result.SIMULATION_FAILURE, str(error)), np.empty((0, 0))


def not_flown(task: Task, mission: Mission, ended: str, reason: str) -> Outcome:
    """The outcome of a mission that could not be flown."""
    limit = task.world[mission.world].course.time_limit_s
    return Outcome.failure(ended, reason, limit, len(mission.design.mounts))


def _run(task: Task, mission: Mission) -> tuple[Outcome, Array]:
    robot, world = task.robot, task.world[mission.world]

    def draws(part: str) -> Generator:
        return generator(mission.draws, part)

    forward = world.course.goes_forward(mission.generation, draws("course"))
    route = world.course.route(forward)
    timing = _timing(task, world)
    sensors = len(robot.mounts)
    arrays = Arrays(
        state=np.zeros(STATE_SIZE),
        pose=np.zeros(STATE_SIZE),
        leg=np.array([*world.course.home[:2], *route[0]], dtype=float),
        command=np.zeros(COMMAND_SIZE),
        raw=np.zeros(sensors),
        readings=np.zeros(sensors),
        trajectory=np.empty((timing.limit // timing.record_every + 2, len(TRAJECTORY) + sensors)),
    )
    faults = task.failure.draw(_channels(task, 0, sensors), draws("failure"))
    filters = _sensor_chain(task, arrays, faults, timing, draws)
    localization = _chain(
        "localization",
        task.controller.localization,
        _pose_channels(task.controller.period_s),
        arrays.pose[:POSE_SIZE],
        timing.decide_every,
        draws,
    )
    with (
        task.controller.open(robot, lambda name: draws(f"controller.{name}")) as layers,
        task.simulator.open(robot, world) as simulation,
    ):
        count = fly(
            simulation.observe,
            simulation.sense,
            simulation.advance,
            tuple(filters),
            tuple(localization),
            tuple(Step(layer.rule, layer.parameters, layer.memory) for layer in layers),
            route,
            world.course.acceptance_m,
            world.course.end_on_collision,
            timing,
            arrays,
        )
    if count.ended == NOT_FINITE:
        raise SimulationError(f"the state is not finite after {count.ticks * timing.tick:g} s")
    first = count.first_collision
    flight = Flight(
        ended=ENDED[count.ended],
        time=count.ticks * timing.tick,
        visited=count.visited,
        collisions=count.collisions,
        first_collision=first * timing.tick if first >= 0 else math.nan,
        trajectory=arrays.trajectory[: count.rows],
    )
    return measure(flight, robot, world, route, _number(layers), faults), flight.trajectory


def _number(layers: Sequence[StartedLayer]) -> int:
    """The number that the trajectory gives to the mode of avoiding; -1: there is none."""
    return next((i + 1 for i, layer in enumerate(layers) if layer.mode == AVOIDING), -1)


def _timing(task: Task, world: World) -> Timing:
    """All periods in ticks of their greatest common divisor."""
    decide = task.steps_of("controller.period_s", task.controller.period_s)
    used = {mount.sensor for mount in task.robot.mounts}
    periods = [task.steps_of(name, task.robot.sensors[name].period_s) for name in sorted(used)]
    sense = math.gcd(*periods) if periods else decide
    common = math.gcd(decide, sense)
    tick = common * task.simulator.time_step
    limit = math.ceil(round(world.course.time_limit_s / tick, 6))
    return Timing(tick, sense // common, decide // common, sense // common, limit)


def _channels(task: Task, first: int, last: int) -> Channels:
    """What filters may know of the sensors ``first`` to ``last`` - 1."""
    sensors = [task.robot.sensors[mount.sensor] for mount in task.robot.mounts[first:last]]
    return Channels(
        low=np.array([sensor.range_min_m for sensor in sensors]),
        high=np.array([sensor.range_max_m for sensor in sensors]),
        position=np.ascontiguousarray(task.robot.sensor_poses()[first:last, :3]),
        period=min((sensor.period_s for sensor in sensors), default=task.controller.period_s),
    )


def _pose_channels(period: float) -> Channels:
    boundless = np.full(POSE_SIZE, np.inf)
    return Channels(-boundless, boundless, np.zeros((POSE_SIZE, 3)), period)


def _sensor_chain(
    task: Task, arrays: Arrays, faults: tuple[Fault, ...], timing: Timing, draws: Draws
) -> list[Link]:
    """For each sensor type in turn: publish, its own filters, then the faults."""
    names = [mount.sensor for mount in task.robot.mounts]
    chain: list[Link] = []
    for name in dict.fromkeys(names):
        first = names.index(name)
        last = first + names.count(name)
        channels, values = _channels(task, first, last), arrays.readings[first:last]
        every = round(channels.period / timing.tick)
        part = f"sensor.{name}"
        raw = arrays.raw[first:last]
        chain.append(Link(every, publish, np.empty(0), raw, draws(part), values))
        chain += _chain(part, task.robot.sensors[name].filters, channels, values, every, draws)
        for number, fault in enumerate(faults):
            onset, rng = fault.onset[first:last], draws(f"fault.{number}.{name}")
            if np.isfinite(onset).any():
                started = fault.filter.start(channels, onset, rng)
                chain.append(Link(every, fault.filter.rule, *started, rng, values))
    return chain


def _chain(
    part: str,
    filters: Mapping[str, Filter],
    channels: Channels,
    values: Array,
    every: int,
    draws: Draws,
) -> list[Link]:
    """The filters started for one mission, each with a stream of its own."""
    chain = []
    for name, each in filters.items():
        rng = draws(f"{part}.{name}")
        started = each.start(channels, np.zeros(channels.size), rng)
        chain.append(Link(every, each.rule, *started, rng, values))
    return chain
