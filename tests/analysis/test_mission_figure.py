"""The picture of a mission shows the rows of its table, where and when they were."""

import argparse
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import finished_run, reseal, vary
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from evoros.analysis.drawing.faults import draw_direction, split_by_mode
from evoros.analysis.drawing.mission_map import measure_drift
from evoros.analysis.figures.mission import Missions, draw_missions, make_product
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.tracks import find_champion_mission, load_champion_worlds, read_track
from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run, load_run
from evoros.world.model import World

MODES = ("avoiding", "navigating")
TABLE = pd.DataFrame(
    {
        "world": "near",
        "time_s": [0.0, 0.1, 0.2, 0.3, 0.4, 0.5],
        "x_m": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        "y_m": [0.0, 0.0, 1.0, 1.0, 0.0, 0.0],
        "yaw_rad": 0.0,
        "mode": ["navigating", "navigating", "avoiding", "none", "navigating", "navigating"],
        "contact": [0, 0, 1, 1, 0, 1],
        "failed_sensors": ["", "3", "", "", "0;2", ""],
        "failed_by": ["", "silence", "", "", "silence;stuck", ""],
        "ended": ["", "", "", "", "", "collision"],
    }
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("mission") / "run"
    return load_run(finished_run(folder, "failure.latest_s=3.0"))


@pytest.fixture(scope="module")
def setting(run: Run) -> FigureContext:
    return FigureContext.read(run.path)


@pytest.fixture(scope="module")
def worlds(run: Run, setting: FigureContext) -> dict[str, World]:
    return dict(load_champion_worlds(run, setting))


def panel(worlds: dict[str, World], table: pd.DataFrame = TABLE) -> Axes:
    axes: Axes
    (axes,) = draw_missions(Missions(table, {"near": worlds["near"]}, MODES)).axes
    return axes


def marked(axes: Axes, label: str) -> list[tuple[float, float]]:
    (line,) = (line for line in axes.get_lines() if line.get_label() == label)
    return [(float(x), float(y)) for x, y in np.asarray(line.get_xydata())]


def driven(axes: Axes) -> dict[str, list[np.ndarray]]:
    """The pieces of the path, by mode."""
    drawn_lines = (item for item in axes.collections if isinstance(item, LineCollection))
    return {
        str(item.get_label()): [np.asarray(part) for part in item.get_segments()]
        for item in drawn_lines
    }


def test_from_a_record_on_the_path_has_the_mode_that_was_decided_there(
    worlds: dict[str, World],
) -> None:
    drawn = {
        name: [part.tolist() for part in parts] for name, parts in driven(panel(worlds)).items()
    }
    assert drawn == {
        "navigating": [[[0, 0], [1, 0], [2, 1]], [[4, 0], [5, 0]]],
        "avoiding": [[[2, 1], [3, 1]]],
        "none": [[[3, 1], [4, 0]]],
    }


def test_the_pieces_are_the_whole_path_one_after_another(run: Run, setting: FigureContext) -> None:
    path = read_track(run, setting, "near")
    pieces = list(split_by_mode(path))
    whole = np.concatenate([pieces[0][1][:1], *(piece[1:] for _, piece in pieces)])
    np.testing.assert_array_equal(whole, path[["x_m", "y_m"]].to_numpy())
    modes = [mode for mode, piece in pieces for _ in piece[1:]]
    assert modes == path["mode"].tolist()[:-1]
    assert all(one[0] != next_[0] for one, next_ in pairwise(pieces))


def test_a_collision_is_where_a_contact_begins(worlds: dict[str, World]) -> None:
    assert marked(panel(worlds), "collision") == [(2.0, 1.0), (5.0, 0.0)]


def test_failures_are_marked_with_the_numbers_of_their_sensors(worlds: dict[str, World]) -> None:
    axes = panel(worlds)
    assert marked(axes, "sensor fails: silence") == [(1.0, 0.0), (4.0, 0.0)]
    assert marked(axes, "sensor fails: stuck") == [(4.0, 0.0)]
    notes = [text.get_text() for text in axes.texts if isinstance(text, Annotation)]
    assert [note for note in notes if note] == ["3", "0", "2"]


def test_a_fault_is_drawn_as_what_it_does_to_readings(
    worlds: dict[str, World], setting: FigureContext
) -> None:
    """A fault that grows has a band along the path that widens; a sudden one has none."""
    effects = {"silence": "ends", "stuck": "grows"}
    context = replace(setting, failure=replace(setting.failure, effects=effects))
    near = {"near": worlds["near"]}
    (axes,) = draw_missions(Missions(TABLE, near, MODES, robots={"": context})).axes
    assert marked(axes, "error starts: stuck") == [(4.0, 0.0)]
    lines = [item for item in axes.collections if isinstance(item, LineCollection)]
    (band,) = (item for item in lines if item.get_alpha())
    assert [part.tolist() for part in band.get_segments()] == [[[4.0, 0.0], [5.0, 0.0]]]
    legend = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert {"error grows", "sensor fails: silence"} <= set(legend)


def test_the_title_says_how_the_mission_ended(worlds: dict[str, World]) -> None:
    def title(ended: str) -> str:
        return panel(worlds, TABLE.assign(ended=ended)).get_title()

    assert title("collision") == "near\ncollision at 0 s"
    assert title("time_limit") == "near\ntime limit, 0 s"
    assert title("simulation_failure") == "near\nsimulation failure"
    assert panel(worlds, TABLE[:0]).get_title() == "near\nnot run"


def test_phases_and_the_end_are_told_apart(worlds: dict[str, World]) -> None:
    """The way back is dashed and has arrows of its own, and both meet where the robot is home."""
    long = TABLE.assign(x_m=8.0 * TABLE["x_m"], mode="navigating", phase=[1, 1, 1, 2, 2, 2])
    axes = panel(worlds, long)
    assert marked(axes, "end") == [(40.0, 0.0)]
    first, second = (item for item in axes.collections if isinstance(item, LineCollection))
    assert first.get_linestyle() != second.get_linestyle()
    ends = [np.concatenate(item.get_segments())[[0, -1]].tolist() for item in (first, second)]
    assert ends == [[[0.0, 0.0], [24.0, 1.0]], [[24.0, 1.0], [40.0, 0.0]]]
    arrows = (line for line in axes.lines if isinstance(line.get_marker(), tuple))
    heads = {str(line.get_markerfacecolor()) for line in arrows}
    assert heads == {"black", "white"}
    numbers = {text.get_text() for text in axes.texts if not isinstance(text, Annotation)}
    assert numbers == {str(n + 1) for n in range(len(worlds["near"].course.waypoints))}


def test_a_track_is_the_recorded_trajectory(run: Run, setting: FigureContext) -> None:
    for world in setting.courses:
        path, recorded = read_track(run, setting, world), run.trajectory(world)
        columns = ["time_s", "x_m", "y_m", "yaw_rad", "contact"]
        np.testing.assert_array_equal(path[columns].to_numpy(), recorded[columns].to_numpy())
        names = np.array(["none", *setting.modes])[recorded["mode"]]
        assert path["mode"].tolist() == names.tolist()
        assert path["ended"].tolist()[:-1] == [""] * (len(path) - 1)


def test_sensors_fail_in_the_track_when_they_failed_in_the_mission(
    run: Run, setting: FigureContext
) -> None:
    """By the readings: a silent sensor has none from that record on, and has them before."""
    result = 0
    for world in setting.courses:
        path, recorded = read_track(run, setting, world), run.trajectory(world)
        mission_row = find_champion_mission(run, world)
        for row in np.flatnonzero(path["failed_sensors"] != ""):
            sensor = path["failed_sensors"][row]
            assert (
                path["time_s"][row - 1] < float(mission_row["failed_at_s"]) <= path["time_s"][row]
            )
            readings = recorded[f"range_{sensor}_m"]
            assert readings[:row].notna().all()
            assert readings[row + 1 :].isna().all()
            result += 1
    assert result == len(setting.courses)  # one in each, before the mission was over


def test_the_mission_is_the_champions_first(run: Run, setting: FigureContext) -> None:
    for world in setting.courses:
        row, path = find_champion_mission(run, world), read_track(run, setting, world)
        assert row["design"] == run.champion["design"].iloc[0]
        assert (row["purpose"], int(row["trial"])) == ("selection", 0)
        assert path["time_s"].iloc[-1] == row["time_s"]
        assert path["ended"].iloc[-1] == row["ended"]


def test_with_a_confirmation_it_is_the_confirmed_one(run: Run) -> None:
    again = run.missions[run.missions["purpose"] == "selection"].assign(purpose="confirmation")
    both = Run(run.path)
    both.__dict__["missions"] = pd.concat([again.assign(trial=7), run.missions])
    chosen = find_champion_mission(both, "near")
    assert (chosen["purpose"], int(chosen["trial"])) == ("confirmation", 7)


def test_a_mode_that_the_setting_does_not_know_is_one_line(
    run: Run, setting: FigureContext
) -> None:
    odd = Run(run.path)
    odd.__dict__["missions"] = run.missions
    fewer = FigureContext(**{**vars(setting), "modes": ()})
    with pytest.raises(InputError, match=r"trajectory_near.csv: mode must be from 0 to 0"):
        read_track(odd, fewer, "near")


def test_a_lost_world_is_one_line(run: Run, setting: FigureContext, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"world_near.sdf: not found"):
        load_champion_worlds(Run(tmp_path), setting)


def test_the_best_run_is_drawn_by_itself_and_any_other_by_its_name(run: Run) -> None:
    study = load_study([run.path])
    assert study.ranked[0].path == run.path
    assert study.find("run").path == run.path


def test_a_damaged_world_is_left_out_and_a_damaged_run_makes_room_for_the_next(
    run: Run, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for seed, name in enumerate(("one", "two")):
        vary(run.path, tmp_path / name, {"seed": seed})
    options = argparse.Namespace(run=None, world=None, columns=None)
    (tmp_path / "one" / "champion" / "world_near.sdf").write_text("<sdf")
    reseal(tmp_path / "one")
    made = make_product(load_study([tmp_path]), options)
    assert made.table is not None
    assert set(made.table["world"]) == {"far"}
    (tmp_path / "one" / "champion" / "trajectory_far.csv").unlink()
    made = make_product(load_study([tmp_path]), options)
    assert made.messages[0].startswith("two: one of 2 runs, fitness ")
    assert len(made.figure.axes if made.figure else []) == 2
    # One world, then both of them, and so the run.
    assert [message.count("is left out") for message in caplog.messages] == [1, 1, 1, 0]
    assert (
        f"{tmp_path / 'one'}: no complete mission of the champion was found" in caplog.messages[-1]
    )
    (tmp_path / "two" / "champion" / "design.csv").write_text("design,sensor\n")
    reseal(tmp_path / "two")
    with pytest.raises(InputError, match="no run has a champion that can be shown"):
        make_product(load_study([tmp_path]), options)


def test_an_estimated_pose_has_its_path_and_its_errors(worlds: dict[str, World]) -> None:
    """Each record but the last: 1 m aside, and 90 deg to the right of the heading."""
    table = TABLE.assign(
        estimated_x_m=TABLE["x_m"],
        estimated_y_m=TABLE["y_m"] + 1.0,
        estimated_yaw_rad=-0.5 * np.pi + 4.0 * np.pi,
    )
    way, place, heading = measure_drift(table)
    assert np.allclose(way, np.cumsum([0.0, 1.0, np.sqrt(2.0), 1.0, np.sqrt(2.0)]))
    assert np.allclose(place, 1.0)
    assert np.allclose(heading, 90.0)
    above, below, right = draw_missions(Missions(table, {"near": worlds["near"]}, MODES)).axes
    assert [(x, y + 1.0) for x, y in zip(TABLE["x_m"], TABLE["y_m"], strict=True)] in [
        [(float(x), float(y)) for x, y in np.asarray(line.get_xydata())]
        for line in above.get_lines()
    ]
    for axes, drawn in ((below, place), (right, heading)):
        (line,) = axes.get_lines()
        assert np.allclose(np.asarray(line.get_xydata()), np.column_stack((way, drawn)))
        assert axes.get_ylim()[0] == 0.0
    assert below.get_ylabel() == "position error [m]"


def test_the_arrowheads_of_a_robot_that_circles_do_not_hide_its_path() -> None:
    turns = np.linspace(0.0, 60 * np.pi, 3000)
    path = pd.DataFrame({"x_m": 0.5 * np.cos(turns), "y_m": 0.5 * np.sin(turns)})
    axes = Figure().add_subplot()
    draw_direction(axes, path, 1)
    places = np.array([np.asarray(line.get_xydata())[0] for line in axes.lines])
    assert 0 < len(places) < 6
