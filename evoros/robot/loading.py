"""Reads a robot from a URDF or xacro file."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import NUMBER, TEXT, checked
from evoros.base.errors import InputError
from evoros.drive.protocol import Drive, DriveDescription
from evoros.formats.urdf import expansion
from evoros.formats.urdf.document import UrdfDocument
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.footprint import convex_hull, project_shape, top_height
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot, VisibleShape

_CIRCLE_CORNERS = 64  # of the polygon around a circle


@dataclass(frozen=True)
@checked
class MountDefaults:
    """The default mount of a sensor, for values that its region leaves open."""

    link: Annotated[str, TEXT]
    z_m: Annotated[float, NUMBER]  # in the frame of ``link``
    pitch_deg: Annotated[float, NUMBER]  # nose up positive


def load_robot(
    description: str,
    drive: DriveDescription,
    mount: MountDefaults,
    arguments: Mapping[str, Any] | None = None,
    packages: Sequence[str] = (),
    ignored_packages: Sequence[str] = (),
    environment: Mapping[str, Any] | None = None,
) -> Robot:
    """Load the robot that a xacro or URDF file describes.

    ``description`` is a path, which may be relative to the bundled robots; ``arguments`` are those
    of the xacro file; ``packages`` are further folders in which it may name files.

    Raises:
        InputError: the file cannot be used, or ``drive`` or ``mount`` do not fit it.
    """
    _check_types(description, drive, mount, arguments or {}, packages)
    file, root = expansion.read(
        description,
        expansion.ReadOptions(arguments or {}, packages, ignored_packages, environment or {}),
    )
    urdf = read_tree(root, str(file))
    fitted = drive.fit(urdf)
    solids = _find_collision_shapes(urdf, fitted)
    robot = Robot(
        name=urdf.name,
        base_urdf=UrdfDocument.from_elements(root),
        drive=fitted,
        outline=_compute_outline(solids),
        height_m=max(top_height(shape, pose) for shape, pose in solids),
        mount_link=mount.link,
        mount_z_m=float(mount.z_m),
        mount_pitch_deg=float(mount.pitch_deg),
        sensor_links=_find_sensor_links(urdf),
        visuals=tuple(_visible_shapes(urdf, fitted)),
        reserved_names=frozenset(urdf.poses) | frozenset(urdf.joints),
    )
    if mount.link not in robot.sensor_links:
        raise robot.link_error(mount.link)
    return robot


def _check_types(
    description: object, drive: object, mount: object, arguments: object, packages: object
) -> None:
    for name, value, expected, what in (
        ("description", description, str, "the path of a file"),
        ("drive", drive, DriveDescription, "the description of a drive"),
        ("mount", mount, MountDefaults, "a default mount (MountDefaults)"),
        ("arguments", arguments, Mapping, "a mapping from names to values"),
        ("packages", packages, list | tuple, "a list of folders"),
    ):
        if not isinstance(value, expected):
            raise InputError(f"robot.{name}: must be {what}, not {value!r}; give one")


def _rolling_links(urdf: Urdf, drive: Drive) -> set[str]:
    return {urdf.joints[name].child for name in drive.wheel_joints} | set(drive.caster_links)


def _visible_shapes(urdf: Urdf, drive: Drive) -> Iterator[VisibleShape]:
    rolling = _rolling_links(urdf, drive)
    for link, shapes in urdf.visuals.items():
        for shape in shapes:
            yield VisibleShape(link, shape, urdf.poses[link] @ shape.pose, link in rolling)


def _find_collision_shapes(urdf: Urdf, drive: Drive) -> list[tuple[Shape, Pose]]:
    """Find all shapes but those of wheels and casters, in the robot's frame."""
    rolling = _rolling_links(urdf, drive)
    solids = [
        (shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling
        for shape in shapes
    ]
    if not solids:
        problem = "a link other than the wheels and casters must have a <collision>"
        raise urdf.error(problem, "give it a box")
    return solids


def _find_sensor_links(urdf: Urdf) -> dict[str, tuple[float, float, float, float]]:
    """Find the upright links that are fixed to the root: x, y, z [m] and yaw [rad] of each."""
    sensor_links = {}
    for link, pose in urdf.poses.items():
        fixed = all(joint.type == "fixed" for joint in urdf.joints_above(link))
        if fixed and pose.rotation[2, 2] > 1.0 - 1e-9:
            sensor_links[link] = (*pose.position, pose.yaw)
    return sensor_links


def _compute_outline(solids: Sequence[tuple[Shape, Pose]]) -> Array:
    """Return the hull (k, 2) [m] of the footprints of shapes, with polygons around circles."""
    turn = np.arange(_CIRCLE_CORNERS) * (2.0 * math.pi / _CIRCLE_CORNERS)
    disc = np.stack([np.cos(turn), np.sin(turn)], axis=1) / math.cos(math.pi / _CIRCLE_CORNERS)
    corners = []
    for shape, pose in solids:
        footprint = project_shape(shape, pose)
        reach = footprint.radius * disc if footprint.radius > 0 else np.zeros((1, 2))
        corners.append((footprint.vertices[:, None] + reach[None]).reshape(-1, 2))
    return convex_hull(np.concatenate(corners))
