"""Bags, recordings and videos of a run with two robots show both."""

from pathlib import Path

import numpy as np
import pytest
from bag_readers import read_mcap
from rerun.chunk import RrdReader
from two_robots import HOME, draw, load_two

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.agents import list_robots
from evoros.analysis.tables.study import Study


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return load_two(tmp_path_factory.mktemp("two"))


def test_a_bag_has_all_robots_in_namespaces_and_frames_of_their_own(
    study: Study, tmp_path: Path
) -> None:
    """The agent drives, reads and aims as its columns do."""
    (record,) = study.records
    product = draw(study, "bag", "--world", "near")
    for name, content in product.files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    messages = read_mcap(tmp_path / "bag_near" / "bag_near.mcap")
    topics = {message.topic for message in messages}
    part = {topic.removeprefix("/oncoming") for topic in topics if topic.startswith("/oncoming/")}
    shared = {"/tf", "/tf_static", "/obstacles"}
    assert part == topics - shared - {f"/oncoming{item}" for item in part}
    flown = record.run.trajectory("near")
    moved = [m.content["transforms"][0] for m in messages if m.topic == "/tf"]
    for prefix, column in (("", "x_m"), ("oncoming/", "oncoming.x_m")):
        root = next(item["child_frame_id"] for item in moved if "/" not in item["child_frame_id"])
        path = [t for t in moved if t["child_frame_id"] == f"{prefix}{root}"]
        x = [item["transform"]["translation"]["x"] for item in path]
        assert x == flown[column].tolist()
        assert {item["header"]["frame_id"] for item in path} == {"odom"}
    (fixed,) = (m.content["transforms"] for m in messages if m.topic == "/tf_static")
    frames = {item["child_frame_id"] for item in fixed}
    assert {"sonar_0", "oncoming/sonar_0"} <= frames
    assert len(frames) == len(fixed)
    read = [m.content for m in messages if m.topic == "/oncoming/sonar_0"]
    assert {item["header"]["frame_id"] for item in read} == {"oncoming/sonar_0"}
    assert read[0]["range"] == pytest.approx(flown["oncoming.range_0_m"][0], rel=1e-6)
    (route,) = (m.content["poses"] for m in messages if m.topic == "/oncoming/route")
    end = route[-1]["pose"]["position"]
    assert (end["x"], end["y"]) == HOME[:2]
    layout = product.files["bag.foxglove.json"].decode()
    assert '"framePrefix": "oncoming/"' in layout
    assert "/oncoming/odom.twist" in layout


def test_a_recording_shows_every_robot_where_it_was(study: Study, tmp_path: Path) -> None:
    (record,) = study.records
    assert evoros_analyze(["rerun", str(record.path), "--output", str(tmp_path)]) == 0
    chunks = RrdReader(tmp_path / "rerun.rrd").stream().to_chunks()
    (world, *_) = record.context.courses
    for robot in list_robots(record):
        top = f"/{world}/agents/{robot.agent}" if robot.agent else f"/{world}"
        places = [
            place[:2]
            for chunk in chunks
            if chunk.entity_path == f"{top}/robot"
            for (place,) in chunk.to_record_batch()["Transform3D:translation"].to_pylist()
        ]
        expected = robot.run.trajectory(world)[["x_m", "y_m"]].to_numpy(float)
        np.testing.assert_allclose(sorted(places), sorted(expected.tolist()), atol=1e-5)


@pytest.mark.slow
def test_a_video_follows_the_first_robot_or_the_named_one_and_says_so(study: Study) -> None:
    options = ["--size", "128x72", "--to", "1"]
    films = [draw(study, "video", *options, *of) for of in ((), ("--agent", "oncoming"))]
    assert [film.messages[1] for film in films] == [
        "the first robot, with oncoming in view; --agent NAME shows another robot",
        "oncoming, with the first robot in view",
    ]
    assert films[0].files != films[1].files
