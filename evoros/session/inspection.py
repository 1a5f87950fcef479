"""Describes the user's robots and worlds, including what the readers assumed or left out."""

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.config.own_designs import plan_design
from evoros.config.own_files import OwnFile
from evoros.evolution.experiment import Experiment
from evoros.formats.urdf.tree import read_tree
from evoros.preflight.routes import MAX_RATIO, check_routes, find_range_fault
from evoros.preflight.scene import list_subjects
from evoros.robot.model import Robot
from evoros.robot.own_sensors import find_own_sensors
from evoros.robot.second_reading import read_again
from evoros.terminal.log import withhold_messages
from evoros.world.crowds import find_blocking
from evoros.world.lifting import Solids
from evoros.world.mesh_areas import measure_meshes
from evoros.world.model import World
from evoros.world.standing import list_areas

SAMPLES = 60  # number of random designs drawn in the picture of a robot
LEVEL, UNEVEN = "simulator=planar", "simulator=physics"  # simulators for level and uneven ground
INDOOR = "controller=indoor"  # controller for worlds that are too narrow for the default controller
NEAR_RATIO = 1.0  # avoidance range / free space, above which most positions are too near obstacles
ANOTHER = (
    "for another, add world.NAME.course.home_x_m=X world.NAME.course.home_y_m=Y to this command"
)

Row = tuple[str, str]
Places = Mapping[str, Array]  # sensor poses by region, (n, 5): x, y, z [m], yaw, pitch [rad]


@dataclass(frozen=True)
class Inspection:
    """A description of a robot or world: a table, the file reader's messages and a picture."""

    title: str
    rows: Sequence[Row]
    messages: Sequence[str]  # assumptions, changes and omissions of the file readers
    picture: bytes  # PNG
    choices: Sequence[str] = ()  # further overrides required by the robot or world
    design: OwnFile | None = None  # a design with the sensors that the robot already has


def inspect_robot(
    name: str, folder: Path, simulator: str, draw: Callable[[Robot, Places], bytes]
) -> Inspection:
    """Describe the robot ``name`` in ``folder``, and plan a design with the robot's sensors."""
    experiment, messages = _build([f"robot={name}", "design=around", simulator], folder)
    robot, places = experiment.robot, _sample_places(experiment)
    own_sensors = find_own_sensors(robot)
    first_line = f"The sensors of {name}, read from its description by evoros inspect."
    design, notes = plan_design(
        f"{name}_sensors", first_line, own_sensors.sensors, robot.reserved_names
    )
    rows = _describe_robot(robot, places)
    described = [
        f"{sensor.described.kind} {sensor.described.name} on {sensor.link}"
        for sensor in own_sensors.sensors
    ]
    if described:
        rows.append(("has", "; ".join(described)))
    messages = [*messages, *own_sensors.notes, *notes]
    chosen = [f"design={design.name if design is not None else 'around'}", simulator]
    return Inspection(f"robot {name}", rows, messages, draw(robot, places), chosen, design)


def inspect_world(
    name: str,
    folder: Path,
    robot: Sequence[str],
    simulator: str,
    reason: str,
    draw: Callable[[Mapping[str, World]], bytes],
) -> Inspection:
    """Describe the world ``name``, and choose a controller that suits it."""
    words = [f"world={name}", *robot, simulator]
    experiment, messages = _build(words, folder)
    choices = _choose_controller(experiment, words, folder)
    if choices:
        config = compose([*words, *choices], config_dir=folder)
        experiment = config.rebuild(experiment, ["controller"])
    messages += check_routes(list_subjects(experiment)[0])
    rows = [row for world in experiment.world.values() for row in _describe_world(world)]
    height = experiment.robot.height_m
    areas = [area for world in experiment.world.values() for area in measure_meshes(world, height)]
    if areas:
        rows.append(("meshes", "; ".join(map(str, areas))))
    if reason:
        rows.append(("course", f"suggested {reason}; {ANOTHER}"))
    for world in experiment.world.values():
        messages += _check_meetings(world, experiment.robot)
    return Inspection(
        f"world {name}", rows, messages, draw(experiment.world), [simulator, *choices]
    )


def _check_meetings(world: World, robot: Robot) -> Iterator[str]:
    if not list_areas(world, robot.height_m) and not world.actors:
        yield (
            f"{world.source}: no obstacle that {robot.name}, {robot.height_m:.3g} m high, can "
            f"touch; give the folders of missing models with world.NAME.model_paths=[FOLDER], or "
            f"choose another world"
        )
    radius = float(np.abs(robot.outline[:, 1]).max())
    for start, end in pairwise(world.course.first_phase.tolist()):
        blocked = find_blocking(world, [(start, end)], radius, robot.height_m)
        if blocked is not None:
            yield (
                f"{world.source}: the leg from ({start[0]:g}, {start[1]:g}) to ({end[0]:g}, "
                f"{end[1]:g}) leads through {blocked[0]!r}, which the robot must drive around; to "
                f"avoid this, move the waypoint with world.NAME.course.waypoints=[[X, Y], ...]"
            )


def _choose_controller(experiment: Experiment, words: Sequence[str], folder: Path) -> Sequence[str]:
    if not _find_ranges(experiment, NEAR_RATIO):
        return []
    config = compose([*words, INDOOR], config_dir=folder)
    faults = _find_ranges(config.rebuild(experiment, ["controller"]), MAX_RATIO)
    return [INDOOR, *(f"{key}={value:.2g}" for key, value in faults.items())]


def _find_ranges(experiment: Experiment, max_ratio: float) -> dict[str, float]:
    robot, controller = experiment.robot, experiment.controller
    worlds = experiment.world.values()
    faults = [find_range_fault(world, robot, controller, max_ratio) for world in worlds]
    return {fault.key: fault.better_m for fault in faults if fault is not None}


def find_robot(overrides: Sequence[str], folder: Path) -> Robot:
    """Build the robot that ``overrides`` select."""
    return _build([*overrides, LEVEL], folder if overrides else None)[0].robot


def require_design(name: str, folder: Path, overrides: Sequence[str]) -> None:
    """Check that the design ``name`` fits the robot that ``overrides`` select."""
    _build([*overrides, f"design={name}", LEVEL], folder)


def _build(overrides: Sequence[str], folder: Path | None) -> tuple[Experiment, list[str]]:
    with withhold_messages() as records:
        experiment = compose(overrides, config_dir=folder).build()
    told = [record.getMessage() for record in records if record.levelno >= logging.INFO]
    return experiment, list(dict.fromkeys(told))


def _sample_places(experiment: Experiment) -> dict[str, Array]:
    space, rng = experiment.members[0].space, generator("inspection", "designs")
    places: dict[str, list[Array]] = {}
    for _ in range(SAMPLES):
        genome = rng.random(space.size)
        row, types = space.to_row(genome), experiment.design.placed_types
        mounts = [mount for mount in space.decode(genome).mounts if mount.sensor in types]
        regions = [str(row[key]) for key in row if key.endswith("_region") and row[key]]
        poses = experiment.robot.with_sensors(mounts, experiment.design.sensors).sensor_poses
        twins = max(1, len(poses) // max(1, len(regions)))
        for index, pose in enumerate(poses):
            region = regions[index // twins] if regions else next(iter(space.regions))
            places.setdefault(region, []).append(pose)
    return {region: np.array(poses) for region, poses in sorted(places.items())}


def _describe_robot(robot: Robot, places: Places) -> list[Row]:
    elements = robot.urdf_elements()
    tree = read_tree(elements, robot.name)
    links = f"{len(robot.sensor_links)} of {len(tree.poses)} can carry sensors"
    length, width = np.ptp(robot.outline, axis=0)
    mass = sum(float(mass.get("value", "0")) for mass in elements.iterfind("link/inertial/mass"))
    return [
        ("links", f"{len(tree.poses)}; {links}"),
        ("joints", _count(joint.type for joint in tree.joints.values())),
        ("drive", _describe_drive(robot)),
        ("outline", f"{length:.3f} m long, {width:.3f} m wide, {robot.height_m:.3f} m high"),
        ("mass", f"{mass:.3g} kg"),
        ("check", read_again(robot)[1]),
        ("sensors", f"on {robot.mount_link}, {robot.mount_z_m:.3f} m above its origin"),
        ("regions", _describe_places(places)),
    ]


def _describe_drive(robot: Robot) -> str:
    drive = robot.drive
    parts = [
        type(drive).__name__,
        f"wheels {', '.join(drive.wheel_joints)}",
        *([f"steering {', '.join(drive.steering_joints)}"] if drive.steering_joints else []),
        *([f"casters {', '.join(drive.caster_links)}"] if drive.caster_links else []),
        f"at most {drive.max_speed_mps:.3g} m/s",
    ]
    return "; ".join(parts)


def _describe_places(places: Places) -> str:
    ranges = []
    for region, poses in places.items():
        (x0, y0, z0), (x1, y1, z1) = poses[:, :3].min(axis=0), poses[:, :3].max(axis=0)
        ranges.append(
            f"{region} (x {x0:.2f}..{x1:.2f}, y {y0:.2f}..{y1:.2f}, z {z0:.2f}..{z1:.2f} m)"
        )
    return "; ".join(ranges) or "none"


def _describe_world(world: World) -> list[Row]:
    movable = sum(body.mass is not None for body in world.obstacles)
    floors = [body for body in world.bodies if body.is_ground]
    course = world.course
    home_x, home_y, _, yaw = course.home
    corners = ", ".join(f"({x:g}, {y:g})" for x, y in course.waypoints)
    length = float(np.linalg.norm(np.diff(course.route(True), axis=0), axis=1).sum())
    route = "one way" if course.is_one_way else "in both phases"
    return [
        ("obstacles", f"{len(world.obstacles) - movable} fixed, {movable} movable"),
        ("shapes", _count(shape.kind for body in world.obstacles for shape in body.shapes)),
        ("ground", ", ".join(body.name for body in floors)),
        ("extent", _describe_extent(world)),
        ("gravity", f"{world.gravity_mps2:g} m/s2"),
        ("home", f"({home_x:g}, {home_y:g}) m, yaw {yaw:g} rad"),
        ("waypoints", f"{corners} m; {length:.0f} m {route}"),
        ("time limit", f"{course.time_limit_s:g} s"),
    ]


def _describe_extent(world: World) -> str:
    solids = Solids.of(world.obstacles)
    if not solids.placed:
        return "no obstacles"
    (x0, y0, z0), (x1, y1, z1) = solids.low.min(axis=0), solids.high.max(axis=0)
    return f"x {x0:.1f}..{x1:.1f}, y {y0:.1f}..{y1:.1f}, z {z0:.2f}..{z1:.2f} m"


def _count(kinds: Iterable[str]) -> str:
    counts = Counter(kinds).most_common()
    return ", ".join(f"{count} {kind}" for kind, count in counts) or "none"
