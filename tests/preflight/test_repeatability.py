"""A live controller that does not do the same twice is reported before the run."""

import logging
from pathlib import Path

import numpy as np
import pytest
from helpers import with_parts
from hypothesis import given
from hypothesis import strategies as st

from evoros import compose
from evoros.base.arrays import Array
from evoros.controller.line_controller import Program
from evoros.executor.serial import Serial
from evoros.mission.mission import TRAJECTORY
from evoros.preflight.own_code import find_difference, report_repeatability

PROGRAM = """
import json, os, sys
source, answers = open(int(os.environ["EVOROS_IN"])), open(int(os.environ["EVOROS_OUT"]), "w")
source.readline()
print('{"ready": true}', file=answers, flush=True)
once = os.path.exists(sys.argv[1])
open(sys.argv[1], "w").close()
for line in source:
    time = json.loads(line)[0]
    print(json.dumps([1, 0.2, 0.1 if once and time >= 2.0 else 0.0]), file=answers, flush=True)
"""


@pytest.mark.parametrize("repeatable", [True, False])
def test_the_first_tick_that_differs_is_named(
    repeatable: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    mark = tmp_path / "mark"
    if repeatable:
        mark.touch()
    command = ["/usr/bin/env", "python3", str(tmp_path / "program.py"), str(mark)]
    experiment = compose(
        ["simulator=planar", "world=boxes", "world.boxes.course.time_limit_s=4"]
    ).build()
    scenario = with_parts(experiment.scenario, controller=Program(command=command))
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    mission = experiment.plan.selection(0, 0, design)[0]
    with caplog.at_level(logging.WARNING), Serial().open() as pool:
        report_repeatability(scenario, mission, pool)
    (*lines,) = (record.getMessage() for record in caplog.records)
    if repeatable:
        assert lines == []
    else:
        # The command of 2 s has turned the front wheels, and it is recorded in that decision's row.
        (line,) = lines
        assert "runs differ from tick 20 on, at 2 s (steering_rad" in line


COLUMNS = [*TRAJECTORY, "range_0_m", "range_1_m"]


@given(st.integers(1, 20), st.integers(0, 19), st.integers(0, len(TRAJECTORY) - 1))
def test_the_row_and_the_column_of_a_change_are_found(rows: int, row: int, column: int) -> None:
    row = row % rows
    first: Array = np.random.default_rng(rows).normal(size=(rows, len(TRAJECTORY) + 2))
    first[:, -1] = np.nan  # a silent sensor does not differ from itself
    second = first.copy()
    assert find_difference(first, second, COLUMNS) == ""
    second[row:, column] += 1.0
    difference = find_difference(first, second, COLUMNS)
    assert f"from tick {row} on" in difference
    assert f"({TRAJECTORY[column]} " in difference


def test_a_trajectory_that_ends_earlier_differs() -> None:
    first = np.zeros((5, len(TRAJECTORY)))
    assert "from tick 3 on, because they end at" in find_difference(first, first[:3], TRAJECTORY)
