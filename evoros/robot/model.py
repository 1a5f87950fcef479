"""The robot model: outline, drive, sensors, and conversion to URDF."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from lxml import etree
from lxml.etree import SubElement
from lxml.etree import _Element as Element
from numpy.typing import NDArray

from evoros.base.arrays import Array, product
from evoros.base.checks import is_number
from evoros.base.errors import InputError
from evoros.compilation.elementary_arrays import atan2_all
from evoros.drive.protocol import Drive
from evoros.filter.protocol import Channels
from evoros.formats.strict_xml import list_names
from evoros.formats.urdf.tree import UrdfDocument
from evoros.robot.mounting import level_pitch, make_frames, place_on_links
from evoros.robot.outline import Occluders, SolidShape
from evoros.sensor.protocol import SIGNAL_SIZES, Mount, RangeSensor, Sensor, choose_prefix, sees


def sensor_elements(name: str, mount: Mount, sensor: Sensor) -> tuple[Element, Element]:
    """Create the link of a sensor, called ``name``, and the joint that mounts it on the robot."""
    link = etree.Element("link", name=name)
    _add_body(link, sensor)
    joint = etree.Element("joint", name=f"{name}_joint", type="fixed")
    SubElement(joint, "parent", link=mount.link)
    SubElement(joint, "child", link=name)
    # A positive rotation about y lowers the nose in URDF.
    xyz = f"{float(mount.x_m)!r} {float(mount.y_m)!r} {float(mount.z_m)!r}"
    rpy = f"0 {-math.radians(mount.pitch_deg)!r} {math.radians(mount.yaw_deg)!r}"
    SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    return link, joint


def _add_body(link: Element, sensor: Sensor) -> None:
    mass, (x, y, z) = float(sensor.mass_kg), map(float, sensor.size_m)
    moments = (y * y + z * z, x * x + z * z, x * x + y * y)
    xx, yy, zz = (f"{mass * moment / 12.0}" for moment in moments)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "mass", value=f"{mass}")
    SubElement(inertial, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(inertial, "inertia", ixx=xx, ixy="0", ixz="0", iyy=yy, iyz="0", izz=zz)
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(SubElement(visual, "geometry"), "box", size=f"{x} {y} {z}")
    SubElement(SubElement(visual, "material", name="sensor"), "color", rgba="0.1 0.3 0.8 1")


_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot, with or without sensors; its frame is the root link, x forward and y left."""

    name: str
    base_urdf: UrdfDocument  # content of the robot file, without sensors
    drive: Drive
    outline: Array  # (k, 2) [m], convex hull of the collision shapes in top view, counter-clockwise
    height_m: float  # top of the collision shapes above the ground
    mount_link: str
    mount_z_m: float
    mount_pitch_deg: float | None  # None: pitch at which the lowest ray of the sensors is level
    sensor_links: Mapping[str, tuple[float, float, float, float]]
    """Poses of the links that can carry sensors, in the robot's frame: x, y, z [m], yaw [rad]."""
    visuals: tuple[SolidShape, ...] = ()  # visual shapes of the links, without sensors
    solids: tuple[SolidShape, ...] = ()  # collision shapes of links that do not roll
    chosen_mount: tuple[str, ...] = ()  # keys of the default mount whose values evoros chose
    reserved_names: frozenset[str] = frozenset()  # names of all links and joints
    exposed_links: frozenset[str] = frozenset()  # wheels and casters that can touch obstacles
    engine_urdf: UrdfDocument | None = None
    """The description for engines, if it differs from ``base_urdf``.

    Joints outside the drive are fixed, wheels are cylinders, meshes are divided into convex parts,
    moving links have masses, and the root is on the ground.
    """
    occluders: Occluders = field(default_factory=Occluders)  # shapes that block the sensors' view
    mounts: tuple[Mount, ...] = ()  # sorted by sensor type
    sensors: Mapping[str, Sensor] = field(default_factory=dict)

    @property
    def urdf(self) -> str:
        """The complete URDF as XML, with a link, a joint and a Gazebo sensor for each mount."""
        head, _, _ = self.base_urdf.text.rpartition("</robot>")
        parts = [head]
        for name, mount in self.named_mounts():
            sensor = self.sensors[mount.sensor]
            elements = sensor_elements(name, mount, sensor)
            parts += [f"  {etree.tostring(e, encoding='unicode')}\n" for e in elements]
            parts.append(f'  <gazebo reference="{name}">{sensor.gazebo(name)}</gazebo>\n')
        return "".join((*parts, "</robot>\n"))

    @property
    def engine_text(self) -> str:
        """The XML for engines, without sensors."""
        return (self.engine_urdf or self.base_urdf).text

    @property
    def loaded_urdf(self) -> str:
        """``urdf_elements`` as XML."""
        return etree.tostring(self.urdf_elements(), encoding="unicode") + "\n"

    def urdf_elements(self) -> Element:
        """Create the elements for engines, with a link and a joint for each mount."""
        root = (self.engine_urdf or self.base_urdf).copy_elements()
        for name, mount in self.named_mounts():
            root.extend(sensor_elements(name, mount, self.sensors[mount.sensor]))
        return root

    def named_mounts(self) -> Iterator[tuple[str, Mount]]:
        """Yield (name of the sensor link, mount) for each mount."""
        prefix = choose_prefix(self.reserved_names, self.sensors)
        for index, mount in enumerate(self.mounts):
            yield f"{prefix}{mount.sensor}_{index}", mount

    def with_sensors(self, mounts: Sequence[Mount], sensors: Mapping[str, Sensor]) -> "Robot":
        """Return a copy with these sensors only, sorted by type in the order of ``sensors``."""
        order = {name: position for position, name in enumerate(sensors)}
        for mount in mounts:
            self._check_mount(mount, order)
        ordered = tuple(sorted(mounts, key=lambda mount: order[mount.sensor]))
        return replace(self, mounts=ordered, sensors=dict(sensors))

    @cached_property
    def layout(self) -> tuple[slice, ...]:
        """The slice of the readings (one value per channel) that belongs to each mount."""
        return _place([len(sensor.channels) for sensor in self.mounted_sensors()])

    @cached_property
    def beam_layout(self) -> tuple[slice, ...]:
        """The slice of each mount in the true ranges; empty for sensors without rays."""
        sensors = self.mounted_sensors()
        return _place([len(sensor.channels) if sees(sensor) else 0 for sensor in sensors])

    @cached_property
    def signal_layout(self) -> tuple[slice, ...]:
        """The slice of each mount in the sensed values (true ranges, then other signals)."""
        sensors = self.mounted_sensors()
        sizes = [SIGNAL_SIZES.get(sensor.measures, 0) for sensor in sensors]
        signals = _place([self.beam_count, *sizes])[1:]
        return tuple(
            beams if sees(sensor) else signal
            for sensor, beams, signal in zip(sensors, self.beam_layout, signals, strict=True)
        )

    @property
    def channel_count(self) -> int:
        """The number of readings."""
        return self.layout[-1].stop if self.layout else 0

    @property
    def beam_count(self) -> int:
        """The number of true ranges."""
        return self.beam_layout[-1].stop if self.beam_layout else 0

    @cached_property
    def signal_count(self) -> int:
        """The number of values that simulators sense: true ranges and other signals."""
        return max((part.stop for part in self.signal_layout), default=0)

    def mounted_sensors(self) -> list[Sensor]:
        """Return the sensor of each mount."""
        return [self.sensors[mount.sensor] for mount in self.mounts]

    def describe_sensors(self) -> Channels:
        """Describe each sensor as a signal that can fail."""
        sensors = self.mounted_sensors()
        return Channels(
            low=np.array([min(channel.low for channel in sensor.channels) for sensor in sensors]),
            high=np.array([max(channel.high for channel in sensor.channels) for sensor in sensors]),
            position=np.ascontiguousarray(self.sensor_poses[:, :3]),
            period=min((sensor.period_s for sensor in sensors), default=0.0),
        )

    def default_pitch(self, sensors: Iterable[Sensor]) -> float:
        """Return the pitch [deg] of the default mount for these sensors."""
        return level_pitch(sensors) if self.mount_pitch_deg is None else self.mount_pitch_deg

    @cached_property
    def sensor_poses(self) -> Array:
        """The sensor poses (n, 5): x, y, z [m], yaw (left positive), pitch (nose up) [rad]."""
        links = np.array([self.sensor_links[mount.link] for mount in self.mounts])
        mounts = np.array([mount.pose for mount in self.mounts], dtype=np.float64)
        poses = place_on_links(links.reshape(-1, 4), mounts.reshape(-1, 5))
        poses.flags.writeable = False
        return poses

    def channel_yaws(self) -> list[float]:
        """Return the yaw [rad] of each channel, the mean of its rays; NaN if it has no rays."""
        yaws: list[float] = []
        parts = zip(self.mounted_sensors(), self.sensor_poses, self.sensor_frames, strict=True)
        for sensor, pose, frame in parts:
            count = len(sensor.channels)
            if not sees(sensor):
                yaws += [math.nan] * count
            elif count == 1:
                yaws.append(float(pose[3]))
            else:
                middles = np.zeros((count, 3))
                np.add.at(middles, sensor.channel_of(), product(sensor.rays(), frame[:3, :3].T))
                yaws += atan2_all(middles[:, 1], middles[:, 0]).tolist()
        return yaws

    @cached_property
    def sensor_frames(self) -> Array:
        """The sensor frames (n, 4, 4) [m] in the robot's frame; x points along the beam."""
        frames = make_frames(self.sensor_poses)
        frames.flags.writeable = False
        return frames

    @cached_property
    def sorted_rays(self) -> dict[str, "SortedRays"]:
        """The rays of each range sensor type, by name."""
        return {name: sort_rays(sensor) for name, sensor in self.sensors.items() if sees(sensor)}

    @cached_property
    def ray_table(self) -> "RayTable":
        """The rays of all mounted sensors in the robot's frame, in the order of the ranges."""
        tables, counts = [np.zeros((0, RAY_SIZE))], [0]
        for name, sensor in self.sensors.items():  # mounts of one type are contiguous
            chosen = [index for index, mount in enumerate(self.mounts) if mount.sensor == name]
            if chosen and sees(sensor):
                directions, ends = self.sorted_rays[name]
                tables.append(lay_out_rays(sensor, directions, self.sensor_frames[chosen]))
                counts += np.diff([0, *ends]).tolist() * len(chosen)
        return RayTable(np.concatenate(tables), np.cumsum(counts))

    def _check_mount(self, mount: Mount, known: Mapping[str, int]) -> None:
        if mount.sensor not in known:
            raise InputError(
                f"mount on {mount.link}: sensor must be one of {', '.join(known) or 'none'}, "
                f"not {mount.sensor!r}; define that sensor type, or name another in the mount"
            )
        if not _NAME.fullmatch(mount.sensor):
            raise InputError(
                f"sensor {mount.sensor!r}: names must consist of letters, digits and _; rename the "
                f"sensor"
            )
        if mount.link not in self.sensor_links:
            raise self.link_error(mount.link)
        for entry in fields(mount):
            value = getattr(mount, entry.name)
            if entry.name not in ("sensor", "link") and not is_number(value):
                rule = f"{entry.name} must be a number, not {value!r}"
                raise InputError(f"mount of {mount.sensor}: {rule}")

    def link_error(self, link: str) -> InputError:
        """Create the error for a link that cannot carry sensors."""
        return InputError(
            f"robot {self.name}: mount link must be fixed to the root link and upright, "
            f"not {link!r}; name one of {list_names(self.sensor_links)}"
        )


def _place(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = list(accumulate(sizes))
    return tuple(slice(end - size, end) for size, end in zip(sizes, ends, strict=True))


DIRECTION, ORIGIN, HOUSING, LIMIT = 0, 3, 6, 7
"""Columns of a ray: unit vector, origin [m], length inside the housing [m], maximum range [m]."""
RAY_SIZE = 8


class SortedRays(NamedTuple):
    """The rays of a sensor type, sorted by channel."""

    directions: Array  # (k, 3), in the sensor's frame
    ends: list[int]  # cumulative number of rays, one per channel


class RayTable(NamedTuple):
    """The rays of all range sensors of a robot, grouped by beam."""

    rows: Array  # (r, RAY_SIZE)
    starts: NDArray[np.int64]  # (n + 1,) index of each beam's first ray, then the number of rays


def sort_rays(sensor: RangeSensor) -> SortedRays:
    """Return the rays of a sensor, sorted by channel."""
    rays, channels = sensor.rays(), np.asarray(sensor.channel_of())
    counts = np.bincount(channels, minlength=len(sensor.channels)) if len(rays) else np.zeros(1)
    if len(channels) != len(rays) or len(counts) != len(sensor.channels) or not counts.all():
        raise InputError(
            f"{type(sensor).__name__}.channel_of: must return a channel from 0 to "
            f"{len(sensor.channels) - 1} for each of the {len(rays)} rays, and each channel at "
            f"least once; correct channel_of or rays"
        )
    return SortedRays(rays[np.argsort(channels, kind="stable")], np.cumsum(counts).tolist())


def lay_out_rays(sensor: RangeSensor, rays: Array, frames: Array) -> Array:
    """Return the rows (n * k, RAY_SIZE) of ``rays`` (k, 3) of a sensor at ``frames`` (n, 4, 4)."""
    rows = np.empty((len(frames), len(rays), RAY_SIZE))
    axes = frames[:, None, :3, :3]
    turned = rays[:, :1] * axes[..., 0]
    turned = turned + rays[:, 1:2] * axes[..., 1] + rays[:, 2:] * axes[..., 2]
    rows[..., DIRECTION : DIRECTION + 3] = turned
    rows[..., ORIGIN : ORIGIN + 3] = frames[:, None, :3, 3]
    # Avoids division by 0; a ray parallel to a face leaves the box through another face.
    steep = np.maximum(np.abs(rays), 1e-12)
    rows[..., HOUSING] = (0.5 * np.array(sensor.size_m) / steep).min(axis=1)
    rows[..., LIMIT] = sensor.range_max_m
    return rows.reshape(-1, RAY_SIZE)
