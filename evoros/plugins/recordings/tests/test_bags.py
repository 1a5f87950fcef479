"""Bags contain what was recorded, as others read them: Debian's rosbag and MCAP's libraries."""

import csv
import json
import math
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from bag_readers import ReadMessage, channels, read_mcap, read_rosbag
from helpers import copied, everything, reseal, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.records import Record, read_record
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.plugins.recordings.bags.bag import GOALS
from evoros.plugins.recordings.bags.messages import (
    START_NS,
    TOPICS,
    Message,
    list_messages,
    list_topics,
)
from evoros.plugins.recordings.missions import RecordedMission, read_champion_mission
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE, INPUT

GOAL = GOALS["mcap"]
LATCHED = {topic.name for topic in TOPICS if topic.latched} | {GOAL}
ACKERMANN_MD5 = "1fd5d7f58889cefd44d29f6653240d0c"  # of ackermann_msgs 1.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags") / "run"
    assert tiny(folder, "failure.latest_s=3.0", "optimizer.generations=1") == DONE
    return folder


@pytest.fixture(scope="module")
def record(run: Path) -> Record:
    return read_record(run, "run")


@pytest.fixture(scope="module")
def mission(record: Record) -> RecordedMission:
    return read_champion_mission(record, "near")


@pytest.fixture(scope="module")
def folder(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bags of both formats, with their layouts."""
    output = tmp_path_factory.mktemp("written")
    for kind in ("ros1", "mcap"):
        given = ["bag", str(run), "--world", "near", "--format", kind, "--output", str(output)]
        assert evoros_analyze(given) == DONE
    return output


@pytest.fixture(scope="module")
def mcap(folder: Path) -> list[ReadMessage]:
    return read_mcap(folder / "bag_near" / "bag_near.mcap")


def rows(run: Path) -> list[dict[str, float]]:
    with (run / "champion" / "trajectory_near.csv").open() as file:
        return [
            {name: float(cell) if cell else math.nan for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]


def single(value: float) -> float:
    """The value in a message with 32 bits."""
    return float(np.float32(value))


def on(topic: str, messages: Sequence[ReadMessage]) -> list[dict[str, Any]]:
    return [message.content for message in messages if message.topic == topic]


def stamps(topic: str, messages: Sequence[ReadMessage]) -> list[int]:
    return [message.stamp for message in messages if message.topic == topic]


def stamp(content: Mapping[str, Any]) -> int:
    time = content["header"]["stamp"]
    return int(time["sec"]) * 10**9 + int(time["nanosec"])


# What is in a bag ----------------------------------------------------------------------------


def test_messages_equal_the_trajectory(run: Path, mcap: list[ReadMessage]) -> None:
    recorded = rows(run)
    times = [10**9 + round(row["time_s"] * 1e9) for row in recorded]
    assert stamps("/odom", mcap) == stamps("/tf", mcap) == stamps("/contact", mcap) == times
    assert stamps("/mode", mcap) == stamps("/ackermann_cmd", mcap) == times[:-1]
    odometry, frames = on("/odom", mcap), on("/tf", mcap)
    for row, odom, tf in zip(recorded, odometry, frames, strict=True):
        half = row["yaw_rad"] / 2
        place = {"x": row["x_m"], "y": row["y_m"], "z": 0.0}
        turn = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
        assert odom["pose"]["pose"]["position"] == place
        assert odom["pose"]["pose"]["orientation"] == pytest.approx(turn, rel=1e-15, abs=0.0)
        assert odom["twist"]["twist"]["linear"]["x"] == row["speed_mps"]
        (transform,) = tf["transforms"]
        assert transform["transform"]["translation"] == place
        assert transform["transform"]["rotation"] == odom["pose"]["pose"]["orientation"]
        assert (transform["child_frame_id"], odom["child_frame_id"]) == ("base_link",) * 2
    names = ["none", *json.loads((run / "setting.json").read_text())["modes"]]
    decided = zip(recorded[:-1], on("/mode", mcap), on("/ackermann_cmd", mcap), strict=True)
    for row, mode, command in decided:
        assert mode["data"] == names[int(row["mode"])]
        assert command["drive"]["steering_angle"] == single(row["steering_rad"])
        assert command["drive"]["speed"] == single(row["speed_mps"])
    assert [c["data"] for c in on("/contact", mcap)] == [row["contact"] > 0 for row in recorded]
    (described,) = on("/robot_description", mcap)
    assert described["data"] == (run / "champion" / "robot.urdf").read_text()


def test_a_range_message_for_each_reading_that_is_not_silent(
    run: Path, mcap: list[ReadMessage]
) -> None:
    *sampled, _ = rows(run)  # at the end no sensor is sampled
    silent = 0
    for sensor in range(6):
        readings = [row[f"range_{sensor}_m"] for row in sampled]
        expected = [single(reading) for reading in readings if not math.isnan(reading)]
        silent += len(readings) - len(expected)
        messages = on(f"/sonar_{sensor}", mcap)
        assert [message["range"] for message in messages] == expected
        for message in messages:
            assert message["header"]["frame_id"] == f"sonar_{sensor}"
            limits = (message["min_range"], message["max_range"], message["field_of_view"])
            assert limits == (single(0.06), single(4.5), single(math.radians(30.0)))
    assert silent, "no sensor failed in the mission, which would show little"


def test_stamps_begin_at_a_second_and_do_not_decrease(mcap: list[ReadMessage]) -> None:
    times = [message.stamp for message in mcap]
    assert times[0] == START_NS == 10**9
    assert times == sorted(times)
    stamped = [message for message in mcap if "header" in message.content]
    assert stamped
    assert all(stamp(message.content) == message.stamp for message in stamped)
    assert {message.topic for message in mcap if message.stamp == times[0]} >= LATCHED


def test_frames_lead_from_odom_to_each_sensor(run: Path, mcap: list[ReadMessage]) -> None:
    (static,), moving = on("/tf_static", mcap), on("/tf", mcap)[0]
    frames: dict[str, tuple[str, Pose]] = {}
    for frame in (*static["transforms"], *moving["transforms"]):
        place, turn = frame["transform"]["translation"], frame["transform"]["rotation"]
        pose = Pose(tuple(place.values()), tuple(turn.values()))
        frames[frame["child_frame_id"]] = (frame["header"]["frame_id"], pose)
    design = load_run(run).champion
    for mount in design.to_dict("records"):
        parent, pose = frames[f"sonar_{mount['sensor']}"]
        assert parent == mount["link"]
        assert pose.position == pytest.approx([mount[name] for name in ("x_m", "y_m", "z_m")])
        pitch, yaw = math.radians(mount["pitch_deg"]), math.radians(mount["yaw_deg"])
        level = math.cos(pitch)
        beam = [level * math.cos(yaw), level * math.sin(yaw), math.sin(pitch)]
        assert pose.rotation[:, 0] == pytest.approx(beam)
        while parent != "odom":
            parent, _ = frames[parent]
    links = re.findall(r'<link name="(\w+)"', (run / "champion" / "robot.urdf").read_text())
    assert set(frames) == set(links)


def test_goals_are_the_waypoints_in_the_order_of_the_mission(
    run: Path, mcap: list[ReadMessage]
) -> None:
    (route,) = on("/route", mcap)
    places = [tuple(pose["pose"]["position"].values())[:2] for pose in route["poses"]]
    goals = [tuple(goal["pose"]["position"].values())[:2] for goal in on(GOAL, mcap)]
    home = json.loads((run / "setting.json").read_text())["courses"]["near"]
    before = [(home["home_x_m"], home["home_y_m"]), *places]
    for (x, y), (to_x, to_y), pose in zip(before, places, route["poses"], strict=False):
        turn = pose["pose"]["orientation"]
        ahead = 2 * math.atan2(turn["z"], turn["w"])
        assert math.cos(ahead - math.atan2(to_y - y, to_x - x)) == pytest.approx(1.0)
    recorded = rows(run)
    assert goals == places[: len(goals)]
    assert len(goals) == min(len(places), 1 + int(recorded[-1]["visited"]))
    # A waypoint counts within its acceptance, so the direction of the route is the one flown.
    for row, after in pairwise(recorded):
        if after["visited"] > row["visited"] and after["visited"] < len(places):
            goal = goals[int(row["visited"])]
            assert math.dist(goal, (after["x_m"], after["y_m"])) <= 1.0


def test_obstacles_are_markers_of_their_shape_and_place(mission: RecordedMission) -> None:
    turned = Pose.from_rpy((1.0, 2.0, 0.25), 0.0, 0.0, 0.5)
    corners = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    shapes = (
        Shape("box", (0.3, 0.4, 0.5)),
        Shape("cylinder", (0.2, 0.7)),
        Shape("sphere", (0.3,)),
        Shape("convex", (), Pose(), corners),
    )
    bodies = (*mission.world.bodies, Body("solids", turned, shapes))
    changed = replace(mission, world=replace(mission.world, bodies=bodies))
    (content,) = (m.content for m in list_messages(changed, "/goal") if m.topic == "/obstacles")
    part = [marker for marker in content["markers"] if marker["ns"] == "solids"]
    assert [marker["type"] for marker in part] == [1, 3, 2, 11]
    sizes = [list(marker["scale"].values()) for marker in part]
    assert sizes == [[0.3, 0.4, 0.5], [0.4, 0.4, 0.7], [0.6, 0.6, 0.6], [1.0, 1.0, 1.0]]
    assert {tuple(point.values()) for point in part[3]["points"]} == set(corners)
    assert len(part[3]["points"]) == 3 * 4
    for marker in part:
        assert marker["header"]["frame_id"] == "odom"
        assert tuple(marker["pose"]["position"].values()) == pytest.approx((1.0, 2.0, 0.25))
    others = {marker["ns"] for marker in content["markers"]} - {"solids"}
    assert others == {body.name for body in mission.world.obstacles}


def test_a_root_link_above_the_ground_is_where_it_was(
    run: Path, record: Record, mission: RecordedMission, tmp_path: Path
) -> None:
    """Trajectories are of the frame on the ground that engines add; they also replace meshes."""
    folder = copied(run, tmp_path / "run")
    urdf = (folder / "champion" / "robot.urdf").read_text()
    ground = (
        '<link name="evoros_ground"/><joint name="g" type="fixed"><parent link="evoros_ground"/>'
        '<child link="base_link"/><origin xyz="0 -0.5 0.1"/></joint></robot>'
    )
    mesh = '<collision><geometry><mesh filename="no.stl"/></geometry></collision>'
    described = urdf.replace('<link name="base_link">', f'<link name="base_link">{mesh}')
    assert described != urdf
    (folder / "champion" / "robot.urdf").write_text(described)
    loaded = folder / "champion" / "robot_as_loaded.urdf"
    loaded.write_text(urdf.replace("</robot>", ground))
    reseal(folder)
    raised = read_champion_mission(read_record(folder, "run"), "near")
    on_ground, above = (
        [
            m.content["pose"]["pose"]["position"]
            for m in list_messages(frame, "/goal")
            if m.topic == "/odom"
        ]
        for frame in (mission, raised)
    )
    yaws = mission.trajectory["yaw_rad"]
    for low, high, yaw in zip(on_ground, above, yaws, strict=True):
        moved = (low["x"] + 0.5 * math.sin(yaw), low["y"] - 0.5 * math.cos(yaw), 0.1)
        assert tuple(high.values()) == pytest.approx(moved)


@given(
    sense=st.integers(1, 12),
    record=st.integers(1, 12),
    end=st.integers(1, 60),
    silent=st.sets(st.integers(0, 60)),
)
def test_a_sensor_of_any_period_has_each_recorded_reading_once_at_its_time(
    mission: RecordedMission, sense: int, record: int, end: int, silent: set[int]
) -> None:
    """A loop in which each reading is the time of its sampling; some fall between two records."""
    tick, reading = 0.05, math.nan
    ticks, readings = [], []
    expected: dict[int, None] = {}
    for now in range(end + 1):
        if now % sense == 0 and now < end:
            reading = math.nan if now in silent else now * tick
        if now % record == 0 or now == end:
            ticks.append(now)
            readings.append(reading)
            sampled = (min(now, end - 1) // sense) * sense
            if sampled not in silent:
                expected[sampled] = None
    columns = {name: 0.0 for name in mission.trajectory if not str(name).startswith("range_")}
    table = pd.DataFrame({**columns, "time_s": np.array(ticks) * tick})
    sensor, *_ = mission.sensors
    part = replace(sensor.kind, period_s=sense * tick)
    one = replace(sensor, kind=part, readings=np.array(readings)[:, None])
    flown = replace(mission, trajectory=table, sensors=[one])
    topic = f"/{sensor.link}"
    messages: list[Message] = [m for m in list_messages(flown, "/goal") if m.topic == topic]
    assert [m.stamp_ns for m in messages] == [10**9 + round(t * tick * 1e9) for t in expected]
    assert [m.content["range"] for m in messages] == [t * tick for t in expected]


# The files ------------------------------------------------------------------------------------


@pytest.mark.ros(1)
def test_debians_rosbag_reads_the_same_messages(folder: Path, mcap: list[ReadMessage]) -> None:
    messages, connections = read_rosbag(folder / "bag_near.bag")
    lacking = {"variance", "texture_resource", "texture", "uv_coordinates", "mesh_file"}

    def common(message: ReadMessage) -> ReadMessage:
        """Without the fields that ROS 1 does not have."""
        content = {k: v for k, v in message.content.items() if k not in lacking}
        if message.topic == "/obstacles":
            markers = [{k: m[k] for k in m if k not in lacking} for m in content["markers"]]
            content = {"markers": markers}
        topic = GOAL if message.topic == GOALS["ros1"] else message.topic
        return message._replace(topic=topic, content=content)

    order = [(message.stamp, message.topic) for message in messages]
    assert [stamp for stamp, _ in order] == sorted(stamp for stamp, _ in order)

    def by_topic(frame: Sequence[ReadMessage]) -> list[ReadMessage]:
        return sorted(map(common, frame), key=lambda message: (message.topic, message.stamp))

    assert by_topic(messages) == by_topic(mcap)
    latched = {topic for topic, _, _, latching in connections if latching}
    assert latched == {*LATCHED, GOALS["ros1"]} - {GOAL}
    hashes = {kind: md5 for _, kind, md5, _ in connections}
    assert hashes["ackermann_msgs/AckermannDriveStamped"] == ACKERMANN_MD5


def test_rosbag2_metadata_counts_the_messages_and_keeps_latched_topics(
    folder: Path, mcap: list[ReadMessage]
) -> None:
    metadata = yaml.safe_load((folder / "bag_near" / "metadata.yaml").read_text())
    bag = metadata["rosbag2_bagfile_information"]
    assert bag["relative_file_paths"] == ["bag_near.mcap"]
    assert (bag["storage_identifier"], bag["message_count"]) == ("mcap", len(mcap))
    topics = {frame["topic_metadata"]["name"]: frame for frame in bag["topics_with_message_count"]}
    counts = {name: frame["message_count"] for name, frame in topics.items()}
    assert {k: v for k, v in counts.items() if v} == Counter(message.topic for message in mcap)
    transient_local, reliable = 1, 1
    for name, frame in topics.items():
        (quality,) = yaml.safe_load(frame["topic_metadata"]["offered_qos_profiles"])
        assert (quality["durability"] == transient_local) == (name in LATCHED), name
        assert quality["reliability"] == reliable


def test_the_layout_shows_topics_of_the_bag(folder: Path, mission: RecordedMission) -> None:
    layout = json.loads((folder / "bag.foxglove.json").read_text())
    bag = channels(folder / "bag_near" / "bag_near.mcap")
    assert bag == {topic.name for topic in list_topics(mission, GOAL)}
    panels = layout["configById"]
    named = set(re.findall(r'"(/\w+)[."]', json.dumps(panels)))
    assert named <= bag
    assert {f"/sonar_{sensor}" for sensor in range(6)} < named
    assert {"/obstacles", "/robot_description", "/route", GOAL, "/mode", "/odom"} < named
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout["layout"]))
    assert Counter(placed) == dict.fromkeys(panels, 1)
    scene = next(config for panel, config in panels.items() if panel.startswith("3D!"))
    assert scene["followTf"] == "base_link"
    assert {layer["frameId"] for layer in scene["layers"].values()} == {"odom"}


def test_the_same_run_gives_the_same_bytes(run: Path, folder: Path, tmp_path: Path) -> None:
    for kind in ("ros1", "mcap"):
        given = ["bag", str(run), "--world", "near", "--format", kind, "--output", str(tmp_path)]
        assert evoros_analyze(given) == DONE
    assert everything(tmp_path) == everything(folder)


def test_humble_gets_its_own_messages(run: Path, tmp_path: Path) -> None:
    """Its range has no variance; a node of humble could not read it otherwise."""
    given = ["bag", str(run), "--world", "near", "--distro", "humble", "--output", str(tmp_path)]
    assert evoros_analyze(given) == DONE
    (first, *_) = on("/sonar_5", read_mcap(tmp_path / "bag_near" / "bag_near.mcap"))
    assert "variance" not in first


# Bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--format", "ros1", "--distro", "humble"), "--distro: applies only to --format mcap"),
        (("--world", "moon"), "--world: must be one of near, far, not 'moon'"),
    ],
)
def test_options_that_do_not_fit(
    given: Sequence[str], said: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert evoros_analyze(["bag", str(run), *given]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_without_rosbags_one_line_says_what_to_install(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "evoros.plugins.recordings.bags.writing", raising=False)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    assert evoros_analyze(["bag", str(run)]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("pip install 'evoros[bags]'")


def test_a_mission_that_could_not_be_run_is_left_out_in_one_line(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    trajectory = folder / "champion" / "trajectory_far.csv"
    trajectory.write_text(trajectory.read_text().splitlines(keepends=True)[0])
    reseal(folder)
    assert evoros_analyze(["bag", str(folder), "--output", str(tmp_path / "out")]) == DONE
    (line,) = capsys.readouterr().err.splitlines()
    assert "trajectory_far.csv: no rows" in line
    assert line.endswith("left out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"bag_near", "bag.foxglove.json"}
