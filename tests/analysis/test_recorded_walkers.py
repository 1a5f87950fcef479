"""The player of the report shows every walker where it was in the mission."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers import finished_run
from recorded_walkers import PEOPLE, RADIUS_M, WORLDS, find_places

from evoros.analysis.report.playback import encode_playback
from evoros.analysis.tables.records import Record, read_record


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("walkers") / "run", *PEOPLE)


@pytest.fixture(scope="module")
def record(run: Path) -> Record:
    return read_record(run, "run")


@pytest.mark.parametrize("world", WORLDS)
def test_the_player_has_each_walker_at_each_record_to_the_millimetre(
    record: Record, world: str
) -> None:
    content = json.loads(encode_playback(record))
    (mission,) = (each for each in content["missions"] if each["world"] == world)
    places = find_places(record.run.trajectory(world))
    assert places
    assert [walker["name"] for walker in mission["walkers"]] == list(places)
    for walker in mission["walkers"]:
        shown = np.cumsum([walker["x"], walker["y"]], axis=1).T / 1000
        np.testing.assert_allclose(shown, places[walker["name"]], atol=0.00051)
        assert walker["radius"] == RADIUS_M
        low, high = np.array(mission["extent"]).reshape(2, 2)
        assert (low <= shown).all()
        assert (shown <= high).all()
