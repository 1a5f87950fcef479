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

_CIRCLE = 64  # corners of the polygon that stands for a circle


@dataclass(frozen=True)
@checked
class MountDefaults:
    """Where a sensor sits as long as nothing else is said."""

    link: Annotated[str, TEXT]
    z_m: Annotated[float, NUMBER]  # in the frame of ``link``
    pitch_deg: Annotated[float, NUMBER]  # nose up positive


def load_robot(
    description: str,
    drive: DriveDescription,
    mount: MountDefaults,
    arguments: Mapping[str, Any] | None = None,
    packages: Sequence[str] = (),
) -> Robot:
    """The robot that a xacro or URDF file describes.

    ``description`` is a path, or relative to the bundled robots; ``arguments`` are those of the
    xacro file; ``packages`` are folders where it may find others' files.

    Raises:
        InputError: the file cannot be used, or ``drive`` or ``mount`` name what it has not.
    """
    _check_kinds(description, drive, mount, arguments or {}, packages)
    file, root = expansion.read(description, arguments or {}, packages)
    urdf = read_tree(root, str(file))
    fitted = drive.fit(urdf)
    touching = _touching(urdf, fitted)
    robot = Robot(
        name=urdf.name,
        base_urdf=UrdfDocument.from_elements(root),
        drive=fitted,
        outline=_outline(touching),
        height_m=max(top_height(shape, pose) for shape, pose in touching),
        mount_link=mount.link,
        mount_z_m=float(mount.z_m),
        mount_pitch_deg=float(mount.pitch_deg),
        sensor_links=_places(urdf),
        visuals=tuple(_visible_shapes(urdf, fitted)),
        taken=frozenset(urdf.poses) | frozenset(urdf.joints),
    )
    if mount.link not in robot.sensor_links:
        raise robot._no_place(mount.link)
    return robot


def _check_kinds(
    description: object, drive: object, mount: object, arguments: object, packages: object
) -> None:
    for name, given, kind, what in (
        ("description", description, str, "the path of a file"),
        ("drive", drive, DriveDescription, "the description of a drive"),
        ("mount", mount, MountDefaults, "a MountDefaults"),
        ("arguments", arguments, Mapping, "a mapping from names to values"),
        ("packages", packages, list | tuple, "a list of folders"),
    ):
        if not isinstance(given, kind):
            raise InputError(f"robot.{name}: must be {what}, not {given!r}; give one")


def _rolling_links(urdf: Urdf, drive: Drive) -> set[str]:
    return {urdf.joints[name].child for name in drive.wheel_joints} | set(drive.caster_links)


def _visible_shapes(urdf: Urdf, drive: Drive) -> Iterator[VisibleShape]:
    rolling = _rolling_links(urdf, drive)
    for link, shapes in urdf.visuals.items():
        for shape in shapes:
            yield VisibleShape(link, shape, urdf.poses[link] @ shape.pose, link in rolling)


def _touching(urdf: Urdf, drive: Drive) -> list[tuple[Shape, Pose]]:
    """The shapes that can touch obstacles, all but those on the ground, in the robot's frame."""
    rolling = _rolling_links(urdf, drive)
    touching = [
        (shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling
        for shape in shapes
    ]
    if not touching:
        raise urdf.error("a link beside the wheels must have a <collision>", "give it a box")
    return touching


def _places(urdf: Urdf) -> dict[str, tuple[float, float, float, float]]:
    """The links that keep their place on the robot and stand upright."""
    sensor_links = {}
    for link, pose in urdf.poses.items():
        fixed = all(joint.type == "fixed" for joint in urdf.joints_above(link))
        if fixed and pose.rotation[2, 2] > 1.0 - 1e-9:
            sensor_links[link] = (*pose.position, pose.yaw)
    return sensor_links


def _outline(shapes: Sequence[tuple[Shape, Pose]]) -> Array:
    """(k, 2) the hull of the footprints of shapes, discs as polygons around them."""
    turn = np.arange(_CIRCLE) * (2.0 * math.pi / _CIRCLE)
    disc = np.stack([np.cos(turn), np.sin(turn)], axis=1) / math.cos(math.pi / _CIRCLE)
    corners = []
    for shape, pose in shapes:
        area = project_shape(shape, pose)
        reach = area.radius * disc if area.radius > 0 else np.zeros((1, 2))
        corners.append((area.vertices[:, None] + reach[None]).reshape(-1, 2))
    return convex_hull(np.concatenate(corners))
