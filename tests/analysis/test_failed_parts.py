"""Faults of other parts than sensors in runs, figures, the player and videos."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fixture_types import Capture, Folders
from helpers import USER_PARTS, finished_run
from matplotlib.figure import Figure

from evoros import load_run, replay
from evoros.analysis.drawing.faults import draw_faults, make_fault_handles
from evoros.analysis.report.playback import _encode_part_faults
from evoros.analysis.tables.tracks import has_failed, list_part_failures, read_track
from evoros.certificate.certificate import Certificate, Rate
from evoros.certificate.validation import Validation
from evoros.cli.replay import replay as replay_command
from evoros.evolution.loop import _rate_parts
from evoros.mission.mission import Outcome
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run
from evoros.terminal.console import DONE

UNTIMED = ("~failure.earliest_s", "~failure.latest_s")  # keys of the tiny experiment's failure
FAULTY = (
    *UNTIMED,
    "failure=localization",
    "failure/onset=course",
    "failure.onset.earliest=0.01",
    "failure.onset.latest=0.02",
    "optimizer.generations=2",
    "record=all",
)
TRACK = pd.DataFrame(
    {
        "time_s": [0.0, 0.1, 0.2, 0.3],
        "x_m": [0.0, 1.0, 2.0, 3.0],
        "y_m": [0.0, 0.0, 1.0, 1.0],
        "failed_sensors": "",
        "failed_by": "",
        "failed_parts": ["", "steering;battery", "", "drive"],
        "parts_failed_by": ["", "stuck;constant", "", "constant"],
    }
)
ROW = pd.Series(
    {
        "failed_parts": "steering;battery",
        "parts_failed_at_s": "0.05;0.2",
        "parts_failed_by": "stuck;constant",
    }
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Run:
    return load_run(finished_run(tmp_path_factory.mktemp("parts") / "run", *FAULTY))


def test_every_mission_tells_which_part_failed_when(run: Run) -> None:
    for row in run.missions.itertuples():
        at_s: Any = row.parts_failed_at_s
        assert (row.failed_parts, row.parts_failed_by) == ("localization", "posejump")
        key: Any = (row.generation, row.design, row.world, row.trial)
        track = run.mission_trajectory(*key)
        x, y = (track[f"estimated_{name}_m"] - track[f"{name}_m"] for name in "xy")
        failed = track["time_s"] >= float(at_s) - 1e-9
        jump = np.hypot(x, y)[:-1]
        np.testing.assert_allclose(jump, np.where(failed, 1.0, 0.0)[:-1], atol=1e-9)


def test_a_mission_with_a_failed_part_is_replayed_and_named(run: Run, capsys: Capture) -> None:
    row = run.missions.iloc[0]
    key = int(row.generation), int(row.design), str(row.world), int(row.trial)
    (outcome,), track = replay(run.path, key, config_dir=USER_PARTS)
    assert outcome.parts_failed_at_s == (float(row.parts_failed_at_s),)
    pd.testing.assert_frame_equal(track, run.mission_trajectory(*key), check_dtype=False)
    names = ("generation", "design", "world", "trial")
    columns = [f"{name}={value}" for name, value in zip(names, key, strict=True)]
    assert replay_command([str(run.path), *columns, "--config-dir", str(USER_PARTS)]) == DONE
    printed = capsys.readouterr().out.split()
    assert printed[printed.index("failed_parts") + 1] == "localization"


def test_the_manifest_tells_whether_parts_can_fail(run: Run, tmp_path: Path) -> None:
    assert "failed_parts" in run.manifest["columns"]
    assert has_failed(run.missions).all()
    intact = load_run(
        finished_run(tmp_path / "run", *UNTIMED, "failure=none", "optimizer.generations=1")
    )
    assert "failed_parts" not in intact.manifest["columns"]
    assert "failed_parts" not in intact.missions
    assert not has_failed(intact.missions).any()


def test_a_track_has_the_part_where_it_failed(run: Run) -> None:
    context = FigureContext.read(run.path)
    world = next(iter(context.courses))
    track = read_track(run, context, world)
    (row,) = np.flatnonzero(track["failed_parts"] != "")
    (failure,) = list_part_failures(run.missions.iloc[0])
    assert track["parts_failed_by"][row] == failure[2] == "posejump"
    assert context.failure.effects["posejump"] == "alters"


def test_the_map_names_each_part_at_its_place() -> None:
    axes = Figure().subplots()
    axes.set(xlim=(0.0, 4.0))
    draw_faults(axes, TRACK, {})
    named = {(text.get_text(), text.xy) for text in axes.texts}  # type: ignore[attr-defined]
    assert named == {("steering", (1.0, 0.0)), ("battery", (1.0, 0.0)), ("drive", (3.0, 1.0))}
    labels = [str(handle.get_label()) for handle in make_fault_handles(TRACK, {})]
    assert labels == ["steering fails: stuck", "battery, drive fails: constant"]


def test_the_player_names_parts() -> None:
    encoded = list(_encode_part_faults(ROW, TRACK, {"stuck": "ends", "constant": "ends"}))
    assert [(fault["part"], fault["x"], fault["y"]) for fault in encoded] == [
        ("steering", 1.0, 0.0),
        ("battery", 2.0, 1.0),
    ]
    assert list(_encode_part_faults(pd.Series(dtype=object), TRACK, {})) == []


def test_a_certificate_rates_the_missions_in_which_a_part_failed() -> None:
    blank = Outcome.failure("time_limit", "", 60.0, 3)
    failed = {"failed_parts": ("steering",), "parts_failed_by": ("stuck",)}
    outcomes = [blank, replace(blank, **failed), replace(blank, completed=True, **failed)]  # type: ignore[arg-type]
    ((name, rate),) = _rate_parts(Validation(), outcomes).items()
    assert (name, rate.completed, rate.trials) == ("steering: stuck", 1, 2)
    fields: Any = (1, 0.0, 1, 0.0, 1, 0.95, 0.0, 1.0, None, None, {}, [], 0.0, [])
    certificate = Certificate(*fields)
    assert "failed_parts" not in certificate.text
    assert name in replace(certificate, failed_parts={name: Rate(1, 2, 0.1, 0.9)}).text
