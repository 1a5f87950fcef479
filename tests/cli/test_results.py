"""What a command says at the end of a run: tables that fit, and runs that prove nothing."""

from pathlib import Path

import pandas as pd
import pytest
from fixture_types import Folders, Log, Patch
from helpers import reseal, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.report.summary import list_findings
from evoros.analysis.tables.loading import load_study
from evoros.cli.reporting import Interrupts, explain_end
from evoros.cli.status import SHORTEST, format_folders, shorten_names
from evoros.cli.summary import summarize
from evoros.session.status import survey
from evoros.storage.doubts import list_doubts, warn_not_run
from evoros.storage.tables import to_csv
from evoros.terminal.console import DONE, INTERRUPTED

LONG = "experiment-quickstart_simulator-planar_seed-{}_population_size-4_figures_{}-db256452"


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("results") / LONG.format(0, "x" * 90)
    assert tiny(folder, "optimizer.generations=1", "optimizer.population_size=2") == DONE
    return folder


@given(st.lists(st.text("ab-_", max_size=200), max_size=6), st.integers(0, 120))
def test_names_fit_and_short_ones_stay(names: list[str], room: int) -> None:
    shown = shorten_names(names, room)
    assert all(len(name) <= max(room, SHORTEST) for name in shown)
    if all(len(name) <= room for name in names):
        assert shown == names


def test_names_that_differ_by_seed_still_differ() -> None:
    names = [LONG.format(seed, "y" * 60) for seed in range(3)]
    assert len(set(shorten_names(names, 40))) == 3


@pytest.mark.parametrize("columns", [80, 120])
def test_no_line_of_a_table_wraps_on_a_terminal(
    columns: int, run: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", str(columns))
    lines = format_folders(run.parent, [survey(run)]).splitlines()
    assert max(map(len, lines)) <= columns
    monkeypatch.setattr("sys.stdout.isatty", lambda: False, raising=False)
    assert run.name in format_folders(run.parent, [survey(run)])  # for scripts, it is whole


def test_a_run_whose_missions_all_failed_says_so_everywhere(run: Path, caplog: Log) -> None:
    assert warn_not_run(run) == ""
    assert "could be run" not in summarize(run)
    table = pd.read_csv(run / "missions.csv", dtype=str, keep_default_na=False)
    table.assign(ended="simulation_failure", reason="the robot fell").to_csv(
        run / "missions.csv", index=False
    )
    reseal(run)
    expected = f"no mission could be run ({len(table)} tried)"
    for text in (warn_not_run(run), summarize(run).splitlines()[0]):
        assert expected in text
        assert "simulation_failure: the robot fell" in text
    study = load_study([run])
    assert any(expected in message for message in caplog.messages)
    assert expected in list_findings(study)[0][0]


def write_missions(folder: Path, rows: list[dict[str, object]]) -> Path:
    (folder / "missions.csv").write_text(
        to_csv([list(rows[0]), *(list(row.values()) for row in rows)])
    )
    return folder


@given(completed=st.lists(st.booleans(), min_size=1, max_size=5))
def test_a_run_that_completes_nothing_says_so(
    completed: list[bool], tmp_path_factory: Folders
) -> None:
    ends = {True: "completed", False: "time_limit"}
    rows = [
        {"ended": ends[done], "reason": "", "completed": done, "progress": 1.0 if done else 0.25}
        for done in completed
    ]
    doubts = list_doubts(write_missions(tmp_path_factory.mktemp("run"), rows))
    if any(completed):
        assert doubts == []
    else:
        (line,) = doubts
        assert f"no mission was completed ({len(rows)} tried); the best reached 25 %" in line
        assert "raise time_limit_s of the course" in line


@pytest.mark.parametrize(("avoiding", "advised"), [(0.9, "lower the range"), (0.5, "raise time")])
def test_robots_that_only_avoid_are_not_given_more_time(
    avoiding: float, advised: str, tmp_path: Path
) -> None:
    row = {"ended": "time_limit", "reason": "", "completed": False, "progress": 0.1}
    (doubt,) = list_doubts(write_missions(tmp_path, [row | {"avoiding": avoiding}] * 4))
    assert advised in doubt


@pytest.mark.parametrize(("distance", "stands"), [(1.0, True), (50.0, False)])
def test_a_robot_that_stands_still_is_named(distance: float, stands: bool, tmp_path: Path) -> None:
    """At 1 m/s for 100 s it could drive 100 m."""
    alice = {"ended": "time_limit", "distance_m": distance, "max_speed_mps": 1.0, "time_s": 100.0}
    row = {"ended": "completed", "reason": "", "completed": True, "progress": 1.0}
    row |= {f"alice.{name}": value for name, value in alice.items()}
    doubts = list_doubts(write_missions(tmp_path, [row] * 4))
    assert [text.startswith("alice stood still") for text in doubts] == [True] * stands


def test_the_proposed_command_has_what_was_typed(tmp_path: Path) -> None:
    (tmp_path / "missions.csv").touch()
    typed = ["stop_after.missions=9"]
    result = explain_end(None, Interrupts(), tmp_path, KeyboardInterrupt(), typed)
    assert result.message.endswith(f"type: evoros resume {tmp_path} stop_after.missions=9")


def test_an_interrupt_while_figures_are_drawn_leaves_the_run_finished(run: Path) -> None:
    result = explain_end(None, Interrupts(), run, KeyboardInterrupt())
    assert result.status == INTERRUPTED
    assert "interrupted while drawing figures; the run itself is finished" in result.message
    assert "; to draw them, type: evoros" in result.message
    typed = explain_end(None, Interrupts(), run, KeyboardInterrupt(), ["stop_after.missions=9"])
    assert " stop_after.missions=9" in typed.message  # of an extension that had not begun
