"""The page of a report plays the records of the run, to the millimetre."""

import json
import math
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.report.playback import (
    MAX_RECORDS,
    encode_changes,
    encode_differences,
    encode_playback,
    select_playbacks,
    thin_out,
)
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study

Json = dict[str, Any]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Two runs of one treatment, in which a sensor fails, and one of another."""
    folder = tmp_path_factory.mktemp("sweep")
    for failure, seed in (("random", 0), ("random", 1), ("spatial", 0)):
        assert tiny(folder / f"{failure}_{seed}", f"failure={failure}", f"seed={seed}") == 0
    return load_study([folder])


def summed(differences: list[int | None]) -> list[float]:
    """The sums of the page: [m], [s] or [rad] from the differences of their thousandths."""
    totals = list(accumulate(mission or 0 for mission in differences))
    return [
        math.nan if mission is None else total / 1000
        for mission, total in zip(differences, totals, strict=True)
    ]


def filled(pairs: list[list[Any]], n: int) -> list[int]:
    values = [0] * n
    for first, value in pairs:
        values[first:] = [value] * (n - first)
    return values


@pytest.fixture(scope="module")
def missions(study: Study) -> dict[str, Json]:
    """The missions of the first run, by world."""
    content: Json = json.loads(encode_playback(study.records[0]))
    return {mission["world"]: mission for mission in content["missions"]}


@given(st.lists(st.none() | st.integers(-(10**7), 10**7)))
def test_the_sums_of_the_differences_are_the_values(values: list[int | None]) -> None:
    result = summed(encode_differences(values))
    expected = [math.nan if value is None else value / 1000 for value in values]
    np.testing.assert_array_equal(result, expected)


@given(st.lists(st.integers(0, 3), min_size=1))
def test_the_changes_give_every_value_and_no_two_are_alike(values: list[int]) -> None:
    result = encode_changes(values)
    assert filled(result, len(values)) == values
    assert all(a[1] != b[1] for a, b in pairwise(result))


@pytest.mark.slow
@pytest.mark.parametrize("world", ["near", "far"])
def test_every_record_is_in_it_to_the_millimetre(
    study: Study, missions: dict[str, Json], world: str
) -> None:
    flown, mission = study.records[0].run.trajectory(world), missions[world]
    n = len(flown)
    time = summed([*filled(mission["time"], n)])
    for column, result in (
        ("time_s", time),
        ("x_m", summed(mission["x"])),
        ("y_m", summed(mission["y"])),
    ):
        np.testing.assert_allclose(result, flown[column], atol=0.00051)
    turned = np.array(summed(mission["yaw"])) - flown["yaw_rad"].to_numpy()
    np.testing.assert_allclose(np.angle(np.exp(1j * turned)), 0.0, atol=0.00051)
    assert filled(mission["mode"], n) == flown["mode"].tolist()
    assert filled(mission["contact"], n) == flown["contact"].tolist()
    for sensor, readings in enumerate(mission["readings"]):
        np.testing.assert_allclose(summed(readings), flown[f"range_{sensor}_m"], atol=0.00051)


def test_failures_are_those_of_the_champions_mission_and_silent_from_then_on(
    study: Study, missions: dict[str, Json]
) -> None:
    record = study.records[0]
    champion = int(record.run.champion["design"].iloc[0])
    table = record.run.missions
    row = table[
        (table["design"] == champion)
        & (table["world"] == "far")
        & (table["purpose"] == "selection")
    ].iloc[0]
    mission = missions["far"]
    (failed,) = mission["failed"]
    assert failed == {
        "sensor": int(row["failed_sensors"]),
        "at_s": round(float(row["failed_at_s"]), 3),
        "by": "silence",
        "kind": "ends",
        "grown_s": 0.0,
    }
    silent = record.run.trajectory("far")[f"range_{failed['sensor']}_m"].isna()
    readings = np.array(summed(mission["readings"][failed["sensor"]]))
    assert np.isnan(readings).tolist() == silent.tolist()
    assert silent.any()


def test_a_waypoint_is_reached_where_the_count_of_them_grows(
    study: Study, missions: dict[str, Json]
) -> None:
    record = study.records[0]
    flown, mission = record.run.trajectory("near"), missions["near"]
    grows = flown["visited"].diff().fillna(flown["visited"]) > 0
    assert [at for at, _ in mission["reached"]] == pytest.approx(flown["time_s"][grows].tolist())
    course = record.context.courses["near"]
    places = flown.loc[grows, ["x_m", "y_m"]].to_numpy()
    for (_, corner), here in zip(mission["reached"], places, strict=True):
        goal = course.waypoints[corner] if corner >= 0 else course.home[:2]
        assert math.dist(here, goal) <= course.acceptance_m + 0.1


@given(st.integers(1, 50_000))
def test_of_a_long_mission_evenly_many_records_stay_with_both_ends(records: int) -> None:
    rows = thin_out(records)
    assert len(rows) == min(records, MAX_RECORDS)
    assert (rows[0], rows[-1]) == (0, records - 1)
    steps = np.diff(rows)
    assert steps.size == 0 or steps.max() - steps.min() <= 1


@pytest.mark.slow
def test_the_best_of_each_treatment_is_always_played_and_others_as_far_as_they_fit(
    study: Study,
) -> None:
    def best(treatment: str) -> str:
        part = [record for record in study.records if record.treatment == treatment]
        fitness = [float(record.run.status["best_validated_fitness"]) for record in part]
        return str(part[fitness.index(max(fitness))].name)

    least = select_playbacks(study, 0.0, {})
    assert list(least) == [best("random"), best("spatial")]
    size = sum(map(len, least.values()))
    (other,) = {record.name for record in study.records} - set(least)
    more = len(encode_playback(study.find(other)))
    assert list(select_playbacks(study, size + more - 1, {})) == list(least)
    assert list(select_playbacks(study, size + more, {})) == [*least, other]


def test_what_cannot_be_played_is_said_and_left_out(
    study: Study, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for record in study.records:
        for file in record.path.rglob("*"):
            if file.is_file() and file.parent.name != "figures":
                copied = tmp_path / record.name / file.relative_to(record.path)
                copied.parent.mkdir(parents=True, exist_ok=True)
                copied.write_bytes(file.read_bytes())
    (tmp_path / "spatial_0" / "champion" / "world_far.sdf").write_text("no world")
    result = select_playbacks(load_study([tmp_path]), 1e9, {})
    assert set(result) == {"random_0", "random_1"}
    (line,) = caplog.messages
    assert "spatial_0/champion/world_far.sdf" in line
    assert line.endswith("; left out")
    assert "\n" not in line


def test_nothing_in_it_ends_the_element_that_holds_it(study: Study) -> None:
    record = study.records[0]
    named = Record("</script><!--", record.run, record.context, record.values)
    text = encode_playback(named)
    assert "<" not in text
    assert json.loads(text)["run"] == "</script><!--"
