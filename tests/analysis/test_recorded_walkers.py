"""The player of the report shows every walker where it was in the mission."""

import json

import numpy as np
import pytest
from recorded_walkers import RADIUS_M, WORLDS, find_places, read_people

from evoros.analysis.report.playback import encode_playback
from evoros.analysis.tables.records import Record


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read_people(tmp_path_factory.mktemp("walkers"))


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
