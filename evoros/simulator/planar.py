"""Wheeled robots on flat ground, simulated tens of thousands of times faster than real time.

The rear axle's centre moves along arcs without slip (bicycle model). A robot stops at obstacles and
other robots, but pushes movable bodies in missions that continue after contact. Rays and shapes are
as in rigid-body engines; ``docs/fidelity.md`` compares the simulators.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, TypeAlias

import numpy as np
from lxml import etree

from evoros.base.arrays import Array
from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, checked, number_between
from evoros.base.errors import InputError
from evoros.base.packing import pack
from evoros.drive.protocol import lag_gain, lag_mean
from evoros.formats.urdf.elements import merge_fixed_links
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import DIRECTION, Robot
from evoros.sensor.protocol import CONTACT, RANGE
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines import planar_rules
from evoros.simulator.engines.planar_bodies import can_push, find_movables, place_bodies
from evoros.simulator.engines.planar_rules import place_crowd
from evoros.simulator.engines.planar_sensing import sense, sense_signals
from evoros.simulator.engines.rays import lay_out_steered_sight, sensor_beams
from evoros.simulator.engines.teams import TeamSimulator, check_number
from evoros.simulator.protocol import PlacedRobot, RuleSimulation, RuleSimulator, SimulationRules
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.standing import obstacle_arrays, sight_rows, world_arrays

_Description: TypeAlias = tuple[str, tuple[str, ...], tuple[str, ...], frozenset[str]]
"""XML, wheel joints, caster links and exposed links of a robot."""


def list_shapes(robots: Sequence[Robot]) -> tuple[Array, Array, list[int]]:
    """Return the ray shapes of several robots, the shapes' faces, and the counts per robot."""
    if len(robots) == 1:  # robots do not detect themselves
        return *sight_rows([])[:2], [0]
    return _list_shapes(tuple(map(_describe, robots)))


def _describe(robot: Robot) -> _Description:
    drive = robot.drive
    wheels, casters = tuple(drive.wheel_joints), tuple(drive.caster_links)
    return robot.engine_text, wheels, casters, robot.exposed_links


@lru_cache(maxsize=64)
def _list_shapes(robots: tuple[_Description, ...]) -> tuple[Array, Array, list[int]]:
    solids = [_find_solids(*robot) for robot in robots]
    rows, faces, _ = sight_rows([solid for part in solids for solid in part])
    return rows, faces, list(map(len, solids))


def _find_solids(
    text: str, wheels: tuple[str, ...], casters: tuple[str, ...], exposed: frozenset[str]
) -> list[tuple[Shape, Pose]]:
    """Return the shapes that can touch obstacles, in the robot's frame, as loaded by engines."""
    elements = etree.fromstring(text.encode())
    root = etree.fromstring(merge_fixed_links(elements, casters).encode())
    urdf = read_tree(root, "robot")
    rolling = {urdf.joints[name].child for name in wheels} | set(casters)
    return [
        (shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling or link in exposed
        for shape in shapes
    ]


def lay_out(
    robots: Sequence[PlacedRobot], world: World, time_step: float, lags: tuple[float, float]
) -> tuple[Array, Array]:
    """Return the parameters and memory; ``lags`` are time constants [s] of steering and drive."""
    tallest = max(robot.height_m for robot, _ in robots)
    shapes, faces, counts = list_shapes([robot for robot, _ in robots])
    places, packed = [np.zeros(layout.PLACES)], []
    for (robot, _), count in zip(robots, counts, strict=True):
        hull, sight = _lay_out_surroundings(robot, world, tallest)
        probes = layout.list_probes(robot, world.gravity_mps2)
        packed.append((pack(hull), pack(sight), pack(probes)))
        sizes = [*map(len, packed[-1]), robot.signal_count, len(hull.outline), len(probes.contact)]
        places.append(places[-1] + [*sizes, count])
    hulls, sights, probe_rows = map(np.concatenate, zip(*packed, strict=True))
    drives = np.array([_describe_drive(robot, time_step, lags) for robot, _ in robots])
    _, movables = find_movables(world, tallest)
    placed = place_bodies(movables)
    if world.crowd is not None:
        movables = movables._replace(walk=world.crowd.parameters)
        placed = place_crowd(placed, world.crowd, len(robots))
    rows = hulls, sights, probe_rows, shapes, faces, pack(movables)
    memory = layout.Memory(
        np.zeros((len(robots), layout.MOTION_SIZE)),
        np.zeros((int(places[-1][layout.CORNERS]), 2)),
        np.zeros(int(places[-1][layout.TOUCHES])),
        np.zeros_like(shapes),
        pack(placed),
    )
    for index, (_, (x, y, _, yaw)) in enumerate(robots):
        layout.place_robot(memory, index, x, y, yaw)
    return pack(layout.Plane(time_step, drives, np.array(places), *rows)), pack(memory)


def _describe_drive(robot: Robot, time_step: float, lags: tuple[float, float]) -> layout.Drive:
    drive = robot.drive
    steering_lag = lags[0] if drive.steering_joints else 0.0
    return layout.Drive(
        lag_gain(time_step, steering_lag),
        lag_gain(time_step, lags[1]),
        lag_mean(time_step, steering_lag),
        lag_mean(time_step, lags[1]),
        drive.max_speed_mps,
        drive.speed_limit_offset_m,
        drive.steering_limit,
        drive.wheelbase_m / drive.turn_ratio,
        drive.rear_axle_x_m,
    )


def _lay_out_surroundings(
    robot: Robot, world: World, tallest: float
) -> tuple[layout.Hull, layout.Sight]:
    beams, rays = sensor_beams(robot), robot.ray_table.rows[:, DIRECTION : DIRECTION + 3]
    rows = layout.beam_rows(robot, robot.sensor_frames, beams, rays)
    radius = float(np.sqrt((robot.outline * robot.outline).sum(axis=1)).max())
    reaches, mass = (robot.height_m, radius, _measure_sight(rows)), 0.0
    fixed, movables = find_movables(world, tallest)
    if len(movables.bodies):
        masses = robot.urdf_elements().iterfind("link/inertial/mass")
        mass = sum(float(element.get("value", "0")) for element in masses)
        grid, *obstacles = obstacle_arrays(fixed, *reaches)
    else:
        grid, *obstacles = world_arrays(world, *reaches)
    steered = lay_out_steered_sight(robot, np.array([beam.clear_range for beam in beams]))
    sensors = rows, layout.group_rows(robot, rows, rays), rays, steered
    return (
        layout.Hull(radius, robot.height_m, mass, robot.outline, grid, *obstacles[:4]),
        layout.Sight(*sensors, grid, *obstacles[4:]),
    )


def _measure_sight(beams: Array) -> float:
    """Return the sensors' maximum reach [m], rounded up to 0.5 m so that designs share arrays."""
    if not len(beams):
        return 0.5
    offsets = np.sqrt((beams[:, :2] * beams[:, :2]).sum(axis=1))
    farthest = (offsets + beams[:, layout.FREE_RANGE]).max()
    return math.ceil(2.0 * float(farthest)) / 2


MAX_STEP_S = 0.1  # maximum [s]; contacts are tested after each step, so longer steps cross walls


@dataclass(frozen=True)
@checked
class Planar(TeamSimulator, RuleSimulator):
    """The planar simulator: wheels without slip, servos with lag, obstacles that stop the robot."""

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.02  # [s]
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the steering servos
    drive_lag_s: Annotated[float, NOT_NEGATIVE] = 0.0  # time constant of the drive's speed
    packages = ("numba",)

    def choose_rules(self, world: World, robots: Sequence[Robot]) -> SimulationRules:
        """Return the rules; pushing, walkers and sensors without rays compile more slowly."""
        measured = {sensor.measures for robot in robots for sensor in robot.mounted_sensors()}
        pushes = can_push(world) or CONTACT in measured
        among = planar_rules.advance_pushing if pushes else planar_rules.advance
        return SimulationRules(
            planar_rules.observe,
            sense if measured <= {RANGE} else sense_signals,
            among if world.crowd is None else planar_rules.advance_among_walkers,
        )

    def check_world(self, world: World) -> None:
        """Reject worlds without level ground."""
        if not _is_level(world):
            raise InputError(
                "the ground is a height field or a tilted plane, but simulator=planar needs level "
                "ground; use simulator=physics"
            )

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[RuleSimulation]:
        """Open a simulation with each robot at rest at its home pose."""
        self.check_world(world)  # a sampler may have drawn this world
        check_number(robots)
        rules = self.choose_rules(world, [robot for robot, _ in robots])
        lags = self.steering_lag_s, self.drive_lag_s
        yield RuleSimulation(rules, *lay_out(robots, world, self.time_step, lags))


@lru_cache(maxsize=KEPT_WORLDS)
def _is_level(world: World) -> bool:
    return world.is_level
