"""Bags show every walker where it was in the mission."""

import pandas as pd
import pytest
from bag_readers import ReadMessage, read_mcap
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_walkers import HEIGHT_M, RADIUS_M, WORLDS, find_places, read_people

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.readings import list_walkers
from evoros.analysis.tables.records import Record
from evoros.plugins.recordings.bags.messages import CYLINDER, mark_walker
from evoros.terminal.console import DONE


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read_people(tmp_path_factory.mktemp("walkers"))


@pytest.fixture(scope="module")
def bags(record: Record, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[ReadMessage]]:
    output = tmp_path_factory.mktemp("bags")
    for world in WORLDS:
        given = ["bag", str(record.path), "--world", world, "--format", "mcap"]
        assert evoros_analyze([*given, "--output", str(output)]) == DONE
    return {world: read_mcap(output / f"bag_{world}" / f"bag_{world}.mcap") for world in WORLDS}


@pytest.mark.parametrize("world", WORLDS)
def test_the_bag_has_each_walker_at_each_record(
    record: Record, bags: dict[str, list[ReadMessage]], world: str
) -> None:
    flown = record.run.trajectory(world)
    messages = [message for message in bags[world] if message.topic == "/walkers"]
    odometry = [message.stamp for message in bags[world] if message.topic == "/odom"]
    assert [message.stamp for message in messages] == odometry
    assert len(messages) == len(flown)
    places = find_places(flown)
    for index, message in enumerate(messages):
        markers = {marker["ns"]: marker for marker in message.content["markers"]}
        assert list(markers) == list(places)
        for name, marker in markers.items():
            at = marker["pose"]["position"]
            assert [at["x"], at["y"]] == places[name][index].tolist()
            assert marker["header"]["frame_id"] == "odom"


@settings(max_examples=20)
@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)), max_size=4))
def test_a_marker_stands_on_the_ground_where_the_walker_is(
    places: list[tuple[float, float]],
) -> None:
    table = {"time_s": [0.0]}
    for index, (x, y) in enumerate(places):
        at = f"walkers.people_{index}"
        table |= {f"{at}.x_m": [x], f"{at}.y_m": [y], f"{at}.touched_by": [0.0]}
    size = {"walkers.people.radius_m": RADIUS_M, "walkers.people.height_m": HEIGHT_M}
    markers = [mark_walker(track, 0) for track in list_walkers(pd.DataFrame(table), size)]
    assert [marker["ns"] for marker in markers] == [f"people_{i}" for i in range(len(places))]
    for (x, y), marker in zip(places, markers, strict=True):
        assert marker["type"] == CYLINDER
        assert marker["pose"]["position"] == {"x": x, "y": y, "z": HEIGHT_M / 2}
        assert marker["scale"] == {"x": 2 * RADIUS_M, "y": 2 * RADIUS_M, "z": HEIGHT_M}
