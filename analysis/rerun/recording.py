"""The whole recording: its missions, the evolution, and the layout of its views."""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from ..bags.missions import RecordedMission
from ..tables.records import Record
from ..video.looks import MOST_FACES
from ..video.mission import find_near
from .entities import TIME, Entities
from .evolution import EVOLUTION, show_evolution
from .mission import show_mission

APPLICATION = "evoros"
_BEHIND_M, _ABOVE_M = 3.5, 2.2  # first place of the eye from the robot
_NEAR_M = (1.0, -1.2, 1.0)  # and from the best design
_ALL_FACES = 5 * MOST_FACES  # of the robots of all missions


def record_study(record: Record, missions: Sequence[RecordedMission]) -> bytes:
    """Return the file of a recording.

    Equal runs give equal data. The library's identifiers of rows and views differ each time.
    """
    # Without the properties, which have the time of day.
    stream = rr.RecordingStream(APPLICATION, recording_id=record.name, send_properties=False)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rerun.rrd"
        stream.save(path, _lay_out(missions))
        top = Entities(stream, ())
        robots = sum(1 + len(mission.others) for mission in missions)
        most_faces = min(MOST_FACES, _ALL_FACES // (robots + 1))
        for mission in missions:
            show_mission(top.below(mission.name), mission, find_near(record), most_faces)
        show_evolution(top.below(EVOLUTION), record, missions[0].loaded_urdf, most_faces)
        stream.flush()
        stream.disconnect()
        return path.read_bytes()


def _lay_out(missions: Sequence[RecordedMission]) -> rrb.Blueprint:
    """Return a tab for each mission and one for the evolution."""
    tabs = [_lay_out_mission(mission) for mission in missions]
    evolution = rrb.Horizontal(
        rrb.Spatial3DView(
            origin=f"/{EVOLUTION}/best",
            name="the best design",
            eye_controls=rrb.EyeControls3D(position=_NEAR_M, look_target=(0.0, 0.0, 0.0)),
        ),
        rrb.Vertical(
            rrb.TimeSeriesView(origin=f"/{EVOLUTION}/fitness", name="fitness"),
            rrb.TextDocumentView(origin=f"/{EVOLUTION}/text", name="the best design"),
        ),
        column_shares=[2, 1],
        name=EVOLUTION,
    )
    return rrb.Blueprint(
        rrb.Tabs(*tabs, evolution),
        rrb.TimePanel(timeline=TIME, state="collapsed"),
        collapse_panels=True,
    )


def _lay_out_mission(mission: RecordedMission) -> rrb.Container:
    """Return a view that follows the robot, beside readings and events."""
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
