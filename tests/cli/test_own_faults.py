"""A fault of a user's own part: one line names the key, the class and the method, or the place."""

import math
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.checks import SCORE, ask
from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.optimizer.protocol import AskedSearch, Individual
from evoros.terminal.console import DONE, INPUT, STOPPED

HEAD = """
import numpy as np
from evoros.allocation.once import Once
from evoros.failure.none import NoFailure
from evoros.fitness.equation_one import EquationOne
from evoros.fitness.worst_case import WorstCase
from evoros.measure.mass import Mass
from evoros.optimizer.random_search import RandomSearch


class Mine(Mass):
    of_design = False  # so that it is computed in the run


class Search:
    def __init__(self, *arguments):
        self.search = RandomSearch(2, generations=1, validation_trials=0).start(*arguments)

    def ask(self):
        return self.search.ask()

    def tell(self, scores):
        return self.search.tell(scores)

    def champions(self):
        return self.search.champions()


class By(RandomSearch):
    def start(self, *arguments):
        return Own(*arguments)

"""
RUN = ("executor=serial", "world=blocks", "failure=none", "figures=[]", "record=none")
RANDOM = ("optimizer=random_search", "optimizer.population_size=2", "optimizer.generations=1")
MEASURE = ("optimizer=nsga2", "optimizer.population_size=4", "+measure@objectives.mine=mass")
CASES = {
    "fitness.score": ("EquationOne", "self, outcomes", "None", RANDOM),
    "fitness.combine": ("WorstCase", "self, *_", "1e308", (*RANDOM, "fitness=worst_case")),
    "objectives.mine.compute": ("Mine", "self, evaluated", "np.zeros(3)", MEASURE),
    "failure.draw": ("NoFailure", "self, *_", "None", RANDOM),
    "allocation.next_round": ("Once", "self, *_", "{0: 1.5}", RANDOM),
    "optimizer.start": ("RandomSearch", "self, *_", "[]", RANDOM),
    "optimizer.ask": ("Search", "self", "self.search.ask() * 2", RANDOM),
    "optimizer.tell": ("Search", "self, scores", "[]", RANDOM),
    "optimizer.champions": ("Search", "self", "None", RANDOM),
}

UNRECORDED = {"fitness.score", "fitness.combine", "objectives.mine.compute"}
"""Methods whose results stand in no file when the first of them is wrong."""
FAULTS = {
    "1 / 0": "ZeroDivisionError: division by zero",
    "exit()": "SystemExit: ",  # would end the command with success
    "open('nowhere')": "FileNotFoundError: ",
}
"""Bodies that raise, and their messages."""


def write_part(folder: Path, case: str, body: str) -> list[str]:
    """Write a part whose method has this body; return the arguments of a run with it."""
    key, _, method = case.rpartition(".")
    base, arguments, _, overrides = CASES[case]
    module = f"own_{folder.name}"
    folder.mkdir()
    code = f"class Own({base}):\n    def {method}({arguments}):\n        {body}\n"
    (folder / f"{module}.py").write_text(HEAD + code)
    target = f"{key}._target_={module}.{'By' if base == 'Search' else 'Own'}"
    options = ["--config-dir", str(folder), f"hydra.run.dir={folder / 'run'}"]
    return [*options, *RUN, *overrides, target]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_wrong_answer_names_the_key_the_class_and_the_method(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / case.replace(".", "_")
    given = write_part(folder, case, f"return {CASES[case][2]}")
    assert evoros(given) == INPUT
    line = capsys.readouterr().err.splitlines()[-1]
    key, _, method = case.rpartition(".")
    assert f"evoros: {key}: Own.{method} must return " in line
    assert ("and type: evoros resume " in line) == (case in UNRECORDED)


@pytest.mark.slow
def test_an_exit_of_a_part_with_a_recorded_result_needs_a_new_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A worker that raises another exception is in test_cli.py."""
    folder = tmp_path / "raising"
    given = write_part(folder, "failure.draw", "return () if robot_is_tried() else exit()")
    module = folder / f"own_{folder.name}.py"
    tried = "import multiprocessing as m\nrobot_is_tried = lambda: not m.parent_process()\n"
    module.write_text(tried + module.read_text())
    assert evoros([*given, "executor=processes", "executor.workers=1"]) == STOPPED
    last = capsys.readouterr().err.splitlines()[-1]
    assert f"{module}, line " in last
    assert "in Own.draw: " in last
    assert FAULTS["exit()"] in last
    assert last.endswith("; correct the code and start a new run")


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_part_without_a_recorded_result_is_mended_and_the_proposal_resumes(
    fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / f"mended_{len(fault)}"
    given = write_part(folder, "fitness.score", fault)
    assert evoros(given) == STOPPED
    last = capsys.readouterr().err.splitlines()[-1]
    module = folder / f"own_{folder.name}.py"
    assert f"{module}, line " in last
    assert f"in Own.score: {FAULTS[fault]}" in last
    mend_and_resume(module, fault, last)


def mend_and_resume(module: Path, fault: str, told: str) -> None:
    """Type the command at the end of a line, as in a process that has not imported the module."""
    module.write_text(module.read_text().replace(fault, "return 1.0"))
    del sys.modules[module.stem]
    assert evoros(shlex.split(told.rpartition("and type: evoros ")[2])) == DONE


NOT_SCORES = (True, np.True_, np.zeros(1), np.float32("inf"), np.float16("-inf"), 10**400, "1")


@given(
    st.one_of(
        *(st.none(), st.floats(), st.lists(st.floats()), st.complex_numbers()),
        *(st.sampled_from(NOT_SCORES), st.floats(width=32).map(np.float32)),
    )
)
def test_scores_are_numbers_whose_squares_and_sums_are_finite(value: object) -> None:
    class Own:
        def score(self, _: object) -> object:
            return value

    if isinstance(value, float | np.float32) and abs(float(value)) <= 1e100:
        number = ask("fitness", Own().score, SCORE, ())
        assert math.isfinite(math.fsum([float(number) ** 2] * 1000))
        return
    with pytest.raises(InputError, match=r"^fitness: Own\.score must return a finite number"):
        ask("fitness", Own().score, SCORE, ())


@pytest.mark.parametrize("kind", [bool, complex, object])
def test_genes_of_another_kind_than_numbers_are_refused(kind: type) -> None:
    class Own:
        def ask(self) -> list[Individual]:
            return [Individual(0, np.zeros(3).astype(kind), (), "initial")]

    search: Any = Own()
    with pytest.raises(InputError, match=r"^optimizer: Own\.ask must return a list of individ"):
        AskedSearch(search, 3).ask()
