"""A mission in a recording: world, course, robots, readings and failures."""

import numpy as np
import rerun as rr

from evoros.filter.protocol import ENDS
from evoros.geometry.shapes import Shape

from ..bags.missions import RecordedMission
from ..tables.tracks import NONE, list_failures, list_part_failures
from ..tables.walkers import WalkerTrack
from ..video.faults import ShownFault, flag_ends, measure_errors
from ..video.motion import interpolate
from ..video.scene import WALKER, ShownRobot
from ..video.sensors import colour_sensors, make_views
from ..video.surfaces import Surface
from .entities import Entities, find_changes, to_mesh
from .robot import show_faults, show_robot
from .sensors import show_sensor
from .world import show_course, show_world

PATH = (40, 40, 40)
AGENTS = "agents"


def show_mission(
    top: Entities, mission: RecordedMission, near_m: float | None, most_faces: int
) -> None:
    """Show a mission below ``top``; see ``make_views`` for ``near_m``."""
    top.show(rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    show_world(top.below("world"), mission)
    for walker in mission.walkers:
        _show_walker(top.below("walkers", walker.name), walker)
    _show_member(top, mission, near_m, most_faces)
    for name, other in mission.others.items():
        _show_member(top.below(AGENTS, name), other, near_m, most_faces)


def _show_member(
    top: Entities, mission: RecordedMission, near_m: float | None, most_faces: int
) -> None:
    """Show a robot of a mission with its course, sensors and failures."""
    robot = ShownRobot(mission.loaded_urdf, most_faces)
    times = mission.trajectory["time_s"].to_numpy(float)
    motion = interpolate(mission.trajectory, times, robot.tree)
    faults = _list_faults(mission)
    count = len(mission.sensors)
    ended, errors = flag_ends(times, count, faults), measure_errors(times, count, faults)
    records = np.arange(len(times))
    shown = list(make_views(robot.tree, mission.sensors, records, near_m))
    painted = [colour_sensors(shown, ended, errors, i) for i in records.tolist()]
    colours = np.array(painted, dtype=np.uint8).reshape(len(times), count, 3)
    show_course(top.below("course"), mission)
    sensors = {sensor.link: colours[:, i] for i, sensor in enumerate(shown)}
    show_robot(top.below("robot"), robot, motion, sensors)
    for i, sensor in enumerate(mission.sensors):
        show_sensor(top, sensor, shown[i], times, colours[:, i])
    route = np.stack([motion.x_m, motion.y_m, np.full(len(times), 0.01)], axis=1)
    top.below("path").show(rr.LineStrips3D([route], colors=PATH, radii=0.01))
    show_faults(top.below("robot", "faults"), robot, mission, faults)
    _tell_events(top.below("events"), mission, faults)


def _list_faults(mission: RecordedMission) -> list[ShownFault]:
    effects = mission.context.failure.effects
    return [
        ShownFault(sensor, time, effects.get(name, ENDS))
        for sensor, time, name in list_failures(mission.row)
    ]


def _tell_events(top: Entities, mission: RecordedMission, faults: list[ShownFault]) -> None:
    """Log each change of the mode, and each failure."""
    rows, names = mission.trajectory, (NONE, *mission.modes)
    changes = find_changes(rows["mode"].to_numpy(float))
    events = [(float(rows["time_s"].iloc[i]), names[int(rows["mode"].iloc[i])]) for i in changes]
    told = [(time, f"mode {name}", rr.TextLogLevel.INFO) for time, name in events]
    for fault in faults:
        text = f"{mission.sensors[fault.sensor].link}: {fault.kind}"
        told.append((fault.at_s, text, rr.TextLogLevel.WARN))
    for part, time, effect in list_part_failures(mission.row):
        told.append((time, f"{part}: {effect}", rr.TextLogLevel.WARN))
    told.sort(key=lambda event: event[0])
    times, texts, levels = zip(*told, strict=True)
    top.show_over_time(np.array(times), rr.TextLog.columns(text=texts, level=levels))


def _show_walker(top: Entities, walker: WalkerTrack) -> None:
    cylinder = Shape("cylinder", (walker.radius_m, walker.height_m))
    top.show(to_mesh(Surface.from_shapes([cylinder], [WALKER])))
    heights = np.full((len(walker.places), 1), walker.height_m / 2)
    places = np.hstack([walker.places, heights])
    top.show_over_time(walker.time_s, rr.Transform3D.columns(translation=places))
