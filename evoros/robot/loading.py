"""Reads a robot from a URDF or xacro file."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from evoros.base.errors import InputError
from evoros.drive.protocol import Drive, DriveDescription
from evoros.formats.urdf import expansion
from evoros.formats.urdf.document import UrdfDocument
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.robot.model import Robot, VisibleShape
from evoros.robot.mounting import MountDefaults, fit_mount
from evoros.robot.outline import SolidShape, compute_outline


def load_robot(
    description: str,
    drive: DriveDescription,
    mount: MountDefaults | None = None,
    arguments: Mapping[str, Any] | None = None,
    packages: Sequence[str] = (),
    ignored_packages: Sequence[str] = (),
    environment: Mapping[str, Any] | None = None,
) -> Robot:
    """Load the robot that a xacro or URDF file describes.

    ``description`` is a path, which may be relative to the bundled robots; ``arguments`` are those
    of the xacro file; ``packages`` are further folders in which it may name files. A missing
    ``mount`` is chosen for the robot.

    Raises:
        InputError: the file cannot be used, or ``drive`` or ``mount`` do not fit it.
    """
    mount = MountDefaults() if mount is None else mount
    _check_types(description, drive, mount, arguments or {}, packages)
    file, root = expansion.read(
        description,
        expansion.ReadOptions(arguments or {}, packages, ignored_packages, environment or {}),
    )
    urdf = read_tree(root, str(file))
    fitted = drive.fit(urdf)
    solids = _find_collision_shapes(urdf, fitted)
    places = _find_sensor_links(urdf)
    default = fit_mount(mount, places, solids)
    robot = Robot(
        name=urdf.name,
        base_urdf=UrdfDocument.from_elements(root),
        drive=fitted,
        outline=compute_outline((solid.shape, solid.pose) for solid in solids),
        height_m=max(solid.height_range[1] for solid in solids),
        mount_link=default.link,
        mount_z_m=default.z_m,
        mount_pitch_deg=default.pitch_deg,
        chosen_mount=default.chosen,
        sensor_links=places,
        solids=tuple(solids),
        visuals=tuple(_visible_shapes(urdf, fitted)),
        reserved_names=frozenset(urdf.poses) | frozenset(urdf.joints),
    )
    if default.link not in places:
        raise robot.link_error(default.link)
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


def _find_collision_shapes(urdf: Urdf, drive: Drive) -> list[SolidShape]:
    """Find all shapes but those of wheels and casters, in the robot's frame."""
    rolling = _rolling_links(urdf, drive)
    solids = [
        SolidShape(link, shape, urdf.poses[link] @ shape.pose)
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
