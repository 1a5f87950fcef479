"""A robot in a recording: its links with their meshes, and the marks of what has failed."""

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from evoros.base.arrays import Array

from ..bags.missions import RecordedMission
from ..tables.tracks import list_part_failures
from ..video.camera import Pixels
from ..video.faults import ShownFault
from ..video.motion import Motion
from ..video.scene import ShownRobot
from .entities import Entities, find_changes, to_mesh

MARK = (220, 30, 30)
_ABOVE_M = 0.1  # height of a mark above its sensor


def show_robot(
    top: Entities, robot: ShownRobot, motion: Motion, sensors: Mapping[str, Pixels]
) -> None:
    """Show a robot that moves; ``sensors`` has the colours (n, 3) of links over time."""
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
    """Show links of a robot, those that no joint moves at their poses."""
    for link in links:
        surface, (x, y, z) = robot.surfaces[link], robot.tree.poses[link].position
        if len(surface.normals):
            turn = robot.tree.poses[link].quaternion
            top.below(link).show(to_mesh(surface, painted))
            if link not in moving:  # what is shown at all times has precedence
                top.below(link).show(
                    rr.Transform3D(translation=(x, y, z), quaternion=rr.Quaternion(xyzw=turn))
                )


def _move_links(robot: ShownRobot, motion: Motion) -> dict[str, Array]:
    """Return the links that move against the root, with their frames (n, 4, 4) in it over time."""
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


def show_faults(
    top: Entities, robot: ShownRobot, mission: RecordedMission, faults: Sequence[ShownFault]
) -> None:
    """Mark the sensors that have failed, and name other parts, from their failures on."""
    marks: list[tuple[float, Array, str]] = []
    for fault in faults:
        link = mission.sensors[fault.sensor].link
        x, y, z = robot.tree.poses[link].position
        marks.append((fault.at_s, np.array([x, y, z + _ABOVE_M]), f"{link}: {fault.kind}"))
    for part, time, effect in list_part_failures(mission.row):
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
