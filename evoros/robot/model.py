"""The robot: its outline, its drive and its sensors."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import accumulate

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.checks import is_number
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.compilation.elementary_arrays import atan2_all
from evoros.drive.protocol import Drive
from evoros.formats.strict_xml import list_names
from evoros.formats.urdf.document import UrdfDocument
from evoros.robot.frames import make_frames, place_on_links
from evoros.robot.mounting import level_pitch
from evoros.robot.occlusion import Occluders
from evoros.robot.outline import SolidShape
from evoros.robot.rays import RayTable, SortedRays, sort_rays, tabulate_rays
from evoros.robot.sensor_elements import sensor_elements
from evoros.sensor.names import choose_prefix
from evoros.sensor.protocol import SIGNAL_SIZES, Mount, Sensor, sees

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot, with or without sensors.

    Its frame is on the ground at rest, x forward, y left: the root link of ``urdf_elements``.
    """

    name: str
    base_urdf: UrdfDocument  # the content of its file, without sensors
    drive: Drive
    outline: Array  # (k, 2) [m], convex, counter-clockwise: footprint of its collision shapes
    height_m: float  # top of its collision shapes, above the ground
    mount_link: str
    mount_z_m: float
    mount_pitch_deg: float | None  # None: levels the lowest ray of the sensors
    sensor_links: Mapping[str, tuple[float, float, float, float]]
    """Links that can carry sensors: x, y, z [m], yaw [rad] in the robot's frame."""
    visuals: tuple[SolidShape, ...] = ()  # what its links show, without sensors
    solids: tuple[SolidShape, ...] = ()  # the collision shapes of links that do not roll
    chosen_mount: tuple[str, ...] = ()  # keys of the default mount that the robot left open
    reserved_names: frozenset[str] = frozenset()  # of links and joints
    exposed_links: frozenset[str] = frozenset()
    """Wheels and casters that stick out of the body, so that obstacles can touch them; the outline
    includes them."""
    engine_urdf: UrdfDocument | None = None
    """The description for engines, if it is not ``base_urdf``: with the joints beside the drive
    held, wheels as cylinders, convex parts for meshes, and masses for moving links; the root is on
    the ground."""
    occluders: Occluders = field(default_factory=Occluders)  # parts that its sensors see of it
    mounts: tuple[Mount, ...] = ()  # mounts of one sensor type are contiguous
    sensors: Mapping[str, Sensor] = field(default_factory=dict)

    @property
    def urdf(self) -> str:
        """The text of the whole description, with a link, joint and Gazebo sensor a mount."""
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
        """The text that engines load, without sensors."""
        return (self.engine_urdf or self.base_urdf).text

    @property
    def loaded_urdf(self) -> str:
        """The text of ``urdf_elements``."""
        return etree.tostring(self.urdf_elements(), encoding="unicode") + "\n"

    def urdf_elements(self) -> Element:
        """Create the elements that engines load, with a link and a joint a mount."""
        root = (self.engine_urdf or self.base_urdf).copy_elements()
        for name, mount in self.named_mounts():
            root.extend(sensor_elements(name, mount, self.sensors[mount.sensor]))
        return root

    def named_mounts(self) -> Iterator[tuple[str, Mount]]:
        """Yield the name of each sensor's link, with its mount."""
        prefix = choose_prefix(self.reserved_names, self.sensors)
        for index, mount in enumerate(self.mounts):
            yield f"{prefix}{mount.sensor}_{index}", mount

    def with_sensors(self, mounts: Sequence[Mount], sensors: Mapping[str, Sensor]) -> "Robot":
        """Return this robot with other sensors, in the order of their types in ``sensors``.

        Raises:
            InputError: a sensor type or link is unknown, or a number is not finite.
        """
        order = {name: position for position, name in enumerate(sensors)}
        for mount in mounts:
            self._check_mount(mount, order)
        ordered = tuple(sorted(mounts, key=lambda mount: order[mount.sensor]))
        return replace(self, mounts=ordered, sensors=dict(sensors))

    @cached_property
    def layout(self) -> tuple[slice, ...]:
        """The part of the flat readings that each mount has: a value for each of its channels."""
        return _place([len(sensor.channels) for sensor in self.mounted_sensors()])

    @cached_property
    def beam_layout(self) -> tuple[slice, ...]:
        """The part of the true ranges that each mount has; empty if it casts no rays."""
        sensors = self.mounted_sensors()
        return _place([len(sensor.channels) if sees(sensor) else 0 for sensor in sensors])

    @cached_property
    def signal_layout(self) -> tuple[slice, ...]:
        """Each mount's part of the sensed values: true ranges, then signals of other mounts."""
        sensors = self.mounted_sensors()
        sizes = [SIGNAL_SIZES.get(sensor.measures, 0) for sensor in sensors]
        signals = _place([self.beam_count, *sizes])[1:]
        return tuple(
            beams if sees(sensor) else signal
            for sensor, beams, signal in zip(sensors, self.beam_layout, signals, strict=True)
        )

    @property
    def channel_count(self) -> int:
        """The number of all readings."""
        return self.layout[-1].stop if self.layout else 0

    @property
    def beam_count(self) -> int:
        """The number of true ranges."""
        return self.beam_layout[-1].stop if self.beam_layout else 0

    @cached_property
    def signal_count(self) -> int:
        """The number of values that simulators sense: true ranges and signals."""
        return max((part.stop for part in self.signal_layout), default=0)

    def mounted_sensors(self) -> list[Sensor]:
        """Return the sensor type of each mount."""
        return [self.sensors[mount.sensor] for mount in self.mounts]

    def default_pitch(self, sensors: Iterable[Sensor]) -> float:
        """Return the pitch [deg] of the default mount for these types of sensors."""
        return level_pitch(sensors) if self.mount_pitch_deg is None else self.mount_pitch_deg

    @cached_property
    def sensor_poses(self) -> Array:
        """The poses (n, 5): x, y, z [m], yaw (left positive), pitch (nose up) [rad]."""
        links = np.array([self.sensor_links[mount.link] for mount in self.mounts])
        poses = place_on_links(
            links.reshape(-1, 4),
            np.array([mount.pose for mount in self.mounts], dtype=np.float64).reshape(-1, 5),
        )
        poses.flags.writeable = False
        return poses

    def channel_yaws(self) -> list[float]:
        """Return the yaw [rad] of each reading, left positive; NaN if its sensor casts no rays.

        A sensor with several channels has the yaws of the middle of each channel's rays.
        """
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
        """The frames (n, 4, 4) [m], x along the beam, in the robot's frame."""
        frames = make_frames(self.sensor_poses)
        frames.flags.writeable = False
        return frames

    @cached_property
    def sorted_rays(self) -> dict[str, SortedRays]:
        """The rays of each type of sensor that casts any."""
        return {name: sort_rays(sensor) for name, sensor in self.sensors.items() if sees(sensor)}

    @cached_property
    def ray_table(self) -> RayTable:
        """The rays of all mounted sensors in the robot's frame, in the order of the true ranges."""
        types = {name: sensor for name, sensor in self.sensors.items() if sees(sensor)}
        return tabulate_rays(self.mounts, self.sensor_frames, types, self.sorted_rays)

    def _check_mount(self, mount: Mount, known: Mapping[str, int]) -> None:
        if mount.sensor not in known:
            raise InputError(
                f"mount on {mount.link}: sensor must be one of {', '.join(known) or 'none'}, "
                f"not {mount.sensor!r}; define that sensor type or rename it"
            )
        if not _NAME.fullmatch(mount.sensor):
            raise InputError(
                f"sensor {mount.sensor!r}: names must consist of letters, digits and _; rename it"
            )
        if mount.link not in self.sensor_links:
            raise self.link_error(mount.link)
        for entry in fields(mount):
            value = getattr(mount, entry.name)
            if entry.name not in ("sensor", "link") and not is_number(value):
                raise InputError(
                    f"mount of {mount.sensor}: {entry.name} must be a number, not {value!r}; set it"
                )

    def link_error(self, link: str) -> InputError:
        """Create the error for a link that cannot carry sensors, which the caller raises."""
        return InputError(
            f"robot {self.name}: mount link must be fixed to the root link and upright, "
            f"not {link!r}; name one of {list_names(self.sensor_links)}"
        )


def _place(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = list(accumulate(sizes))
    return tuple(slice(end - size, end) for size, end in zip(sizes, ends, strict=True))
