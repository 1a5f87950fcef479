"""An evaluation that goes on to more trials is one that had them from the start."""

import json
import shlex
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from fixture_types import Capture, Folders, Patch
from helpers import TINY, everything, refused, resume
from proposal_sites import is_of

from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.config.recorded import read_recorded
from evoros.session.diff import diff_runs
from evoros.storage.digests import DigestLog
from evoros.storage.mission_table import open_locked
from evoros.storage.run_folder import RunFolder
from evoros.terminal.console import DONE, INPUT, INTERRUPTED, NOT_DECIDED

TWO = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\nb,0,0.1,0,-60\n"
CLOSE = "+requirements.close={of: progress, at_least: 0.5, confidence: 0.999}"
EASY = "+requirements.easy={of: time_s, at_least: 0, share: 0.8}"
MEASURED = (
    "+measure@requirements.near.of=worst_failure",
    "+requirements.near.at_least=1",
    "+requirements.near.bounds=[0,20]",
)
SEARCH = (
    "worst_cases=search",
    "worst_cases.most=1",
    "worst_cases.times_s=[0.0]",
    "worst_cases.trials=2",
    "worst_cases.screening=1",
    "~world.far",
)
TEAM = (
    "agents=oncoming",
    "simulator=planar",
    "world=blocks",
    "+design@agents.oncoming.design=six_sonars",
    "agents.oncoming.design.number=0",
    "agents.oncoming.scored=false",
)
CONFIGURATIONS: dict[str, Sequence[str]] = {
    "all trajectories": ("record=all",),
    "decided early": (EASY, CLOSE),
    "all cases": ("failure=exhaustive", "~failure.earliest_s", "~failure.latest_s"),
    "worst failures, required": (*SEARCH, "+requirements.one={survives: 1}", CLOSE),
    "two robots": (*TEAM, CLOSE),
}
NAME = "an evaluation"
"""Of all folders, because the page of requirements tells it."""
QUICK = ("all trajectories",)
MANY = {"decided early": (12, 25), "worst failures, required": (2, 4)}
"""Trials before and after, if not four and nine."""
VARYING = ("evoros.log", "status.json", "manifest.json", "config.yaml", "digests.csv")


def scored(folder: Path, trials: int, *more: str) -> int:
    file = folder.parents[1] / "two.csv"
    file.write_text(TWO)
    places = ("executor=serial", f"hydra.run.dir={folder}", f"designs={file}")
    return evaluate([*TINY, *places, *more, f"trials={trials}"])


def compared(folder: Path) -> dict[str, bytes]:
    """All files but for the log, and those that tell of this process, the time and the command."""
    return {name: text for name, text in everything(folder).items() if name not in VARYING}


def described(folder: Path) -> dict[str, object]:
    """Return the fields of the status that tell of the evaluation alone."""
    status = json.loads((folder / "status.json").read_text())
    passing = ("digest", "updated", "session_missions", "session_simulated_s", "session_wall_s")
    return {name: value for name, value in status.items() if name not in passing}


def require_equal(one: Path, other: Path) -> None:
    assert list(compared(one)) == list(compared(other))
    assert compared(one) == compared(other)
    assert described(one) == described(other)
    assert "trials is" in diff_runs(one, other).difference  # their configurations


@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in CONFIGURATIONS
    ],
)
def test_more_trials_are_those_of_an_evaluation_that_had_them_from_the_start(
    name: str, tmp_path: Path
) -> None:
    few, many = tmp_path / "a few" / NAME, tmp_path / "many" / NAME
    first, last = MANY.get(name, (4, 9))
    ends = scored(few, first, *CONFIGURATIONS[name]), scored(many, last, *CONFIGURATIONS[name])
    assert INPUT not in ends
    assert compared(few) != compared(many)
    assert resume(few, f"trials={last}") == ends[1]
    require_equal(few, many)
    assert resume(few) == ends[1]  # and nothing is left to do
    require_equal(few, many)


def validated(folder: Path, trials: int) -> int:
    """Evaluate under the draws of a validation, of which a run has two trials by itself."""
    draws = ("evaluation_draws=validation", "optimizer.validation_trials=2", CLOSE)
    file = folder.parents[1] / "two.csv"
    file.write_text(TWO)
    places = ("executor=serial", f"hydra.run.dir={folder}", f"designs={file}")
    return evaluate([*TINY, *places, *draws, f"validation.trials={trials}"])


@pytest.mark.slow
def test_the_draws_of_a_validation_go_on(tmp_path: Path, capsys: Capture) -> None:
    few, many = tmp_path / "a few" / NAME, tmp_path / "many" / NAME
    assert validated(few, 3) == NOT_DECIDED
    (line,) = [text for text in capsys.readouterr().out.splitlines() if "to decide" in text]
    assert " validation.trials=" in line or "will probably not be enough" in line
    assert "and a larger validation.trials; to" in refused(lambda: resume(few, "trials=9"), capsys)
    assert "evaluation with validation.trials=999 validation.max_trials=999" in refused(
        lambda: resume(few, "validation.trials=999"), capsys
    )
    assert validated(many, 7) == NOT_DECIDED
    assert resume(few, "validation.trials=7") == NOT_DECIDED
    require_equal(few, many)


# ---- kills and refusals


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: Folders) -> tuple[Path, Path]:
    """An undecided evaluation of 4 trials, and one of 9."""
    folder = tmp_path_factory.mktemp("evaluated")
    assert scored(folder / "few" / NAME, 4, CLOSE) == NOT_DECIDED
    assert scored(folder / "many" / NAME, 9, CLOSE) == NOT_DECIDED
    return folder / "few" / NAME, folder / "many" / NAME


@pytest.fixture
def few(evaluated: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(evaluated[0], tmp_path / NAME))


@pytest.mark.parametrize(
    "after", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 4, 5))]
)
def test_a_kill_while_the_folder_changes_loses_nothing(
    after: int, few: Path, evaluated: tuple[Path, Path], monkeypatch: Patch
) -> None:
    """The kill comes after so many of the steps that change the folder before the first mission."""
    steps = [0]

    def count(real: Callable[..., object]) -> Callable[..., object]:
        def step(*args: object, **options: object) -> object:
            if steps[0] == after:
                raise KeyboardInterrupt
            steps[0] += 1
            return real(*args, **options)

        return step

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", count(Path.unlink))
        patch.setattr(DigestLog, "reopen", count(DigestLog.reopen))
        patch.setattr(RunFolder, "append", count(RunFolder.append))
        assert resume(few, "trials=9") == INTERRUPTED
    assert steps[0] == after
    assert resume(few, "trials=9") == NOT_DECIDED
    require_equal(few, evaluated[1])


def test_an_extension_that_was_killed_goes_on_to_its_trials(
    few: Path, evaluated: tuple[Path, Path], monkeypatch: Patch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(RunFolder, "append", stop)
        assert resume(few, "trials=9") == INTERRUPTED
    assert resume(few) == NOT_DECIDED
    require_equal(few, evaluated[1])


def test_missions_that_were_lost_by_a_kill_run_again(
    few: Path, evaluated: tuple[Path, Path]
) -> None:
    """An evaluation that was killed is extended at once, and killed again as it goes on."""
    rows = (few / "missions.csv").read_bytes().splitlines(keepends=True)
    for name in ("designs.csv", "requirements.csv", "status.json"):
        (few / name).unlink()
    (few / "missions.csv").write_bytes(b"".join([*rows[:5], rows[5][:-9]]))
    assert resume(few, "trials=8") == NOT_DECIDED
    assert resume(few, "trials=9") == NOT_DECIDED
    shutil.rmtree(few / "damaged")  # the digests tell that the table was whole once
    require_equal(few, evaluated[1])


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("trials=3", "trials: must be an integer >= 4 (the run already"),
        ("trials=many", "trials: must be an integer >= 4"),
        ("seed=1", "seed=1: resume accepts only executor, executor.* and a larger trials; to"),
        ("optimizer.generations=9", "optimizer.generations=9: resume accepts only executor"),
        ("+trials=9", "+trials=9: resume accepts only executor"),
    ],
)
def test_other_changes_are_refused(typed: str, said: str, few: Path, capsys: Capture) -> None:
    before = everything(few)
    assert said in refused(lambda: resume(few, typed), capsys)
    assert everything(few) == before


def test_an_evaluation_that_goes_on_elsewhere_is_not_extended(few: Path, capsys: Capture) -> None:
    before = everything(few)
    with open_locked(few / "missions.csv"):
        error = refused(lambda: resume(few, "trials=9"), capsys)
    assert "another process is running in this folder" in error
    assert everything(few) == before


@pytest.mark.slow
def test_the_executor_of_the_extension_is_not_recorded(few: Path) -> None:
    assert resume(few, "trials=5", "executor=processes", "executor.workers=1") == NOT_DECIDED
    values = read_recorded(few / "config.yaml").values
    assert values["trials"] == 4
    assert json.loads((few / "status.json").read_text())["trials"] == 5
    assert values["executor"]["_target_"].endswith("Serial")


def test_what_is_undecided_says_what_to_type(few: Path, capsys: Capture) -> None:
    """The printed command, as a shell reads it, has more trials, which decide."""
    assert resume(few) == NOT_DECIDED
    (line,) = [
        line for line in capsys.readouterr().out.splitlines() if line.startswith("to decide ")
    ]
    assert is_of(line, "evoros/cli/summary.py {growing}={max(numbers)}")
    command, verb, folder, *options = shlex.split(line.removeprefix("to decide "))
    assert (command, verb, Path(folder)) == ("evoros", "resume", few)
    assert evoros([verb, folder, *options]) == DONE
    assert "to decide" not in capsys.readouterr().out
