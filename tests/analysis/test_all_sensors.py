"""Figures and the player of a design that has all types of sensors."""

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PolyCollection
from sensor_runs import BUMPERS, IMU, INFRARED, LIDAR, ODOMETRY, finish_senses

from evoros.analysis.command import evoros_analyze
from evoros.analysis.drawing.robot import Champions
from evoros.analysis.figures.mission import Missions, draw_missions
from evoros.analysis.figures.overlay import count_coverage, draw_overlay
from evoros.analysis.figures.panel import draw_panels, rank_pairs
from evoros.analysis.report.playback import encode_playback
from evoros.analysis.tables.agents import read_tracks
from evoros.analysis.tables.champions import (
    read_champion,
    read_champion_sensors,
    read_champion_signals,
)
from evoros.analysis.tables.designs import read_initial_sensors
from evoros.analysis.tables.readings import read_traces
from evoros.analysis.tables.records import Record, read_record
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.tracks import TOUCHED, load_champion_world
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read_record(finish_senses(tmp_path_factory.mktemp("all") / "run"), "run")


@pytest.fixture(scope="module")
def trajectory(record: Record) -> pd.DataFrame:
    table: pd.DataFrame = record.run.trajectory("near")
    return table


# Tables ---------------------------------------------------------------------------------------


def test_sensors_keep_their_numbers_and_pairs(record: Record) -> None:
    seeing, others = read_champion_sensors(record), read_champion_signals(record)
    assert seeing["sensor"].tolist() == [*INFRARED, LIDAR]
    assert others["sensor"].tolist() == [*BUMPERS, IMU, ODOMETRY]
    pairs = seeing["pair"].tolist()
    assert pairs[0] == pairs[1] != pairs[2]  # only placed sensors have twins
    evolved = record.run.genes.set_index("gene")["value"]
    assert seeing["range_m"].tolist() == [evolved["reach"]] * 2 + [8.0]
    assert others["width_m"].tolist() == [evolved["width"]] * 2 + [0.0, 0.0]


def test_random_designs_have_the_ranges_that_they_drew_and_the_fixed_sensors(
    record: Record,
) -> None:
    table = record.run.generations
    drawn = table[table.generation == 0].set_index("id")["reach"]
    sensors = read_initial_sensors(record)
    infrared = sensors[sensors["type"] == "infrared"]
    assert drawn.nunique() > 1
    np.testing.assert_array_equal(infrared["range_m"], drawn[infrared["design"]])
    assert (sensors[sensors["type"] == "lidar"].groupby("design")["sensor"].sum() == LIDAR).all()


# Figures --------------------------------------------------------------------------------------


def test_figures_of_designs_draw_the_place_of_each_sensor_and_the_zones_of_bumpers(
    record: Record,
) -> None:
    study = Study((record,))
    sensors, contexts = study.gather(read_champion), {record.treatment: record.context}
    cover = count_coverage(sensors, contexts, (0.5,))
    over = draw_overlay(cover, Champions(sensors, contexts, study.signals))
    single = draw_panels(rank_pairs(sensors), contexts, signals=study.signals)
    width = float(record.run.genes.set_index("gene")["value"]["width"])
    for figure in (over, single):
        hatched = [
            artist
            for artist in figure.axes[0].collections
            if isinstance(artist, PolyCollection) and artist.get_hatch()
        ]
        (zones,) = hatched
        front, left = (
            np.asarray(path.vertices)[:4] for path in zones.get_paths()
        )  # y across, x up
        assert np.ptp(front[:, 0]) == pytest.approx(width)  # faces ahead
        assert np.ptp(left[:, 1]) == pytest.approx(width)  # faces left
        assert front[:, 1].max() > 0.25 > front[:, 1].min()
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert {"bumper (zone)", "imu", "odometry", "infrared", "lidar"} <= {*texts}


def test_the_map_of_a_mission_has_the_bumpers_that_closed(
    record: Record, trajectory: pd.DataFrame
) -> None:
    table = read_tracks(record, "near")
    begins = [
        (row, sensor)
        for sensor in BUMPERS
        for row in np.flatnonzero(np.diff(trajectory[f"touch_{sensor}"], prepend=0.0) > 0).tolist()
    ]
    assert begins, "the robot met nothing, which would show little"
    told = [(row, int(n)) for row, cell in enumerate(table[TOUCHED]) for n in cell.split(";") if n]
    assert sorted(told) == sorted(begins)
    worlds = {"near": load_champion_world(record.run, record.context, "near")}
    (axes,) = draw_missions(Missions(table, worlds, record.context.modes)).axes
    (marks,) = (line for line in axes.lines if line.get_marker() == "s")
    places = table[["x_m", "y_m"]].to_numpy(float)[sorted({row for row, _ in begins})]
    np.testing.assert_array_equal(np.asarray(marks.get_xydata()), places)


def test_what_imus_odometry_and_bumpers_read_is_drawn_over_time(
    record: Record, trajectory: pd.DataFrame, tmp_path: Path
) -> None:
    worlds = {"near": load_champion_world(record.run, record.context, "near")}
    table = read_tracks(record, "near")
    traces = {"near": read_traces(record, "near")}
    map_alone = draw_missions(Missions(table, worlds, record.context.modes))
    figure = draw_missions(Missions(table, worlds, record.context.modes, traces=traces))
    assert len(map_alone.axes) == 1
    axes = {artist.get_ylabel(): artist for artist in figure.axes[1:]}
    assert list(axes) == ["closed", "rate\n[rad/s]", "acceleration\n[m/s²]", "speed\n[m/s]"]
    rates = [f"rate_z_{IMU}_radps", f"yaw_rate_{ODOMETRY}_radps"]
    for line, column in zip(axes["rate\n[rad/s]"].lines, rates, strict=False):
        np.testing.assert_array_equal(line.get_ydata(), trajectory[column].to_numpy(float))
    assert len(axes["closed"].collections) == len(BUMPERS)
    failed = {trace.label for trace in traces["near"] if math.isfinite(trace.failed_s)}
    marks = sum(line.get_marker() == "^" for artist in axes.values() for line in artist.lines)
    assert marks == len(failed)
    given = ["mission", str(record.path), "--readings", "--world", "near", "--output"]
    assert evoros_analyze([*given, str(tmp_path)]) == DONE


def test_the_page_plays_what_each_sensor_read_and_when_it_failed(
    record: Record, trajectory: pd.DataFrame
) -> None:
    content = json.loads(encode_playback(record))
    assert [artist["number"] for artist in content["sensors"]] == [*INFRARED, LIDAR]
    shown = content["signals"]
    assert [artist["number"] for artist in shown] == [*BUMPERS, IMU, ODOMETRY]
    assert [artist["touches"] for artist in shown] == [True, True, False, False]
    mission = next(artist for artist in content["missions"] if artist["world"] == "near")
    for sensor, channels in zip(shown, mission["signals"], strict=True):
        for (name, unit), differences in zip(sensor["channels"], channels, strict=True):
            column = f"{name}_{sensor['number']}" + (f"_{unit}" if unit else "")
            assert None not in differences or trajectory[column].isna().any()
            read = np.cumsum([artist or 0 for artist in differences]) / 1000
            known = np.array([artist is not None for artist in differences])
            expected = trajectory[column].to_numpy(float)[known]
            np.testing.assert_allclose(read[known], expected, atol=5.1e-4)
    (failed,) = mission["failed"]
    assert failed["sensor"] in range(7)
