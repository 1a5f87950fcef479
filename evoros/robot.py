"""The robot: its description, where it is wide, how it drives, and which sensors it carries."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from lxml import etree

from evoros.body import Pose, Shape
from evoros.drive.protocol import Drive, DriveDescription
from evoros.errors import NUMBER, TEXT, InputError, check, is_number
from evoros.geometry import convex_hull, footprint, highest
from evoros.types import Array, Mount, Sensor
from evoros.urdf import expansion
from evoros.urdf.tree import Urdf, read_tree

_CIRCLE = 64  # corners of the polygon that stands for a circle
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class MountDefaults:
    """Where a sensor sits as long as nothing else is said."""

    link: str
    z_m: float  # in the frame of ``link``
    pitch_deg: float  # nose up positive

    def __post_init__(self) -> None:
        check(self, link=TEXT, z_m=NUMBER, pitch_deg=NUMBER)


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot, with or without sensors. Its frame is that of the root link: on the ground at
    rest, x forward, y left.
    """

    name: str
    base_urdf: str  # without sensors
    drive: Drive
    outline: Array  # (k, 2) [m] convex, counter-clockwise: footprint of what can touch obstacles
    height_m: float  # top of what can touch obstacles, above the ground
    mount_link: str
    mount_z_m: float
    mount_pitch_deg: float
    places: Mapping[str, tuple[float, float, float, float]]
    """Links that can carry sensors: x, y, z [m], yaw [rad] in the robot's frame."""
    taken: frozenset[str] = frozenset()  # names of links and joints
    mounts: tuple[Mount, ...] = ()  # those of one sensor type are contiguous
    sensors: Mapping[str, Sensor] = field(default_factory=dict)

    @property
    def urdf(self) -> str:
        """The whole description: with a link, a joint and a Gazebo sensor for every mount."""
        head, _, _ = self.base_urdf.rpartition("</robot>")
        parts = [
            _sensor_xml(f"{mount.sensor}_{i}", mount, self.sensors[mount.sensor])
            for i, mount in enumerate(self.mounts)
        ]
        return "".join((head, *parts, "</robot>\n"))

    def equipped(self, mounts: Sequence[Mount], sensors: Mapping[str, Sensor]) -> "Robot":
        """This robot with these sensors instead of its own, ordered by the types in ``sensors``.

        Raises:
            InputError: an unknown sensor type or link, a number that is not finite, or a name
                that the robot already has.
        """
        order = {name: place for place, name in enumerate(sensors)}
        for mount in mounts:
            self._check(mount, order)
        ordered = tuple(sorted(mounts, key=lambda mount: order[mount.sensor]))
        for i, mount in enumerate(ordered):
            if f"{mount.sensor}_{i}" in self.taken:
                raise InputError(
                    f"robot {self.name}: link {mount.sensor}_{i} must not exist before the sensor "
                    f"is added; rename the sensor type"
                )
        return replace(self, mounts=ordered, sensors=dict(sensors))

    def sensor_poses(self) -> Array:
        """(n, 5): x, y, z [m], yaw (left positive), pitch (nose up positive) [rad]."""
        poses = np.empty((len(self.mounts), 5))
        for i, mount in enumerate(self.mounts):
            x, y, z, yaw = self.places[mount.link]
            cos, sin = math.cos(yaw), math.sin(yaw)
            poses[i] = (
                x + cos * mount.x_m - sin * mount.y_m,
                y + sin * mount.x_m + cos * mount.y_m,
                z + mount.z_m,
                yaw + math.radians(mount.yaw_deg),
                math.radians(mount.pitch_deg),
            )
        return poses

    def sensor_frames(self) -> Array:
        """(n, 4, 4): the frame of each sensor, x along its beam, in the robot's frame [m]."""
        frames = np.empty((len(self.mounts), 4, 4))
        for i, (x, y, z, yaw, pitch) in enumerate(self.sensor_poses().tolist()):
            cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
            frames[i] = (
                (cy * cp, -sy, -cy * sp, x),
                (sy * cp, cy, -sy * sp, y),
                (sp, 0.0, cp, z),
                (0.0, 0.0, 0.0, 1.0),
            )
        return frames

    def _check(self, mount: Mount, known: Mapping[str, int]) -> None:
        if mount.sensor not in known:
            raise InputError(
                f"mount on {mount.link}: sensor must be one of {', '.join(known) or 'none'}, "
                f"not {mount.sensor!r}; define that sensor type or rename it"
            )
        if not _NAME.fullmatch(mount.sensor):
            raise InputError(
                f"sensor {mount.sensor!r}: names must consist of letters, digits and _; rename it"
            )
        if mount.link not in self.places:
            raise self._no_place(mount.link)
        for entry in fields(mount):
            value = getattr(mount, entry.name)
            if entry.name not in ("sensor", "link") and not is_number(value):
                raise InputError(
                    f"mount of {mount.sensor}: {entry.name} must be a number, not {value!r}; set it"
                )

    def _no_place(self, link: str) -> InputError:
        return InputError(
            f"robot {self.name}: mount link must be fixed to the root link and upright, "
            f"not {link!r}; name one of {', '.join(self.places)}"
        )


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
        base_urdf=etree.tostring(root, encoding="unicode", pretty_print=True),
        drive=fitted,
        outline=_outline(touching),
        height_m=max(highest(shape, pose) for shape, pose in touching),
        mount_link=mount.link,
        mount_z_m=float(mount.z_m),
        mount_pitch_deg=float(mount.pitch_deg),
        places=_places(urdf),
        taken=frozenset(urdf.poses) | frozenset(urdf.joints),
    )
    if mount.link not in robot.places:
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


def _touching(urdf: Urdf, drive: Drive) -> list[tuple[Shape, Pose]]:
    """The shapes that can touch obstacles, all but those on the ground, in the robot's frame."""
    wheels = {urdf.joints[name].child for name in drive.wheel_joints} | set(drive.caster_links)
    touching = [
        (shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in wheels
        for shape in shapes
    ]
    if not touching:
        raise urdf.fault("a link beside the wheels must have a <collision>", "give it a box")
    return touching


def _places(urdf: Urdf) -> dict[str, tuple[float, float, float, float]]:
    """The links that keep their place on the robot and stand upright."""
    places = {}
    for link, pose in urdf.poses.items():
        fixed = all(joint.type == "fixed" for joint in urdf.above(link))
        if fixed and pose.rotation[2, 2] > 1.0 - 1e-9:
            places[link] = (*pose.position, pose.yaw)
    return places


def _outline(shapes: Sequence[tuple[Shape, Pose]]) -> Array:
    """(k, 2) the hull of the footprints of shapes, discs as polygons around them."""
    turn = np.arange(_CIRCLE) * (2.0 * math.pi / _CIRCLE)
    disc = np.stack([np.cos(turn), np.sin(turn)], axis=1) / math.cos(math.pi / _CIRCLE)
    corners = []
    for shape, pose in shapes:
        area = footprint(shape, pose)
        reach = area.radius * disc if area.radius > 0 else np.zeros((1, 2))
        corners.append((area.vertices[:, None] + reach[None]).reshape(-1, 2))
    return convex_hull(np.concatenate(corners))


def _sensor_xml(name: str, mount: Mount, sensor: Sensor) -> str:
    # A positive rotation about y lowers the nose.
    xyz = f"{float(mount.x_m)!r} {float(mount.y_m)!r} {float(mount.z_m)!r}"
    rpy = f"0 {-math.radians(mount.pitch_deg)!r} {math.radians(mount.yaw_deg)!r}"
    return (
        f'  <link name="{name}">{_sensor_body(sensor)}</link>\n'
        f'  <joint name="{name}_joint" type="fixed">'
        f"<parent link={quoteattr(mount.link)}/>"
        f'<child link="{name}"/><origin xyz="{xyz}" rpy="{rpy}"/></joint>\n'
        f'  <gazebo reference="{name}">{sensor.gazebo(name)}</gazebo>\n'
    )


def _sensor_body(sensor: Sensor) -> str:
    """A homogeneous box to see and to weigh, without a collision shape."""
    mass, (x, y, z) = float(sensor.mass_kg), map(float, sensor.size_m)
    moments = (y * y + z * z, x * x + z * z, x * x + y * y)
    xx, yy, zz = (mass * moment / 12.0 for moment in moments)
    return (
        f'<inertial><mass value="{mass}"/><origin xyz="0 0 0" rpy="0 0 0"/>'
        f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial>'
        f'<visual><origin xyz="0 0 0" rpy="0 0 0"/><geometry><box size="{x} {y} {z}"/></geometry>'
        f'<material name="sensor"><color rgba="0.1 0.3 0.8 1"/></material></visual>'
    )
