"""The programs of docs/programs.md are whole, fly, and give the same bytes as each other."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from documents import DOCS, commands, text, write
from examples import composed
from helpers import with_parts

from evoros.base.arrays import Array
from evoros.base.errors import LaunchError
from evoros.controller.line_controller import Program
from evoros.evolution.experiment import Experiment
from evoros.filter.dropout import Dropout
from evoros.mission.mission import Mission, Outcome
from evoros.mission.rollout import run_mission

PAGE = text("programs")
FILES = dict(re.findall(r"^<!-- file: (\S+) -->\n```\w+\n(.*?)^```$", PAGE, re.M | re.S))
FILES |= {f"mine/{name}": (DOCS / name).read_text() for name in ("avoid.py", "avoid.c")}
COMMANDS = commands("programs")
LIMIT = "world.maze.course.time_limit_s=30"
pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module", autouse=True)
def mine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A current folder with the files of the page, compiled as it says."""
    folder = tmp_path_factory.mktemp("my programs")
    write(FILES, folder)
    (compiler,) = re.findall(r"`(cc .*?)`", PAGE)
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run([*shlex.split(compiler), *strict], cwd=folder, check=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", list(sys.path))
        yield folder


@pytest.fixture(scope="module")
def experiments(mine: Path) -> list[Experiment]:
    """The experiments of the page's commands, in one world and with an early failure."""
    more = ("world=maze", LIMIT, "failure=random", "failure.earliest_s=2", "failure.latest_s=5")
    return [next(composed(line, *more)).build() for line in COMMANDS]


def run_once(experiment: Experiment, **changes: Any) -> tuple[Outcome, Array]:
    """A mission with other values of the controller."""
    design = experiment.space.decode(np.linspace(0.1, 0.9, experiment.space.size))
    controller = replace(cast(Program, experiment.controller), **changes)
    changed = with_parts(experiment.scenario, controller=controller)
    mission = Mission(0, 0, design, "maze", 0, "evaluation", "a key of draws")
    (outcome,), track = run_mission(changed, mission)
    return outcome, track


@pytest.mark.slow
def test_the_programs_give_the_same_bytes_in_every_language(experiments: list[Experiment]) -> None:
    flown = [run_once(experiment) for experiment in experiments[:3]]
    outcome, track = flown[0]
    assert 0.0 < outcome.avoiding < 1.0
    assert outcome.visited > 0
    assert np.isnan(track[:, -6:]).any(), "a silent sensor is told"
    assert [flight.tobytes() for _, flight in flown] == [track.tobytes()] * 3


def test_a_gene_of_the_program_is_told_to_it(experiments: list[Experiment]) -> None:
    outcome, _ = run_once(experiments[3], parameters={"near_m": -1.0})
    assert outcome.avoiding > 0.0, "the gene replaces what the controller was given"
    assert run_once(experiments[0], parameters={"near_m": -1.0})[0].avoiding == 0.0


def test_a_silent_localization_is_told_as_null(experiments: list[Experiment]) -> None:
    for experiment in experiments[:2]:
        silent = {"localization": {"gone": Dropout(1.0)}, "parameters": {"near_m": 0.0}}
        outcome, track = run_once(experiment, **silent)
        assert (outcome.ended, outcome.distance_m) == ("time_limit", 0.0)
        assert set(track[:, 6]) == {0.0}


def test_the_program_in_c_refuses_a_mission_without_its_parameter(
    experiments: list[Experiment],
) -> None:
    with pytest.raises(LaunchError, match=r"avoid refuses the mission: it needs .*near_m"):
        run_once(experiments[1], parameters={})
