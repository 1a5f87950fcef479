"""A champion as a ROS 2 package: description, parameters, launch file, and where to mount what."""

import argparse
import math
from collections.abc import Mapping

from evoros.base.errors import InputError
from evoros.terminal.log import LOGGER

from ..drawing.mounting import draw_mounting
from ..drawing.style import render
from ..product import Product
from ..subcommands import add_run
from ..tables.study import Study
from .champion import Champion, read_champion
from .mounting_plan import plan_mounting
from .ros_package import PackageOptions, name_package, write_package

ONE_ROBOT = True
HELP = "the champion as a ROS 2 package, with a drawing of where to mount its sensors"
NEEDS = "a finished run"
FILES = {"ROBOT_champion/": "the package, which `--name` may call otherwise"}
FORMATS: Mapping[str, str] = {}
OUTPUT = "deploy"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the run, and what the package says."""
    add_run(parser)
    about = "of the package; ROBOT_champion, ROBOT_NAME_champion with --agent NAME"
    parser.add_argument("--name", metavar="PACKAGE", help=about)
    about = "of the package, NAME <ADDRESS>; unnamed"
    parser.add_argument("--maintainer", metavar="TEXT", help=about)
    parser.add_argument("--license", metavar="NAME", help="of the package; unspecified")
    about = "place of the autopilot in the robot's frame [m]; the centre of mass"
    parser.add_argument("--imu", nargs=3, type=float, metavar=("X", "Y", "Z"), help=about)
    parser.set_defaults(maintainer="unnamed <unnamed@example.com>", license="unspecified")


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the package of the named run's champion, or of the best run's."""
    _, champion = study.choose(options.run, read_champion)
    robot = f"{champion.name} {options.agent or ''}"
    chosen = PackageOptions(
        name=name_package(robot) if options.name is None else options.name,
        maintainer=options.maintainer,
        license=options.license,
        imu_m=_read_imu(options),
    )
    files, notes = write_package(champion, chosen, _draw(champion))
    for note in notes:
        LOGGER.warning("%s", note)
    message = f"{champion.title}, with {len(champion.sensors)} sensors"
    return Product(messages=[message], files=files, folder=chosen.name)


def _read_imu(options: argparse.Namespace) -> tuple[float, float, float] | None:
    if options.imu is None:
        return None
    x, y, z = options.imu
    if not all(map(math.isfinite, options.imu)):
        raise InputError(f"--imu: must be three finite numbers, not {x} {y} {z}; give metres")
    return x, y, z


def _draw(champion: Champion) -> dict[str, bytes]:
    """Return the drawing of where to mount the sensors, in each format."""
    figure = draw_mounting(plan_mounting(champion))
    return {f"drawing/mounting.{kind}": render(figure, kind) for kind in ("pdf", "png")}
