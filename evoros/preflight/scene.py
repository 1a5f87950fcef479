"""Checks worlds: distant waypoints, sensors above obstacles, space for walkers, fault onsets."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array, product
from evoros.base.checks import is_number
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.design.team import TeamSpace
from evoros.evolution.experiment import Experiment
from evoros.failure.protocol import DISTANCE, PLACE, WAYPOINT, Fault, Trigger, draw_faults
from evoros.geometry.footprint import find_bounds, project_bodies, top_height
from evoros.mission.member import Member
from evoros.mission.scenario import Scenario
from evoros.mission.triggers import measure_legs
from evoros.robot.model import Robot
from evoros.sensor.protocol import sees
from evoros.simulator.protocol import PlacedRobot
from evoros.world.mesh_areas import measure_meshes
from evoros.world.model import World

RANDOM_DESIGNS = 5


class Subject(NamedTuple):
    """One robot of an experiment, treated as the only robot."""

    member: Member  # the robot in the team, with its key
    scenario: Scenario  # scenario with this robot's course in all worlds
    confirming: Scenario
    trials: int

    @property
    def space(self) -> DesignSpace:
        """The design space of the robot."""
        return self.member.space


def list_subjects(experiment: Experiment) -> list[Subject]:
    """Return the robots of an experiment as subjects."""
    subjects = []
    for i, member in enumerate(experiment.members):
        scenario = confirming = _isolate(experiment.scenario, i)
        if experiment.confirming is not experiment.scenario:
            confirming = _isolate(experiment.confirming, i)
        subjects.append(Subject(member, scenario, confirming, experiment.trials))
    return subjects


def _isolate(scenario: Scenario, index: int) -> Scenario:
    member = scenario.members[index]
    alone = Member(member.robot, member.design, member.controller)
    return replace(scenario, members=(alone,), world=scenario.place_worlds(member))


def choose_middle(space: DesignSpace | TeamSpace) -> Design:
    """Return the design at the centre of a search space."""
    return space.decode(space.middle)


def try_designs(subject: Subject) -> Iterator[Member]:
    """Yield the robot with designs at the middle, both ends and random points of the space."""
    space, rng = subject.space, generator("preflight", "designs")
    genomes = [space.middle, *(np.full(space.size, share) for share in (0.0, 1.0))]
    for genome in (*genomes, *rng.random((RANDOM_DESIGNS, space.size))):
        try:
            yield from subject.scenario.equip(space.decode(genome))
        except InputError:
            continue  # missions reject this design as well


def find_values(part: object, name: str, at: str) -> Iterator[tuple[str, float]]:
    """Yield the dotted key and value of each number called ``name`` in a description."""
    if is_dataclass(part):
        children = {field.name: getattr(part, field.name) for field in fields(part)}
    elif isinstance(part, Mapping):
        children = dict(part)
    else:
        return
    for key, child in children.items():
        if key == name and is_number(child):
            yield f"{at}.{key}", float(child)
        else:
            yield from find_values(child, name, f"{at}.{key}")


def find_avoidance_range(controller: object) -> tuple[str, float] | None:
    """Return the key and value [m] of the longest ``range_m`` of a controller's layers."""
    ranges = find_values(controller, "range_m", "controller")
    return max(ranges, key=lambda entry: entry[1], default=None)


TRIALS = 3
MARGIN_M = 1.0  # maximum distance [m] from a waypoint to the bounding box of the obstacles
SAMPLES = 100
WALLED_SHARE = 0.9  # minimum fraction of each side covered by obstacles; doors are the rest


def check_waypoints(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each waypoint far outside the walls around home."""
    for member in experiment.members:
        for name, world in experiment.scenario.place_worlds(member).items():
            outside = list(_list_outside(world))
            if outside:
                points = ", ".join(f"({x:g}, {y:g})" for x, y in outside)
                yield (
                    f"{member.key}world.{name}.course.waypoints: {points} lie more than "
                    f"{MARGIN_M:g} m outside the walls around home; move the waypoints inside, and "
                    f"check that they are in metres"
                )


def _list_outside(world: World) -> Iterator[tuple[float, float]]:
    areas = project_bodies([body for body in world.obstacles if body.mass is None])
    if not areas:
        return
    low, high = find_bounds(*areas)
    if not _encloses(np.array([find_bounds(area) for area in areas]), low, high):
        return
    home = np.array(world.course.home[:2])
    if not ((low <= home) & (home <= high)).all():
        return
    for x, y in world.course.waypoints:
        if ((low - MARGIN_M > (x, y)) | (high + MARGIN_M < (x, y))).any():
            yield x, y


def _encloses(boxes: Array, low: Array, high: Array) -> bool:
    """Return True if boxes (n, 2, 2) [m] line all four sides of their bounding box."""
    for axis in (0, 1):
        along = np.linspace(low[1 - axis], high[1 - axis], SAMPLES)[:, None]
        covers = (boxes[:, 0, 1 - axis] <= along) & (along <= boxes[:, 1, 1 - axis])
        near_low = boxes[:, 0, axis] <= low[axis] + MARGIN_M
        near_high = boxes[:, 1, axis] >= high[axis] - MARGIN_M
        for side in (near_low, near_high):
            if covers[:, side].any(axis=1).mean() < WALLED_SHARE:
                return False
    return True


def check_meshes(subject: Subject) -> Iterator[str]:
    """Yield a warning for each mesh whose convex parts fill empty space."""
    for name, world in subject.scenario.world.items():
        for area in measure_meshes(world, subject.member.robot.height_m):
            if area.is_large:
                yield (
                    f"{world.source}: mesh {area}; type ++world.{name}.mesh_effort=10, or export "
                    f"the mesh with fewer or flatter faces"
                )


def check_view(subject: Subject) -> Iterator[str]:
    """Yield a warning for each sensor type that sees over all obstacles of level worlds."""
    worlds = list(subject.scenario.world.values())
    if any(world.sampler is not None or not world.is_level for world in worlds):
        return
    tops = [
        top_height(shape, pose)
        for world in worlds
        for body in world.obstacles
        for shape, pose in body.placed
        if shape.kind != "plane"
    ]
    if not tops:
        return
    for member in subject.scenario.equip(choose_middle(subject.space)):
        for sensor, height in _list_upward(member.robot).items():
            if height > max(tops):
                yield (
                    f"design.sensors.{sensor}: looks over all obstacles, from {height:.3g} m "
                    f"above the ground; the tallest is {max(tops):.3g} m high; lower "
                    f"robot.mount.z_m or robot.mount.pitch_deg"
                )


def _list_upward(robot: Robot) -> dict[str, float]:
    """Return the lowest height [m] that each sensor type sees; -inf if a ray points down."""
    heights: dict[str, float] = {}
    for mount, frame in zip(robot.mounts, robot.sensor_frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        if sees(sensor):
            lowest = float(product(sensor.rays(), frame[:3, :3].T)[:, 2].min())
            # rays that point up are lowest at the sensor
            height = float(frame[2, 3]) if lowest >= 0.0 else -math.inf
            heights[mount.sensor] = min(height, heights.get(mount.sensor, math.inf))
    return heights


def check_room(experiment: Experiment) -> None:
    """Check that each world has space for the maximum number of walkers."""
    scenario = experiment.scenario
    if scenario.any_walkers:
        groups = scenario.walkers.items()
        most = {name: replace(group, number=group.numbers[1]) for name, group in groups}
        full = replace(scenario, walkers=most)
        members = scenario.equip(choose_middle(experiment.space))
        for name, robots in place_robots(scenario, members).items():
            for trial in range(TRIALS):
                full.draw_world(name, f"preflight/{trial}", robots)


def place_robots(scenario: Scenario, members: Sequence[Member]) -> dict[str, list[PlacedRobot]]:
    """Return the robots at home in each world."""
    return {
        name: [PlacedRobot(member.robot, member.place(world.course).home) for member in members]
        for name, world in scenario.world.items()
    }


DRAWS = 20  # number of missions for which faults are drawn


def check_onsets(subject: Subject) -> Iterator[str]:
    """Check that each failure onset can occur in some world; warn about the other worlds."""
    for trigger in _list_triggers(subject):
        worlds = subject.scenario.world.items()
        found = {name: find_problem(trigger, world) for name, world in worlds}
        problems = {name: problem for name, problem in found.items() if problem}
        if len(problems) == len(found):
            raise InputError(f"failure.onset: must be {next(iter(problems.values()))}")
        for name, problem in problems.items():
            yield f"failure.onset: must be {problem}; otherwise, the failure never occurs in {name}"


def _list_triggers(subject: Subject) -> list[Trigger]:
    """Return the distinct triggers of faults in several missions."""
    if not subject.scenario.failure.parts:
        return []
    (member,) = subject.scenario.equip(choose_middle(subject.space))
    faults: list[Fault] = []
    for index in range(DRAWS):
        rng = generator(f"preflight/onsets/{index}", "failure")
        faults += draw_faults(subject.scenario.failure, member.robot.describe_sensors(), rng)
    return list(dict.fromkeys(fault.trigger for fault in faults))


def find_problem(trigger: Trigger, world: World) -> str:
    """Return the rule that an onset violates in a world, with the violating value; "" if none."""
    course = world.course
    lengths = measure_legs(course.home, course.route(True))
    if trigger.kind == WAYPOINT and trigger.values[0] > len(lengths):
        return (
            f"at one of the {len(lengths)} waypoints of the route (the corners and home, both "
            f"ways), not at waypoint {trigger.values[0]:g}"
        )
    total = math.fsum(lengths)
    if trigger.kind == DISTANCE and trigger.values[0] > total:
        return f"within the route, which is {total:.1f} m long, not after {trigger.values[0]:.4g} m"
    if trigger.kind == PLACE:
        x, y, radius = trigger.values
        (left, below), (right, above) = _find_extent(world)
        if not (left - radius <= x <= right + radius and below - radius <= y <= above + radius):
            return (
                f"in the world, which has x {left:.2f}..{right:.2f} and y {below:.2f}..{above:.2f} "
                f"m, not at ({x:g}, {y:g}) m"
            )
    return ""


def _find_extent(world: World) -> Array:
    """Return the lower left and upper right corners (2, 2) [m] of obstacles and course."""
    areas = project_bodies(world.obstacles)
    borders = find_bounds(*areas) if areas else ()
    points = np.array([world.course.home[:2], *world.course.waypoints, *borders])
    return np.stack([points.min(axis=0), points.max(axis=0)])
