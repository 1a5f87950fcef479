"""Compares a robot description as read by evoros with yourdfpy's independent reading.

yourdfpy is not the main reader: importing it takes up to two seconds, so its results are cached in
the user's cache; its sine and cosine depend on the platform, so missions would differ between
processors; and it drops line numbers, ``<gazebo>``, ``<transmission>`` and ``<ros2_control>``.
"""

import hashlib
import io
import json
import logging
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
from lxml import etree

from evoros.base.errors import single_line
from evoros.files.disk import write_atomically
from evoros.files.private import private_folder
from evoros.formats.urdf.tree import read_tree
from evoros.robot.model import Robot

_LOG = logging.getLogger(__name__)

TOLERANCE_M = 1e-6


class SecondReading(NamedTuple):
    """The positions [m] of all links in the root frame, and the robot's mass [kg]."""

    root: str
    positions: Mapping[str, tuple[float, float, float]]
    mass_kg: float


def report_second_reading(robots: Iterable[Robot]) -> None:
    """Compare each robot with yourdfpy; warn about differences, and log other results."""
    for robot in {robot.base_urdf.text: robot for robot in robots}.values():
        agrees, result = read_again(robot)
        _LOG.log(logging.DEBUG if agrees else logging.WARNING, "%s: %s", robot.name, result)


def read_again(robot: Robot) -> tuple[bool, str]:
    """Return False if yourdfpy reads other positions, else True; and describe the result."""
    try:
        read = _load(robot)
    except Exception as error:  # another package's reader may raise any error
        return True, f"yourdfpy cannot read the file ({type(error).__name__}: {single_line(error)})"
    poses = read_tree(robot.urdf_elements(), robot.name).poses
    base = poses[read.root].inverse()
    gaps = {
        name: float(np.linalg.norm(np.subtract(position, (base @ poses[name]).position)))
        for name, position in read.positions.items()
    }
    farthest = max(gaps, key=lambda name: gaps[name])
    if gaps[farthest] > TOLERANCE_M:
        distance = f"{1e3 * gaps[farthest]:.3g} mm"
        return False, f"yourdfpy disagrees on the position of {farthest} by {distance}"
    links = f"the positions of all {len(gaps)} links"
    return True, f"yourdfpy agrees on {links}, and reads {read.mass_kg:.3g} kg"


def _load(robot: Robot) -> SecondReading:
    """Return yourdfpy's reading, cached by its version and the text."""
    elements = robot.base_urdf.copy_elements()
    etree.strip_elements(elements, "visual", "collision", "mimic")
    text, folder = etree.tostring(elements), private_folder("second_readings")
    digest = hashlib.sha256(f"{version('yourdfpy')} ".encode() + text).hexdigest()
    file = None if folder is None else folder / f"{digest}.json"
    with suppress(OSError, ValueError, TypeError):  # absent or damaged
        return SecondReading(**json.loads(file.read_bytes() if file else ""))
    import yourdfpy  # takes up to two seconds

    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    urdf = yourdfpy.URDF.load(io.BytesIO(text), load_meshes=False)
    positions = {name: tuple(urdf.get_transform(name)[:3, 3].tolist()) for name in urdf.link_map}
    inertials = (link.inertial for link in urdf.robot.links)
    mass = sum(inertial.mass or 0.0 for inertial in inertials if inertial is not None)
    read = SecondReading(urdf.base_link, positions, float(mass))
    if file is not None:
        with suppress(OSError):
            write_atomically(file, json.dumps(read._asdict()))
    return read
