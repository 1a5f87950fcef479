"""The subcommand ``deploy``: a champion as a ROS 2 package with a mounting drawing."""

import argparse
import math
from collections.abc import Iterator, Mapping

import numpy as np

from evoros.analysis.drawing.mounting import MountingPlan, PlacedSensor, Solid, draw_mounting
from evoros.analysis.drawing.style import render
from evoros.analysis.subcommands import Product, add_run
from evoros.analysis.tables.study import Study
from evoros.base.arrays import Array
from evoros.base.errors import InputError, write_count
from evoros.drive.rolling import shape_points
from evoros.geometry.shapes import Pose, Shape
from evoros.plugins.deploy.champion import Champion, MountedSensor, read_champion
from evoros.plugins.deploy.ros_package import PackageOptions, simplify, write_package
from evoros.storage.figure_context import Beam, Signal
from evoros.terminal.log import LOGGER

_MM = 1000.0
_SAME_MM = 0.5  # maximum distance [mm] between the centres of wheels on one axle
ONE_ROBOT = True
HELP = "the champion as a ROS 2 package, with a drawing of the mounting poses"
NEEDS = "a finished run"
FILES = ("ROBOT_champion/",)
FORMATS: Mapping[str, str] = {}
OUTPUT = "deploy"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for the run and for the metadata of the package."""
    add_run(parser)
    about = "name of the package; default: ROBOT_champion, or ROBOT_NAME_champion with --agent NAME"
    parser.add_argument("--name", metavar="PACKAGE", help=about)
    about = "maintainer of the package, NAME <ADDRESS>; default: unnamed"
    parser.add_argument("--maintainer", metavar="TEXT", help=about)
    about = "licence of the package; default: unspecified"
    parser.add_argument("--license", metavar="NAME", help=about)
    about = "position of the autopilot in the robot's frame [m]; default: the centre of mass"
    parser.add_argument("--imu", nargs=3, type=float, metavar=("X", "Y", "Z"), help=about)
    parser.set_defaults(maintainer="unnamed <unnamed@example.com>", license="unspecified")


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the package for the named run's champion (default: the best run's)."""
    _, champion = study.choose(options.run, read_champion)
    robot = simplify(f"{champion.name} {options.agent or ''}")
    name = f"{robot}_champion" if options.name is None else options.name
    chosen = PackageOptions(name, options.maintainer, options.license, _read_imu(options))
    figure = draw_mounting(plan_mounting(champion))
    drawings = {f"drawing/mounting.{kind}": render(figure, kind) for kind in ("pdf", "png")}
    files, notes = write_package(champion, chosen, drawings)
    for note in notes:
        LOGGER.warning("%s", note)
    message = f"{champion.title}, with {write_count(len(champion.sensors), 'sensor')}"
    return Product(messages=[message], files=files, folder=chosen.name)


def _read_imu(options: argparse.Namespace) -> tuple[float, float, float] | None:
    if options.imu is None:
        return None
    x, y, z = options.imu
    if not all(map(math.isfinite, options.imu)):
        raise InputError(f"--imu: must be three finite numbers, not {x} {y} {z}; give metres")
    return x, y, z


def plan_mounting(champion: Champion) -> MountingPlan:
    """Collect the content of a champion's mounting drawing."""
    sensors = tuple(map(_place, champion.sensors))
    links = {sensor.link for sensor in champion.sensors}
    wheels = {part.link for part in champion.record.context.parts if part.wheel}
    centres = np.array([champion.shown.poses[link].position for link in sorted(wheels)]) * _MM
    return MountingPlan(
        title=f"{champion.name}: mounting positions of {write_count(len(sensors), 'sensor')}",
        source=champion.title,
        datum=_describe_datum(centres),
        solids=tuple(_list_solids(champion, links, wheels)),
        sensors=sensors,
        centre_mm=None if champion.centre_m is None else np.array(champion.centre_m) * _MM,
        axles_mm=tuple(_merge(centres[:, 0].tolist())) if len(centres) else (),
    )


def _place(sensor: MountedSensor) -> PlacedSensor:
    x, y, z = (_MM * value for value in sensor.position_m)
    pose = Pose.from_rpy((x, y, z), 0.0, -np.radians(sensor.pitch_deg), np.radians(sensor.yaw_deg))
    size = tuple(_MM * value for value in sensor.size_m)
    corners = shape_points(Shape("box", size), pose) if min(size) > 0.0 else np.empty((0, 3))
    return PlacedSensor(
        name=sensor.link,
        place_mm=np.array([x, y, z]),
        yaw_deg=sensor.yaw_deg,
        pitch_deg=sensor.pitch_deg,
        fov_deg=sensor.kind.fov_deg if isinstance(sensor.kind, Beam) else None,
        reach=_describe_reach(sensor.kind),
        corners_mm=corners,
    )


def _describe_reach(kind: Beam | Signal) -> str:
    if isinstance(kind, Beam):
        return f"{kind.range_min_m:g} to {kind.range_max_m:g} m"
    return f"zone {kind.width_m:g} m wide" if kind.width_m > 0.0 else "none"


def _list_solids(champion: Champion, sensors: set[str], wheels: set[str]) -> Iterator[Solid]:
    for link, shapes in champion.shown.visuals.items():
        for shape in shapes if link not in sensors else ():
            points = shape_points(shape, champion.shown.poses[link] @ shape.pose)
            yield Solid(_MM * points, link in wheels)


def _describe_datum(wheels: Array) -> str:
    if not len(wheels):
        return "the origin of the robot's frame, which lies on the ground"
    sides = wheels[:, 1]
    middle = abs(sides.min() + sides.max()) < _SAME_MM
    across = "midway between left and right wheels" if middle else "at y = 0 in the robot's frame"
    ahead = -float(wheels[:, 0].min())
    along = f"{round(abs(ahead), 1):g} mm {'ahead of' if ahead > 0.0 else 'behind'}"
    along = "below" if abs(ahead) < _SAME_MM else along
    axle = "rear axle" if np.ptp(wheels[:, 0]) > _SAME_MM else "axle"
    return f"on the ground, {across}, {along} the {axle}"


def _merge(values: list[float]) -> Iterator[float]:
    last = -np.inf
    for value in sorted(values):
        if value - last > _SAME_MM:
            yield value
            last = value
