"""Shows a robot in a recording: links, sensor readings and failure markers."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from evoros.analysis.tables.readings import RecordedSensor
from evoros.base.arrays import Array
from evoros.plugins.recordings.missions import RecordedMission
from evoros.plugins.recordings.video.camera import Pixels
from evoros.plugins.recordings.video.motion import Motion
from evoros.plugins.recordings.video.scene import ShownRobot
from evoros.plugins.recordings.video.sensors import SILENT_M, FieldOfView, ShownSensor
from evoros.plugins.recordings.video.surfaces import Surface
from evoros.storage.figure_context import Beam

TIME, GENERATION = "mission_time", "generation"  # names of the timelines


class Entities(NamedTuple):
    """The entities below a path of a recording."""

    stream: rr.RecordingStream
    path: tuple[str, ...]

    def below(self, *names: str) -> "Entities":
        """Return the entities below a relative path."""
        return Entities(self.stream, (*self.path, *names))

    @property
    def address(self) -> str:
        """The path, as written in the viewer."""
        return str(rr.new_entity_path([*self.path]))

    def show(self, *things: rr.AsComponents) -> None:
        """Log archetypes that hold for all times."""
        for thing in things:
            self.stream.log(self.address, thing, static=True, strict=True)

    def show_over_time(self, times_s: Array, columns: Iterable[rr.ComponentColumn]) -> None:
        """Log a row of the columns at each mission time [s]."""
        self._send(rr.TimeColumn(TIME, duration=times_s), columns)

    def show_over_generations(
        self, generations: Sequence[int], columns: Iterable[rr.ComponentColumn]
    ) -> None:
        """Log a row of the columns at each generation."""
        self._send(rr.TimeColumn(GENERATION, sequence=generations), columns)

    def _send(self, index: rr.TimeColumn, columns: Iterable[rr.ComponentColumn]) -> None:
        self.stream.send_columns(self.address, [index], columns, strict=True)


def to_mesh(surface: Surface, painted: bool = True) -> rr.Mesh3D:
    """Return a surface as a mesh; each corner has its triangle's normal and colour."""
    corners = surface.corners[:, :3].astype(np.float32)
    colours = np.repeat(np.round(255 * surface.colours).astype(np.uint8), 3, axis=0)
    return rr.Mesh3D(
        vertex_positions=corners,
        vertex_normals=np.repeat(surface.normals, 3, axis=0).astype(np.float32),
        vertex_colors=colours if painted else None,
    )


def find_changes(*columns: Array | Pixels) -> list[int]:
    """Return the indices of the first row, and of rows that change any of the columns (n, ...)."""
    whole = np.hstack([np.asarray(c, dtype=float).reshape(len(c), -1) for c in columns])
    same = (whole[1:] == whole[:-1]) | (np.isnan(whole[1:]) & np.isnan(whole[:-1]))
    return [0, *(np.flatnonzero(~same.all(axis=1)) + 1).tolist()]


MOST_RAYS = 32  # approximate maximum number of rays drawn per scan
LINE = -1.0  # radius of lines; negative values are in screen points
_ARC = 7  # number of points on the arc of a fan
MARK = (220, 30, 30)
_ABOVE_M = 0.1  # height [m] of a marker above its sensor


def show_robot(
    top: Entities, robot: ShownRobot, motion: Motion, sensors: Mapping[str, Pixels]
) -> None:
    """Log a moving robot; ``sensors`` maps links to colours (n, 3) over time."""
    zeros = np.zeros(len(motion.time_s))
    places = np.stack([motion.x_m, motion.y_m, zeros], axis=1)
    half = motion.yaw_rad / 2
    turns = np.stack([zeros, zeros, np.sin(half), np.cos(half)], axis=1)
    columns = rr.Transform3D.columns(translation=places, quaternion=turns)
    top.show_over_time(motion.time_s, columns)
    links = top.below("links")
    moved = _move_links(robot, motion)
    show_links(links, robot, [link for link in robot.surfaces if link not in sensors], [*moved])
    for link, colours in sensors.items():
        show_links(links, robot, [link], painted=False)
        changes = find_changes(colours)
        painted = rr.Mesh3D.columns(albedo_factor=colours[changes])
        links.below(link).show_over_time(motion.time_s[changes], painted)
    for link, frames in moved.items():
        placed = Rotation.from_matrix(frames[:, :3, :3]).as_quat()
        columns = rr.Transform3D.columns(translation=frames[:, :3, 3], quaternion=placed)
        links.below(link).show_over_time(motion.time_s, columns)


def show_links(
    top: Entities,
    robot: ShownRobot,
    links: Sequence[str],
    moving: Sequence[str] = (),
    painted: bool = True,
) -> None:
    """Log links of a robot; links not in ``moving`` stay at their initial poses."""
    for link in links:
        surface, pose = robot.surfaces[link], robot.tree.poses[link]
        if len(surface.normals):
            top.below(link).show(to_mesh(surface, painted))
            if link not in moving:  # static data would override the motion
                turn = rr.Quaternion(xyzw=pose.quaternion)
                top.below(link).show(rr.Transform3D(translation=pose.position, quaternion=turn))


def _move_links(robot: ShownRobot, motion: Motion) -> dict[str, Array]:
    """Return the frames (n, 4, 4) of links that move relative to the root, in the root frame."""
    moving = [
        link
        for link, surface in robot.surfaces.items()
        if len(surface.normals)
        and any(joint.name in motion.joints for joint in robot.tree.joints_above(link))
    ]
    frames = np.empty((len(moving), len(motion.time_s), 4, 4))
    for i in range(len(motion.time_s)):
        robot.move(np.eye(4), {name: float(angles[i]) for name, angles in motion.joints.items()})
        for k, link in enumerate(moving):
            frames[k, i] = robot.frames[link]
    return dict(zip(moving, frames, strict=True))


def show_faults(top: Entities, robot: ShownRobot, mission: RecordedMission) -> None:
    """Log a marker at each failed sensor, and the names of other failed parts, from the onset."""
    marks: list[tuple[float, Array, str]] = []
    for fault in mission.faults:
        link = mission.sensors[fault.sensor].link
        x, y, z = robot.tree.poses[link].position
        marks.append((fault.at_s, np.array([x, y, z + _ABOVE_M]), f"{link}: {fault.kind}"))
    for part, time, effect in mission.part_failures:
        marks.append((time, np.array([0.0, 0.0, 3 * _ABOVE_M]), f"{part}: {effect}"))
    if not marks:
        return
    marks.sort(key=lambda mark: mark[0])
    times, places, labels = zip(*marks, strict=True)
    sizes = [*range(1, len(marks) + 1)]
    columns = rr.Points3D.columns(
        positions=np.concatenate([places[:size] for size in sizes]),
        labels=[label for size in sizes for label in labels[:size]],
        colors=[MARK for size in sizes for _ in range(size)],
        radii=np.full(sum(sizes), 0.025),
    )
    top.show_over_time(np.array(times), columns.partition(sizes))


def show_sensor(top: Entities, sensor: RecordedSensor, shown: ShownSensor, times: Array) -> None:
    """Log the readings of a sensor, taken at ``times`` (n,) [s], whenever they change."""
    _plot(top.below("readings", sensor.link), sensor, times)
    if shown.view is None or not isinstance(sensor.kind, Beam):
        return
    rays, view = top.below("robot", "rays", sensor.link), shown.view
    rays.show(rr.Transform3D(translation=view.frame[:3, 3], mat3x3=view.frame[:3, :3]))
    changes = find_changes(sensor.readings, shown.colours)
    ranges = np.where(np.isnan(sensor.readings), min(SILENT_M, view.range_m), sensor.readings)
    bearings = np.radians(sensor.kind.bearings_deg)
    strips = [strip for i in changes for strip in draw_rays(ranges[i], bearings, view)]
    count = len(strips) // len(changes)
    columns = rr.LineStrips3D.columns(
        strips=strips,
        colors=np.repeat(shown.colours[changes], count, axis=0),
        radii=np.full(len(strips), LINE),
    )
    rays.show_over_time(times[changes], columns.partition([count] * len(changes)))


def draw_rays(ranges: Array, bearings: Array, view: FieldOfView) -> list[Array]:
    """Return lines (k, 3) [m] in the sensor frame: the outline of a fan, or rays."""
    if len(ranges) == 1:
        return [draw_fan(float(ranges[0]), view.half_rad)]
    step = math.ceil(len(ranges) / MOST_RAYS)
    ends = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), 0.0 * ranges], axis=1)
    return [np.array([np.zeros(3), end]) for end in ends[::step]]


def draw_fan(reach: float, half_rad: float) -> Array:
    """Return the outline (k, 3) [m] of a fan about the x axis."""
    angles = np.linspace(-half_rad, half_rad, _ARC)
    arc = reach * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    return np.vstack([np.zeros(3), arc, np.zeros(3)])


def _plot(top: Entities, sensor: RecordedSensor, times: Array) -> None:
    kind = sensor.kind
    if isinstance(kind, Beam):
        values, names = np.fmin.reduce(sensor.readings, axis=1)[:, None], [f"{sensor.link} [m]"]
    else:
        values = sensor.readings
        channels = [f"{name} [{unit}]".replace(" []", "") for name, unit in kind.channels]
        names = [f"{sensor.link} {channel}" for channel in channels]
    top.show(rr.SeriesLines(names=names))
    changes = find_changes(values)
    columns = rr.Scalars.columns(scalars=values[changes].ravel())
    top.show_over_time(times[changes], columns.partition([values.shape[1]] * len(changes)))
