"""Records a run for the Rerun viewer: missions, evolution and the layout of the views."""

import math
import re
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb
from scipy.spatial.transform import Rotation

from evoros.analysis.tables import designs
from evoros.analysis.tables.readings import WalkerTrack
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.tracks import NONE
from evoros.base.arrays import Array
from evoros.geometry.shapes import Shape
from evoros.plugins.recordings.missions import RecordedMission
from evoros.plugins.recordings.rerun.robot import (
    LINE,
    TIME,
    Entities,
    draw_fan,
    find_changes,
    show_faults,
    show_links,
    show_robot,
    show_sensor,
    to_mesh,
)
from evoros.plugins.recordings.video.captions import CLEAR
from evoros.plugins.recordings.video.motion import interpolate
from evoros.plugins.recordings.video.renderer import FIXED, MOVABLE
from evoros.plugins.recordings.video.scene import MOST_FACES, WALKER, ShownRobot
from evoros.plugins.recordings.video.sensors import make_views
from evoros.plugins.recordings.video.surfaces import Surface
from evoros.world.standing import standing_obstacles

_EVOLUTION = "evolution"
_FAN_M = 0.5  # length [m] at which fans are cut off; full ranges would hide the robot
_NAMES = {"recorded": "best", "validated": "best, validated", "mean": "mean"}
APPLICATION = "evoros"
_BEHIND_M, _ABOVE_M = 3.5, 2.2  # initial eye position [m] relative to the robot
_NEAR_M = (1.0, -1.2, 1.0)  # initial eye position [m] relative to the best design
_ALL_FACES = 5 * MOST_FACES  # maximum number of triangles for all robots in all missions
GROUND, COURSE = (0.93, 0.92, 0.9), (200, 120, 0)
_AROUND_M = 4.0  # margin [m] of the ground around the course and the path
_BELOW_M = 0.002  # depth [m] of the ground plane, which would flicker at the height of the lines
PATH = (40, 40, 40)
AGENTS = "agents"


def record_study(record: Record, missions: Sequence[RecordedMission]) -> bytes:
    """Return the recording of a run; equal runs give equal data, except ids created by rerun."""
    # The default properties would contain the time of day.
    stream = rr.RecordingStream(APPLICATION, recording_id=record.name, send_properties=False)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rerun.rrd"
        stream.save(path, _lay_out(missions, evolved=not record.run.evaluates))
        top = Entities(stream, ())
        robots = sum(1 + len(mission.others) for mission in missions)
        most_faces = min(MOST_FACES, _ALL_FACES // (robots + 1))
        for mission in missions:
            show_mission(top.below(mission.name), mission, most_faces)
        if not record.run.evaluates:
            _show_evolution(top.below(_EVOLUTION), record, missions[0].loaded_urdf, most_faces)
        stream.flush()
        stream.disconnect()
        return path.read_bytes()


def _lay_out(missions: Sequence[RecordedMission], evolved: bool) -> rrb.Blueprint:
    tabs = [_lay_out_mission(mission) for mission in missions]
    evolution = rrb.Horizontal(
        rrb.Spatial3DView(
            origin=f"/{_EVOLUTION}/best",
            name="the best design",
            eye_controls=rrb.EyeControls3D(position=_NEAR_M, look_target=(0.0, 0.0, 0.0)),
        ),
        rrb.Vertical(
            rrb.TimeSeriesView(origin=f"/{_EVOLUTION}/fitness", name="fitness"),
            rrb.TextDocumentView(origin=f"/{_EVOLUTION}/text", name="the best design"),
        ),
        column_shares=[2, 1],
        name=_EVOLUTION,
    )
    return rrb.Blueprint(
        rrb.Tabs(*tabs, *([evolution] if evolved else [])),
        rrb.TimePanel(timeline=TIME, state="collapsed"),
        collapse_panels=True,
    )


def _lay_out_mission(mission: RecordedMission) -> rrb.Container:
    path = rr.new_entity_path([mission.name])
    x, y, _, yaw = mission.world.course.home
    eye = rrb.EyeControls3D(
        position=(x - _BEHIND_M * math.cos(yaw), y - _BEHIND_M * math.sin(yaw), _ABOVE_M),
        look_target=(x, y, 0.0),
        tracking_entity=f"{path}/robot",
    )
    return rrb.Horizontal(
        rrb.Spatial3DView(origin=path, name=mission.name, eye_controls=eye, line_grid=False),
        rrb.Vertical(
            rrb.TimeSeriesView(origin=f"{path}/readings", name="readings"),
            rrb.TextLogView(origin=f"{path}/events", name="modes and failures"),
            row_shares=[2, 1],
        ),
        column_shares=[2, 1],
        name=mission.name,
    )


def _show_evolution(top: Entities, record: Record, urdf: str, most_faces: int) -> None:
    table = designs.read_generations(record)
    for name, column in designs.trace_fitness(table).dropna(axis=1, how="all").items():
        line, values = top.below("fitness", str(name)), column.dropna()
        line.show(rr.SeriesLines(names=_NAMES[str(name)]))
        scalars = rr.Scalars.columns(scalars=values.to_numpy(float))
        line.show_over_generations(values.index.astype(int).tolist(), scalars)
    bests = designs.select_bests(table).reset_index()
    generations = bests["generation"].astype(int).tolist()
    champion = top.below("fitness", "champion")
    champion.show(rr.SeriesPoints(names="champion", markers="asterisk", marker_sizes=8.0))
    fitness = rr.Scalars.columns(scalars=[designs.to_number(record.run.status.get("best_fitness"))])
    champion.show_over_generations(generations[-1:], fitness)
    scene = top.below("best")
    scene.show(rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    robot = ShownRobot(urdf, most_faces)
    types = "|".join(map(re.escape, record.context.types))
    body = [link for link in robot.surfaces if not re.fullmatch(rf".*(?:{types})_\d+", link)]
    show_links(scene.below("robot"), robot, body)
    sensors = designs.place_candidates(bests.drop_duplicates("id"), record)
    fans = {design: _draw(rows) for design, rows in sensors.groupby("design")}
    shown = [fans.get(design, []) for design in bests["id"]]
    strips = [fan for design in shown for fan in design]
    colours, radii = [CLEAR] * len(strips), [LINE] * len(strips)
    columns = rr.LineStrips3D.columns(strips=strips, colors=colours, radii=radii)
    sizes = [len(design) for design in shown]
    scene.below("sensors").show_over_generations(generations, columns.partition(sizes))
    best = int(record.run.champion["design"].iloc[0])
    texts = [
        f"Generation {row.generation}: design {row.id}{' (the champion)' * (row.id == best)}, "
        f"fitness {row.fitness:.4g}"
        for row in bests.itertuples()
    ]
    top.below("text").show_over_generations(generations, rr.TextDocument.columns(text=texts))


def _draw(sensors: pd.DataFrame) -> list[Array]:
    """Return the outlines (k, 3) [m] of the sensor fans of a design, in the robot's frame."""
    names = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "fov_deg", "range_m")
    fans = []
    for x, y, z, yaw, pitch, fov, reach in sensors[[*names]].to_numpy(float).tolist():
        fan = draw_fan(min(reach, _FAN_M), np.radians(max(fov, 1.0)) / 2)
        turn = Rotation.from_euler("ZY", [np.radians(yaw), np.radians(pitch)])
        fans.append(turn.apply(fan) + np.array([x, y, z]))
    return fans


def show_mission(top: Entities, mission: RecordedMission, most_faces: int) -> None:
    """Log a mission below the path ``top``."""
    top.show(rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _show_world(top.below("world"), mission)
    for walker in mission.walkers:
        _show_walker(top.below("walkers", walker.name), walker)
    _show_member(top, mission, most_faces)
    for name, other in mission.others.items():
        _show_member(top.below(AGENTS, name), other, most_faces)


def _show_member(top: Entities, mission: RecordedMission, most_faces: int) -> None:
    robot = ShownRobot(mission.loaded_urdf, most_faces)
    times = mission.trajectory["time_s"].to_numpy(float)
    motion = interpolate(mission.trajectory, times, robot.tree)
    shown = list(make_views(robot.tree, mission, times, np.arange(len(times))))
    _show_course(top.below("course"), mission)
    show_robot(top.below("robot"), robot, motion, {sensor.link: sensor.colours for sensor in shown})
    for sensor, view in zip(mission.sensors, shown, strict=True):
        show_sensor(top, sensor, view, times)
    route = np.stack([motion.x_m, motion.y_m, np.full(len(times), 0.01)], axis=1)
    top.below("path").show(rr.LineStrips3D([route], colors=PATH, radii=0.01))
    show_faults(top.below("robot", "faults"), robot, mission)
    _tell_events(top.below("events"), mission)


def _tell_events(top: Entities, mission: RecordedMission) -> None:
    rows, names = mission.trajectory, (NONE, *mission.context.modes)
    changes = find_changes(rows["mode"].to_numpy(float))
    events = [(float(rows["time_s"].iloc[i]), names[int(rows["mode"].iloc[i])]) for i in changes]
    entries = [(time, f"mode {name}", rr.TextLogLevel.INFO) for time, name in events]
    for fault in mission.faults:
        text = f"{mission.sensors[fault.sensor].link}: {fault.kind}"
        entries.append((fault.at_s, text, rr.TextLogLevel.WARN))
    for part, time, effect in mission.part_failures:
        entries.append((time, f"{part}: {effect}", rr.TextLogLevel.WARN))
    entries.sort(key=lambda event: event[0])
    times, texts, levels = zip(*entries, strict=True)
    top.show_over_time(np.array(times), rr.TextLog.columns(text=texts, level=levels))


def _show_walker(top: Entities, walker: WalkerTrack) -> None:
    cylinder = Shape("cylinder", (walker.radius_m, walker.height_m))
    top.show(to_mesh(Surface.from_shapes([cylinder], [WALKER])))
    heights = np.full((len(walker.places), 1), walker.height_m / 2)
    places = np.hstack([walker.places, heights])
    top.show_over_time(walker.time_s, rr.Transform3D.columns(translation=places))


def _show_world(top: Entities, mission: RecordedMission) -> None:
    places = mission.trajectory[["x_m", "y_m"]].to_numpy(float)
    points = np.vstack([places, mission.route, [mission.world.course.home[:2]]])
    low, high = points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M
    around = (low, (high[0], low[1]), high, (low[0], high[1]))
    corners = np.array([[x, y, -_BELOW_M] for x, y in around])
    ground = Surface.from_triangles(corners[[[0, 1, 2], [0, 2, 3]]], np.tile(GROUND, (2, 1)))
    top.below("ground").show(to_mesh(ground))
    bodies = standing_obstacles(mission.world)
    for name, colour, movable in (("fixed", FIXED, False), ("movable", MOVABLE, True)):
        shapes = [
            replace(shape, pose=pose)
            for body in bodies
            if (body.mass is not None) == movable
            for shape, pose in body.placed
        ]
        surface = Surface.from_shapes(shapes, [colour] * len(shapes))
        if len(surface.normals):
            top.below(name).show(to_mesh(surface))


def _show_course(top: Entities, mission: RecordedMission) -> None:
    course = mission.world.course
    goals = [[x, y, 0.0] for x, y in mission.route.tolist()]
    home = [*course.home[:2], 0.0]
    top.below("route").show(rr.LineStrips3D([[home, *goals]], colors=COURSE, radii=0.008))
    distinct = course.route(True)[: len(course.waypoints) + 1]
    angles = np.linspace(0.0, 2 * math.pi, 49)
    ring = course.acceptance_m * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    circles = [np.array([x, y, 0.0]) + ring for x, y in distinct.tolist()]
    labels = [*(str(i + 1) for i in range(len(course.waypoints))), "home"]
    top.below("acceptance").show(rr.LineStrips3D(circles, colors=COURSE, radii=0.008))
    places = [[x, y, 0.0] for x, y in distinct.tolist()]
    points = rr.Points3D(places, colors=COURSE, radii=0.04, labels=labels)
    top.below("waypoints").show(points)
