"""Figures of a run with two robots show both, and take the first one's columns for its own."""

import json
from typing import Any

import numpy as np
import pytest
from two_robots import HOME, draw, load_two

from evoros.analysis.figures.mission import Missions, draw_missions
from evoros.analysis.report.playback import encode_playback
from evoros.analysis.tables.agents import list_robots, read_tracks, select_agent
from evoros.analysis.tables.champions import read_champion_sensors
from evoros.analysis.tables.designs import read_initial_sensors
from evoros.analysis.tables.readings import group_ranges
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.tracks import load_champion_worlds, read_track
from evoros.analysis.tables.validated import identify_champion
from evoros.base.errors import InputError
from evoros.storage.tables import AGENT


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return load_two(tmp_path_factory.mktemp("two"))


@pytest.fixture(scope="module")
def record(study: Study) -> Record:
    return study.records[0]


def test_the_tracks_are_those_that_the_trajectory_has_until_each_robot_ended(
    record: Record,
) -> None:
    for world in record.context.courses:
        flown = record.run.trajectory(world)
        for robot, prefix in zip(list_robots(record), ("", "oncoming."), strict=True):
            track = read_track(robot.run, robot.context, world)
            for column in ("x_m", "y_m", "yaw_rad", "contact"):
                expected = flown[f"{prefix}{column}"].to_numpy(float)[: len(track)]
                np.testing.assert_array_equal(track[column].to_numpy(float), expected)
        start = flown[["oncoming.x_m", "oncoming.y_m", "oncoming.yaw_rad"]].iloc[0]
        np.testing.assert_allclose(start, HOME, atol=1e-9)
    ends = record.run.missions.set_index("world")["oncoming.ended"]
    tracks = read_tracks(record, "near")
    assert list(dict.fromkeys(tracks[AGENT])) == ["", "oncoming"]
    assert tracks["ended"].iloc[-1] in set(ends["near"])


def test_each_robot_has_the_sensors_of_its_rows(record: Record) -> None:
    rows = record.run.champion
    part = {robot.agent: read_champion_sensors(robot) for robot in list_robots(record)}
    assert sum(map(len, part.values())) == len(rows) == 12
    for name, sensors in part.items():
        placed = rows[rows[AGENT].fillna("") == name]
        np.testing.assert_allclose(sensors["yaw_deg"], placed["yaw_deg"].to_numpy(float))
    assert len(group_ranges(record.run.trajectory("near"))) == 6
    champion: Any = identify_champion(record)
    assert len({robot for robot, *_ in champion[0]}) == 2


def test_the_map_has_the_path_of_each_robot_and_how_it_ended(record: Record) -> None:
    context, worlds = record.context, dict(load_champion_worlds(record.run, record.context))
    tracks = read_tracks(record, "near")
    robots = {"": context, **context.agents}
    (axes,) = draw_missions(
        Missions(tracks, {"near": worlds["near"]}, context.modes, robots=robots)
    ).axes
    other = tracks[tracks[AGENT] == "oncoming"]
    drawn = [np.asarray(line.get_xydata()) for line in axes.get_lines()]
    assert any(np.array_equal(xy, other[["x_m", "y_m"]].to_numpy()) for xy in drawn)
    assert axes.get_title().splitlines()[2].startswith("oncoming: ")
    (time,) = (text.get_text() for text in axes.texts if text.get_text().endswith(" s"))
    first = tracks[tracks[AGENT] == ""]
    both = first.merge(other, on="time_s")
    nearest = np.hypot(both["x_m_x"] - both["x_m_y"], both["y_m_x"] - both["y_m_y"]).argmin()
    assert time == f"{both['time_s'][nearest]:.0f} s"


def test_the_player_gets_the_poses_of_the_other_robot_to_the_millimetre(record: Record) -> None:
    content = json.loads(encode_playback(record))
    (agent,) = content["agents"]
    assert agent["name"] == "oncoming"
    assert agent["parts"] == content["parts"]  # a second one of the same robot
    for mission in content["missions"]:
        flown = record.run.trajectory(mission["world"])
        (other,) = mission["agents"]
        for column in ("x", "y"):
            result = np.cumsum(other[column]) / 1000
            np.testing.assert_allclose(result, flown[f"oncoming.{column}_m"], atol=0.00051)
        x0, y0, x1, y1 = mission["extent"]
        assert flown["oncoming.x_m"].between(x0, x1).all()
        assert flown["oncoming.y_m"].between(y0, y1).all()


@pytest.mark.slow
def test_figures_of_one_robot_show_the_first_one_or_the_named_one_and_say_so(
    study: Study, record: Record
) -> None:
    rows = record.run.champion
    first, other = draw(study, "overlay"), draw(study, "overlay", "--agent", "oncoming")
    alone = "the first robot alone, without oncoming; --agent NAME shows another robot"
    assert first.messages == [alone]
    assert other.messages == ["oncoming alone, without the first robot"]
    for product, name in ((first, ""), (other, "oncoming")):
        part = rows[rows[AGENT].fillna("") == name]
        table = product.tables["overlay_sensors.csv"]
        assert table["yaw_deg"].to_numpy() == pytest.approx(part["yaw_deg"].to_numpy())
        assert product.figure is not None
        title = product.figure.axes[0].get_title(loc="left")
        assert title.startswith(f"{name or 'first robot'} (1 champion)")
    regions = draw(study, "regions", "--agent", "oncoming").figure
    assert regions is not None
    assert regions.axes[0].get_title(loc="left").startswith("oncoming\n")
    with pytest.raises(
        InputError, match=r"--agent: no run has an agent 'nobody'; choose one of oncoming"
    ):
        draw(study, "panel", "--agent", "nobody")


def test_an_agent_as_a_run_of_its_own_has_its_genes_missions_and_trajectory(record: Record) -> None:
    part, whole = select_agent(record, "oncoming"), record.run
    missions, genes = part.run.missions, part.run.generations
    for column in ("ended", "progress", "draws"):
        source = column if column == "draws" else f"oncoming.{column}"
        assert missions[column].tolist() == whole.missions[source].tolist()
    placed = genes["sensor0_x_m"].tolist()
    assert placed == whole.generations["oncoming.sensor0_x_m"].tolist()
    assert placed != whole.generations["sensor0_x_m"].tolist()
    track = part.run.trajectory("near")
    assert track["x_m"].tolist() == whole.trajectory("near")["oncoming.x_m"].tolist()
    assert len(read_initial_sensors(part)) == 6 * 2
