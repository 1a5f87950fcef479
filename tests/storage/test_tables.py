import csv
import io
import math
from dataclasses import fields, replace

import pytest
from helpers import finished_run
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from evoros.design.design import Design
from evoros.mission.mission import Mission, MissionKey, Outcome
from evoros.storage.mission_table import MissionRows, Recorded
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import (
    MISSION_COLUMNS,
    cell,
    list_further,
    mission_row,
    name_outcome_columns,
    read_key,
    read_outcomes,
    to_csv,
)

FINITE = st.floats(allow_nan=False, allow_infinity=False)
# Reasons are one line; lists of effects hold names.
LINE = st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), max_size=30)
NAME = st.from_regex(r"[a-z_]+", fullmatch=True)
KINDS: dict[object, st.SearchStrategy[object]] = {
    str: LINE,
    bool: st.booleans(),
    int: st.integers(0, 10**9),
    float: st.one_of(FINITE, st.just(math.nan)),
    tuple[float, ...]: st.lists(FINITE, max_size=4).map(tuple),
    tuple[int, ...]: st.lists(st.integers(0, 99), max_size=4).map(tuple),
    tuple[str, ...]: st.lists(NAME, max_size=4).map(tuple),
    tuple[str, ...] | None: st.lists(NAME, max_size=4).map(tuple),
    float | None: FINITE,
}
OUTCOMES = st.builds(Outcome, **{field.name: KINDS[field.type] for field in fields(Outcome)})


@given(
    st.lists(OUTCOMES, min_size=1, max_size=3),
    LINE.filter(bool),
    st.integers(0, 99),
    st.booleans(),
    st.booleans(),
)
def test_a_mission_read_back_is_the_one_that_was_written(
    outcomes: list[Outcome], world: str, generation: int, walkers: bool, shortest: bool
) -> None:
    if not walkers:
        outcomes = [replace(outcome, touched_walkers=None) for outcome in outcomes]
    outcomes = [replace(outcome, shortest_m=10.5 if shortest else None) for outcome in outcomes]
    agents = ("leader", "follower")[: len(outcomes) - 1]
    mission = Mission(generation, 7, Design(()), world, 2, "selection", f"0/{world}")
    further = list_further(True, walkers, shortest)
    header = [*MISSION_COLUMNS, *name_outcome_columns(agents, further)]
    written = to_csv([header, mission_row(mission, tuple(outcomes), further=further)])
    assert written.count("\n") == 2
    (row,) = csv.DictReader(io.StringIO(written, newline=""))
    place, back = read_key(row), read_outcomes(row, agents)
    assert (place, row["draws"]) == (mission.key, mission.draws)
    # repr: it tells NaN from a number, -0.0 from 0.0, and a tuple from its items
    assert repr(back) == repr(tuple(outcomes))


@given(FINITE)
def test_numbers_are_written_in_full(value: float) -> None:
    assert float(cell(value)) == value


KEYS = st.tuples(st.integers(0, 4), st.integers(0, 3), st.sampled_from("ab"), st.integers(0, 1))
BLANK = Outcome.failure("lost", "", 1.0, 0)


@given(st.lists(KEYS, unique=True), st.lists(KEYS), st.data())
def test_every_mission_is_found_again_in_any_order(
    keys: list[MissionKey], asked: list[MissionKey], data: st.DataObject
) -> None:
    table: list[Recorded] = [
        (key, f"draws {i}", (replace(BLANK, visited=i),)) for i, key in enumerate(keys)
    ]
    reads: list[int] = []

    def read(place: int) -> Recorded:
        reads.append(place)
        return table[place]

    rows = MissionRows(read)
    known = data.draw(st.integers(0, len(keys)))
    for place, key in enumerate(keys[:known]):
        rows.note(key, place)
    for place in range(known, len(keys)):
        rows.find(data.draw(KEYS))  # another generation may be in use while one is added
        rows.add([table[place]], [place])
    assert len(rows) == len(keys)
    assert rows.worlds == {world for _, _, world, _ in keys}
    for key in [*keys, *asked]:
        wanted = [row[1:] for row in table if row[0] == key]
        assert rows.find(key) == (wanted[0] if wanted else None)
        reads.clear()
        rows.find(key)  # again: its generation is in memory
        assert not reads


MIXED = [
    "+sensor@design.sensors.other=sonar",
    "+filter@design.sensors.other.filters.dumb=silence",
    "design.number=6",
    "design.mirrored=false",
    "failure.count=2",
]


@pytest.fixture(scope="module", params=range(3))
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return load_run(
        finished_run(tmp_path_factory.mktemp("run") / "run", *MIXED, f"seed={request.param}")
    )


def test_each_sensor_of_the_table_is_a_link_of_the_robot_at_its_pose(run: Run) -> None:
    robot = etree.parse(run.path / "champion" / "robot.urdf").getroot()
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    assert set(run.champion["type"]) == {"sonar", "other"}  # else nothing is told apart
    for row in run.champion.itertuples():
        joint = joints[f"{row.type}_{row.sensor}_joint"]
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        assert parent is not None and child is not None and origin is not None  # noqa: PT018
        assert (parent.get("link"), child.get("link")) == (row.link, f"{row.type}_{row.sensor}")
        xyz = [float(word) for word in str(origin.get("xyz")).split()]
        rpy = [math.degrees(float(word)) for word in str(origin.get("rpy")).split()]
        assert xyz == [row.x_m, row.y_m, row.z_m]
        assert rpy == pytest.approx([0, -float(str(row.pitch_deg)), float(str(row.yaw_deg))])


def test_each_trajectory_and_mission_numbers_the_sensors_alike(run: Run) -> None:
    mine = run.missions[run.missions["design"] == run.champion["design"][0]]
    faults = 0
    for mission in mine[mine["purpose"] == "selection"].itertuples():
        ranges = run.trajectory(str(mission.world)).filter(regex="^range_")
        failed = [int(i) for i in str(mission.failed_sensors).split(";") if i.isdigit()]
        for kind, sensor in zip(run.champion["type"], run.champion["sensor"], strict=True):
            silent = ranges[f"range_{sensor}_m"].isna()
            assert silent.all() == (kind == "other")
            if kind == "sonar":
                assert silent.iloc[-1] == (sensor in failed)
                faults += sensor in failed
    assert faults
