"""A video shows what is recorded: where the robot was, and what its sensors saw."""

import io
import itertools
import math
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace as changed
from pathlib import Path
from typing import Any

import av
import av.container
import numpy as np
import pandas as pd
import pytest
from documents import page
from fixture_types import Capture, Folders, Patch
from helpers import USER_PARTS, finished_run, reseal
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from evoros.analysis.command import evoros_analyze
from evoros.analysis.drawing.faults import GROWN_S
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.filter.protocol import ALTERS, ENDS, GROWS
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.footprint import top_height
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.plugins.recordings.missions import ShownFault, assemble
from evoros.plugins.recordings.video.camera import (
    Camera,
    Pixels,
    RenderOptions,
    chase_camera,
    make_captions,
    overhead_camera,
    to_matrix,
)
from evoros.plugins.recordings.video.captions import (
    CLEAR,
    ERRING,
    FAILED,
    NEAR,
    Caption,
    write_caption,
)
from evoros.plugins.recordings.video.film import encode_mp4, film
from evoros.plugins.recordings.video.motion import (
    Motion,
    flag_ends,
    interpolate,
    measure_errors,
)
from evoros.plugins.recordings.video.renderer import CUT_M, cut_obstacles, find_goals
from evoros.plugins.recordings.video.scene import Picture, Scene, rasterize
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run, load_run
from evoros.terminal.console import DONE, INPUT
from evoros.world.course import Course
from evoros.world.model import World

SIZE = (320, 180)
GROUND = Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),))
COURSE = Course(0.0, 0.0, 0.08, 0.0, ((4.0, 0.0), (4.0, 3.0)), 1.0, 100.0, "random", True)
OPEN = World("open", (GROUND,), COURSE, "open.sdf", "0")


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Run:
    folder = tmp_path_factory.mktemp("video") / "run"
    return load_run(finished_run(folder, "failure.latest_s=3.0"))


@pytest.fixture(scope="module")
def setting(run: Run) -> FigureContext:
    return FigureContext.read(run.path)


@pytest.fixture(scope="module")
def urdf(run: Run) -> str:
    return (run.path / "champion" / "robot.urdf").read_text()


@pytest.fixture(scope="module")
def rover(urdf: str) -> Urdf:
    return read_tree(parse(urdf.encode(), "robot.urdf"), "robot.urdf")


def table(*readings: list[float], yaw: float = 0.0) -> pd.DataFrame:
    """A robot that stands at 1, 2 [m]; a row each 0.1 s."""
    count = len(readings)
    poses = {"x_m": 1.0, "y_m": 2.0, "yaw_rad": yaw, "mode": 2, "visited": 0, "contact": 0}
    poses |= {"speed_mps": 0.0, "steering_rad": 0.0}
    ranges = {f"range_{i}_m": ranges_m for i, ranges_m in enumerate(zip(*readings, strict=True))}
    return pd.DataFrame({"time_s": 0.1 * np.arange(count), **poses, **ranges})


def pixel(camera: Camera, *point: float) -> tuple[int, int]:
    """Row and column on which a point is."""
    x, y, depth = camera.pixels @ [*point, 1.0]
    return int(y / depth), int(x / depth)


# The robot ----------------------------------------------------------------------------------


BOX = """<robot name="box"><link name="base">
<inertial><origin xyz="-0.1 0.03 0.2"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><origin xyz="0.05 0 0.1"/><geometry><box size="0.4 0.2 0.1"/></geometry></visual>
</link></robot>"""


def look(camera: Camera, x: float, y: float, yaw: float) -> Picture:
    """The picture of the box at a pose."""
    scene = Scene([BOX], [])
    scene.robots[0].move(to_matrix(Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw)), {})
    return scene.render(camera)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (3.5, -1.25, 0.9), (-2.0, 4.0, -2.7)])
@pytest.mark.parametrize("follows", [True, False])
def test_a_robot_covers_the_pixels_that_its_pose_says(
    follows: bool, place: tuple[float, float, float]
) -> None:
    """The projected corners of the box bound the pixels drawn of it."""
    x, y, yaw = place
    size = (640, 360)
    low, high = (x - 0.5, y - 0.4), (x + 0.5, y + 0.4)
    camera = chase_camera(*place, size) if follows else overhead_camera(low, high, size)
    picture = look(camera, *place)
    pose = Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw)
    corners = np.array(
        [
            camera.pixels @ [*pose.transform((0.05 + a, b, 0.1 + c)), 1.0]
            for a in (-0.2, 0.2)
            for b in (-0.1, 0.1)
            for c in (-0.05, 0.05)
        ]
    )
    depth = corners[:, 2]
    across, down = corners[:, 0] / depth, corners[:, 1] / depth
    rows, columns = np.nonzero(np.isfinite(picture.depth))
    result = [columns.min(), columns.max() + 1, rows.min(), rows.max() + 1]
    assert result == pytest.approx([across.min(), across.max(), down.min(), down.max()], abs=1.5)
    depths = picture.depth[rows, columns]
    assert depth.min() - 0.01 < depths.min() <= depths.max() < depth.max() + 0.01


def test_what_passes_behind_the_camera_is_seen_as_far_as_it_is_ahead() -> None:
    """A wall beside the camera, parallel to its line of sight, ends at the middle of the picture.

    Its depth in a column is its distance aside times the focal length over the column's offset.
    """
    camera = Camera(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), 90.0, SIZE)
    wall = np.array(
        [[[-9.0, 2, -9], [900, 2, -9], [900, 2, 9]], [[-9.0, 2, -9], [900, 2, 9], [-9, 2, 9]]]
    )
    corners = np.dstack([wall, np.ones((2, 3))]) @ camera.pixels.T
    seen = rasterize(corners, np.zeros((2, 3), np.uint8), SIZE).depth[90]
    columns = np.arange(SIZE[0]) + 0.5
    assert seen[:150] == pytest.approx(2.0 * 90.0 / (160 - columns[:150]), rel=1e-3)
    assert np.isinf(seen[160:]).all()


def test_a_point_is_seen_where_similar_triangles_put_it() -> None:
    camera = Camera(np.zeros(3), np.array([5.0, 0, 0]), np.array([0, 0, 1.0]), 90.0, SIZE)
    # Half the height, 90 pixels, is the tangent of 45 degrees.
    x, y, depth = camera.pixels @ [2.0, 0.5, -1.0, 1.0]
    assert (x / depth, y / depth, depth) == pytest.approx((160 - 22.5, 90 + 45, 2.0))


def test_wheels_point_where_they_roll_on_a_circle(rover: Urdf) -> None:
    """Ackermann's geometry: all wheels' axes meet in the centre of the turn."""
    wheels = {name: rover.poses[rover.joints[name].child].position for name in rover.joints}
    rear, left = wheels["rear_left_wheel_joint"], wheels["front_left_wheel_joint"]
    radius, rate = 1.5, 0.2  # of the middle of the rear axle; [rad/s], to the left
    time = np.arange(0.0, 20.0, 0.1)
    yaw = rate * time
    # The root link is ahead of the rear axle.
    x = radius * np.sin(yaw) - rear[0] * np.cos(yaw)
    y = radius * (1 - np.cos(yaw)) - rear[0] * np.sin(yaw)
    path = pd.DataFrame({"time_s": time, "x_m": x, "y_m": y, "yaw_rad": yaw, "mode": 2})
    moves = interpolate(path.assign(visited=0), time[5:-5], rover)
    base = left[0] - rear[0]
    expected = math.atan(base / (radius - left[1])), math.atan(base / (radius + left[1]))
    for side, angle in zip(("left", "right"), expected, strict=True):
        result = moves.joints[f"front_{side}_steering_joint"]
        assert result == pytest.approx(np.full(result.size, angle), abs=1e-3)
    rolled = np.diff(moves.joints["rear_left_wheel_joint"]) * rear[2]
    assert rolled == pytest.approx(np.full(rolled.size, (radius - rear[1]) * rate * 0.1), rel=1e-3)


def test_between_records_the_robot_is_between_their_places(rover: Urdf) -> None:
    path = table([1.0], [1.0]).assign(x_m=[0.0, 1.0], yaw_rad=[3.1, -3.1])
    moves = interpolate(path, np.array([0.0, 0.025, 0.1]), rover)
    assert moves.x_m == pytest.approx([0.0, 0.25, 1.0])
    turn = 2 * math.pi - 6.2  # the short way round
    assert moves.yaw_rad == pytest.approx([3.1, 3.1 + turn / 4, 3.1 + turn])
    assert moves.record.tolist() == [0, 0, 1]


# Its sensors --------------------------------------------------------------------------------


def shown(
    urdf: str, setting: FigureContext, readings: list[float], world: World = OPEN, **more: Any
) -> tuple[Pixels, Camera]:
    """The picture of these readings, and its camera, which follows."""
    options = RenderOptions(size=SIZE, fps=10.0, speed=1.0, end_s=0.05)
    path = table(readings, readings)
    (first, *_) = film(assemble(path, urdf, world, setting, **more), options)
    return first, chase_camera(1.0, 2.0, 0.0, SIZE)


def ahead(rover: Urdf, sensor: int, distance: float) -> Array:
    """A point on the axis of a sensor's level fan, of the robot of ``table``."""
    pose = rover.poses[f"sonar_{sensor}"]
    x, y, z = pose.position
    along = distance * np.array([math.cos(pose.yaw), math.sin(pose.yaw)])
    return np.array([1.0 + x + along[0], 2.0 + y + along[1], z])


def colour(picture: Pixels, camera: Camera, point: Array) -> Array:
    row, column = pixel(camera, *point)
    return np.asarray(picture[row, column], dtype=np.float64)


@pytest.fixture(scope="module")
def sensor(rover: Urdf) -> int:
    """The sensor that looks most nearly straight ahead."""
    return min(range(6), key=lambda i: abs(rover.poses[f"sonar_{i}"].yaw))


def test_a_fan_ends_at_the_reading_and_is_gone_when_the_sensor_is_silent(
    urdf: str, setting: FigureContext, rover: Urdf, sensor: int
) -> None:
    silent = [math.nan] * 6
    seen = [1.5 if i == sensor else math.nan for i in range(6)]
    without, camera = shown(urdf, setting, silent)
    with_it, _ = shown(urdf, setting, seen, near_m=1.0)
    inside, beyond = ahead(rover, sensor, 1.0), ahead(rover, sensor, 1.8)
    change = colour(with_it, camera, inside) - colour(without, camera, inside)
    towards = np.array(CLEAR) - colour(without, camera, inside)
    assert change @ towards > 0.2 * (towards @ towards)
    assert np.abs(colour(with_it, camera, beyond) - colour(without, camera, beyond)).max() <= 2


@pytest.mark.parametrize(
    ("more", "expected"),
    [({"near_m": 1.0}, CLEAR), ({"near_m": 2.0}, NEAR), ({"ended": True}, FAILED)],
)
def test_a_fan_has_the_colour_of_its_state(
    more: dict[str, Any], expected: tuple[int, int, int], urdf: str, setting: FigureContext,
    rover: Urdf, sensor: int,
) -> None:  # fmt: skip
    if "ended" in more:
        more = {"faults": [ShownFault(sensor, 0.0)]}
    seen = [1.5 if i == sensor else math.nan for i in range(6)]
    picture, camera = shown(urdf, setting, seen, **more)
    result = colour(picture, camera, ahead(rover, sensor, 1.0))
    floor = np.array([236.0, 234.0, 229.0])
    share = (
        (result - floor) @ (np.array(expected) - floor) / np.sum((np.array(expected) - floor) ** 2)
    )
    assert 0.2 < share < 0.8
    assert result == pytest.approx(floor + share * (np.array(expected) - floor), abs=12)


def test_an_error_colours_a_fan_the_more_the_longer_it_grows(
    urdf: str, setting: FigureContext, rover: Urdf, sensor: int
) -> None:
    seen = [1.5 if i == sensor else math.nan for i in range(6)]
    place = ahead(rover, sensor, 1.0)
    purple = np.array(ERRING) - np.array(CLEAR)
    shares = []
    for fault in (None, ShownFault(sensor, -30.0, GROWS), ShownFault(sensor, -30.0, ALTERS)):
        faults = [] if fault is None else [fault]
        picture, camera = shown(urdf, setting, seen, near_m=1.0, faults=faults)
        shares.append(float(colour(picture, camera, place) @ purple))
    assert shares[0] < shares[1] < shares[2]


@given(
    faults=st.lists(
        st.builds(
            ShownFault, st.integers(0, 3), st.floats(0, 100), st.sampled_from([ENDS, ALTERS, GROWS])
        ),
        max_size=6,
        unique_by=lambda fault: fault.sensor,
    )
)
def test_ends_are_sudden_and_errors_never_shrink(faults: list[ShownFault]) -> None:
    times = np.linspace(0.0, 200.0, 41)
    ended, errors = flag_ends(times, 4, faults), measure_errors(times, 4, faults)
    kinds = {fault.sensor: fault for fault in faults}
    for sensor in range(4):
        fault = kinds.get(sensor, ShownFault(sensor, math.inf))
        begun = times >= fault.at_s
        assert (ended[:, sensor] == (begun & (fault.kind == ENDS))).all()
        assert (np.diff(errors[:, sensor]) >= 0).all()
        assert (errors[~begun, sensor] == 0).all()
        if fault.kind == ENDS:
            assert (errors[:, sensor] == 0).all()
        if fault.kind == ALTERS:
            assert (errors[begun, sensor] == 1).all()
        if fault.kind == GROWS:
            assert errors[-1, sensor] == pytest.approx(min(1.0, (200.0 - fault.at_s) / GROWN_S))


def test_a_fan_is_hidden_behind_an_obstacle(
    urdf: str, setting: FigureContext, rover: Urdf, sensor: int
) -> None:
    camera = chase_camera(1.0, 2.0, 0.0, SIZE)
    point = ahead(rover, sensor, 1.5)
    between = camera.eye + 0.9 * (point - camera.eye)
    place = (float(between[0]), float(between[1]), 0.25)
    wall = Body("wall", Pose(place), (Shape("box", (0.05, 0.6, 0.5)),))
    world = World("wall", (GROUND, wall), COURSE, "wall.sdf", "1")
    silent = [math.nan] * 6
    seen = [2.5 if i == sensor else math.nan for i in range(6)]
    without, with_it = (shown(urdf, setting, ranges_m, world)[0] for ranges_m in (silent, seen))
    assert (colour(without, camera, point) == colour(with_it, camera, point)).all()
    nearer = ahead(rover, sensor, 0.3)  # before the wall
    assert (colour(without, camera, nearer) != colour(with_it, camera, nearer)).any()


def test_a_robot_of_another_mission_is_refused(urdf: str, setting: FigureContext) -> None:
    with pytest.raises(InputError, match="sensors 0, 1, 2, 3, 4, 5, 6, but"):
        assemble(table([1.0] * 7), urdf, OPEN, setting)


# The world ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "pose"),
    [
        (Shape("box", (1.0, 2.0, 3.0)), Pose((0.0, 0.0, 1.5))),
        (Shape("box", (3.0, 2.0, 1.0)), Pose.from_rpy((0, 0, 1.5), 0.0, math.pi / 2, 0.3)),
        (Shape("cylinder", (0.4, 2.0)), Pose((1.0, 1.0, 1.0))),
    ],
)
def test_what_stands_high_is_cut_and_its_foot_stays(shape: Shape, pose: Pose) -> None:
    elsewhere = changed(COURSE, home_x_m=-5.0, waypoints=((-4.0, 0.0),))
    world = World("high", (GROUND, Body("a", pose, (shape,))), elsewhere, "a.sdf", "2")
    ((body, _),) = cut_obstacles(world)
    (cut,) = body.shapes
    placed = body.pose @ cut.pose
    assert top_height(cut, placed) == pytest.approx(CUT_M)
    assert placed.position[2] == pytest.approx(CUT_M / 2)
    assert placed.position[:2] == pytest.approx(pose.position[:2])


def test_a_high_part_of_a_mesh_is_cut_and_its_foot_stays() -> None:
    """A cone of three sides, 2 m high: at 0.6 m it is 0.7 as wide as at its foot."""
    corners = ((1.0, 0.0, 0.0), (-0.5, 0.8, 0.0), (-0.5, -0.8, 0.0), (0.0, 0.0, 2.0))
    pose = Pose.from_rpy((1.0, 1.0, 0.0), 0.0, 0.0, 0.4)
    body = Body("cone", pose, (Shape("convex", (), corners=corners),))
    elsewhere = changed(COURSE, home_x_m=-5.0, waypoints=((-4.0, 0.0),))
    ((shown, _),) = cut_obstacles(World("high", (GROUND, body), elsewhere, "a.sdf", "2"))
    expected = [*corners[:3], *((0.7 * x, 0.7 * y, CUT_M) for x, y, _ in corners[:3])]
    gaps = np.linalg.norm(np.array(shown.shapes[0].corners)[:, None] - expected, axis=2)
    assert gaps.shape == (6, 6)
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-9


def test_polyhedra_and_height_fields_are_seen() -> None:
    """From straight above: a wedge at 2, 0 in its own colour, and hills at -2, 0."""
    corners = tuple((x, y, z) for y in (-0.5, 0.5) for x, z in ((-0.5, 0), (0.5, 0), (0.5, 0.4)))
    wedge = Body("wedge", Pose((2.0, 0.0, 0.0)), (Shape("convex", (), corners=corners),))
    field = Shape("heightfield", (1.0, 1.0), heights=((0.1, 0.2), (0.3, 0.1)))
    hills = Body("hills", Pose((-2.0, 0.0, 0.0)), (field,))
    crate = Body("crate", Pose((0.0, 2.0, 0.2)), (Shape("box", (1.0, 1.0, 0.4)), *wedge.shapes))
    camera = overhead_camera((-4.0, -3.0), (4.0, 3.0), SIZE)
    solids = [(wedge, (0.9, 0.1, 0.1)), (hills, (0.1, 0.9, 0.1)), (crate, (0.1, 0.1, 0.9))]
    picture = Scene([BOX], solids).render(camera)
    for x, y, channel in ((2.2, 0.1, 0), (-2.3, 0.3, 1), (-1.6, -0.4, 1), (0.1, 2.3, 2)):
        colour_ = picture.colours[pixel(camera, x, y, 0.1)][:3]
        assert int(np.argmax(colour_)) == channel
        assert colour_.max() > colour_.min() + 50
    for x, y in ((1.3, 0.0), (2.7, 0.0), (-1.3, 0.0), (-2.7, 0.0), (2.0, 0.8)):
        assert picture.depth[pixel(camera, x, y, 0.1)] == math.inf


def test_low_obstacles_are_whole_and_those_overhead_are_not_shown() -> None:
    low = Body("low", Pose((2.0, 1.0, 0.2)), (Shape("box", (0.4, 0.4, 0.4)),), mass=5.0)
    roof = Body("roof", Pose((2.0, 1.0, 2.0)), (Shape("box", (9.0, 9.0, 0.1)),))
    world = World("roofed", (GROUND, low, roof), COURSE, "roofed.sdf", "3")
    assert [body for body, _ in cut_obstacles(world)] == [low]


@pytest.mark.parametrize("forward", [True, False])
def test_the_next_waypoint_is_that_of_the_direction_that_was_driven(forward: bool) -> None:
    route = COURSE.route(forward)
    places = np.vstack([[0.0, 0.0], 0.8 * route[0], route[0], route[1]])
    result = find_goals(OPEN, places, np.array([0, 0, 1, 6]))
    assert result[:3].tolist() == [route[0].tolist(), route[0].tolist(), route[1].tolist()]
    assert np.isnan(result[3]).all()  # behind the last


def test_links_that_show_meshes_show_what_collides_instead(urdf: str) -> None:
    """No file of a mesh is opened: it may not be there."""
    mesh = '<mesh filename="package://nowhere/wheel.dae"/>'
    cylinder = '<cylinder length="0.056" radius="0.0635"/>'
    assert urdf.count(cylinder) == 4
    camera = overhead_camera((-0.5, -0.5), (0.5, 0.5), (100, 100))
    covered = [
        int(np.isfinite(Scene([shown], []).render(camera).depth).sum())
        for shown in (urdf, urdf.replace(cylinder, mesh))
    ]
    assert covered[1] == pytest.approx(covered[0], rel=0.1)
    assert 3 * covered[0] > covered[1]


# The video ----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(640, 480), (640, 360), (854, 480)])
def test_no_words_of_a_caption_run_into_each_other(size: tuple[int, int]) -> None:
    left = ("a world with a long name, in which a robot drives", "12 s of 300 s", "waypoint 7 of 8")
    words = [*left, "avoiding or reversing", "10 x real time"]
    columns = []
    for i in range(len(words)):
        shown = [word if i == place else "" for place, word in enumerate(words)]
        picture = Image.new("RGB", size, "white")
        write_caption(picture, Caption(shown[:-1], shown[-1], (), ()))
        strip = np.asarray(picture)[: size[1] // 12]
        columns.append(np.flatnonzero((strip < 128).any(axis=(0, 2))))
    for one, other in itertools.pairwise(columns):
        assert other.min() - one.max() > 3


@pytest.mark.parametrize(
    ("start", "end", "speed", "fps", "count"),
    [
        (0.0, 9.0, 1.0, 10.0, 10),  # 0.9 s: as long as the mission
        (0.0, 9.0, 4.0, 20.0, 6),  # 4.5 steps of 0.2 s, and the end
        (0.3, 0.7, 2.0, 10.0, 3),
        (0.9, 9.0, 8.0, 25.0, 1),
    ],
)
def test_as_many_pictures_as_speed_and_rate_say(
    start: float,
    end: float,
    speed: float,
    fps: float,
    count: int,
    urdf: str,
    setting: FigureContext,
) -> None:
    path = table(*[[1.0] * 6] * 10)
    options = RenderOptions("above", (64, 64), fps, speed, start, end)
    pictures = list(film(assemble(path, urdf, OPEN, setting), options))
    assert [ranges_m.shape for ranges_m in pictures] == [(64, 64, 3)] * count


def test_a_caption_names_the_parts_that_have_failed(urdf: str, setting: FigureContext) -> None:
    failures = [("steering", 0.1, "stuck"), ("battery", 0.2, "constant")]
    path = table(*[[1.0] * 6] * 3)
    mission = assemble(path, urdf, OPEN, setting, part_failures=failures)
    place, rows = path["x_m"].to_numpy(), np.arange(3)
    motion = Motion(path["time_s"].to_numpy(), place, place, place, rows, {})
    states = [caption.left[-1] for caption in make_captions(mission, motion, RenderOptions())]
    assert "failed" not in states[0]
    assert states[1].endswith(", failed: steering")
    assert states[2].endswith(", failed: steering, battery")


@pytest.fixture(scope="module")
def pictures(run: Run, urdf: str, setting: FigureContext) -> list[Pixels]:
    path = run.trajectory("near")
    options = RenderOptions(size=(160, 90), fps=5.0, speed=2.0, end_s=2.0, title="near")
    return list(film(assemble(path, urdf, OPEN, setting), options))


def test_an_mp4_plays_the_pictures_at_their_rate(pictures: list[Pixels]) -> None:
    with av.open(io.BytesIO(encode_mp4(pictures, 5.0))) as container:
        assert isinstance(container, av.container.InputContainer)
        (stream,) = container.streams.video
        decoded = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert stream.average_rate == 5
        assert stream.codec_context.name == "h264"
    assert len(decoded) == len(pictures)
    for was, result in zip(pictures, decoded, strict=True):
        assert np.abs(was.astype(int) - result).mean() < 6


def test_the_command_gives_the_same_bytes_again(run: Run, tmp_path: Path) -> None:
    videos = []
    for index in range(2):
        arguments = ["video", str(run.path), "--size", "128x72", "--fps", "5"]
        output = tmp_path / str(index)
        assert evoros_analyze([*arguments, "--to", "3", "--output", str(output)]) == DONE
        videos.append((output / "video.mp4").read_bytes())
    assert videos[0] == videos[1]


def test_equal_pictures_give_equal_bytes_each_time() -> None:
    """With its macroblock tree, x264 reads memory that is not always the same."""
    tiles = np.random.default_rng(0).integers(0, 256, (15, 20, 3), np.uint8)
    picture = tiles.repeat(6, axis=0).repeat(8, axis=1)
    moving = [np.roll(picture, 3 * step, axis=1) for step in range(12)]
    assert len({encode_mp4(moving, 5.0) for _ in range(30)}) == 1


def test_another_trajectory_gives_another_video(
    pictures: list[Pixels], run: Run, urdf: str, setting: FigureContext
) -> None:
    path = run.trajectory("near")
    options = RenderOptions(size=(160, 90), fps=5.0, speed=2.0, end_s=2.0, title="near")
    path["yaw_rad"] += 0.3 * path["time_s"]
    assert encode_mp4(film(assemble(path, urdf, OPEN, setting), options), 5.0) != encode_mp4(
        pictures, 5.0
    )


def test_the_example_films_another_mission(run: Run, tmp_path: Path, monkeypatch: Patch) -> None:
    section = page("recordings").read_text().split("\n## video\n")[1]
    (block, *_) = re.findall(r"^```python\n(.*?)^```$", section, re.M | re.S)
    (tmp_path / "outputs").mkdir()
    (tmp_path / "outputs" / "mine").symlink_to(run.path)
    monkeypatch.chdir(tmp_path)
    less = block.replace("RenderOptions(", "RenderOptions(size=(64, 64), end_s=1.0, ")
    assert "evoros.replay(run.path, key)" in less
    exec(less.replace("path, key)", f"path, key, config_dir={str(USER_PARTS)!r})"), {})
    with av.open("worst.mp4") as container:
        assert container.streams.video[0].frames == 4  # 1 s of the mission in steps of 0.4 s


# What cannot be shown -----------------------------------------------------------------------


DAMAGES: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "no yaw": (lambda frame: frame.drop(columns="yaw_rad"), "yaw_rad"),
    "a gap": (lambda frame: frame.assign(x_m=frame.x_m.where(frame.index != 7)), "row 8"),
    "back in time": (
        lambda frame: frame.assign(time_s=frame.time_s.iloc[::-1].to_numpy()),
        "row 1",
    ),
    "empty": (lambda frame: frame.iloc[:0], "could not be run"),
    "an unknown mode": (lambda frame: frame.assign(mode=9), "mode"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_trajectory_is_said_in_one_line(
    damage: str, run: Run, tmp_path: Path, capsys: Capture
) -> None:
    path = run.path / "champion" / "trajectory_near.csv"
    whole = path.read_text()
    change, part = DAMAGES[damage]
    change(pd.read_csv(path)).to_csv(path, index=False)
    reseal(run.path)
    try:
        arguments = ["video", str(run.path), "--to", "0.5", "--output", str(tmp_path / "out")]
        assert evoros_analyze(arguments) == INPUT
    finally:
        path.write_text(whole)
        reseal(run.path)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert part in said
    assert "trajectory" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "part"),
    [
        (["--world", "moon"], "one of near, far"),
        (["--size", "wide"], "854x480"),
        (["--size", "641x480"], "even"),
        (["--speed", "0"], "positive number"),
        (["--from", "5", "--to", "5"], "greater than start_s"),
        (["--from", "5000"], "the end of the mission"),
        (["--run", "none"], "--run"),
    ],
)
def test_a_wrong_option_is_said_in_one_line(
    more: list[str], part: str, run: Run, tmp_path: Path, capsys: Capture
) -> None:
    arguments = ["video", str(run.path), "--output", str(tmp_path / "out"), *more]
    assert evoros_analyze(arguments) == INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert part in said


def test_without_an_encoder_one_line_says_what_to_install(
    run: Run, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    arguments = ["video", str(run.path), "--to", "0.5", "--size", "64x64"]
    assert evoros_analyze([*arguments, "--output", str(tmp_path / "mp4")]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(
        "needs the package av, which is not installed; type: pip install 'evoros[video]'"
    )
    assert not (tmp_path / "mp4").exists()


@pytest.mark.parametrize("name", [[], ["--run", "run"]])
def test_a_run_that_is_not_finished_is_said_in_one_line(
    name: list[str], run: Run, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    status = tmp_path / "run" / "status.json"
    status.write_text(status.read_text().replace('"finished"', '"stopped"'))
    reseal(tmp_path / "run")
    assert evoros_analyze(["video", str(tmp_path / "run"), *name]) == INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "resume" in said
    assert not (tmp_path / "run" / "figures" / "video.mp4").exists()


def test_another_robot_is_seen_where_it_is_and_nowhere_else(
    urdf: str, setting: FigureContext
) -> None:
    """Ahead of the robot of ``table``, and out of view behind it."""
    alone, _ = shown(urdf, setting, [4.5] * 6)
    ahead = table([4.5] * 6, [4.5] * 6).assign(x_m=2.5)
    behind = ahead.assign(x_m=-20.0)
    pictures = [
        shown(urdf, setting, [4.5] * 6, others={"other": assemble(track, urdf, OPEN, setting)})[0]
        for track in (ahead, behind)
    ]
    changed = np.abs(pictures[0].astype(int) - alone).max(axis=2) > 20
    rows, columns = np.nonzero(changed)
    assert len(rows) > 50
    assert np.ptp(columns) < SIZE[0] / 3
    assert np.array_equal(pictures[1], alone)
