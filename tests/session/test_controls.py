"""Controls of a run: other designs on the same draws as its champion, and nothing else changed."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import evoros
from evoros.analysis.figures.controls import LITTLE, compare_controls, describe_controls
from evoros.analysis.tables.loading import load_study
from evoros.base.errors import InputError
from evoros.cli.main import evoros as run_command
from evoros.session.controls import has_controls
from evoros.session.status import NoDisplay
from evoros.terminal.console import DONE, INPUT

SMALL = (
    *("experiment=quickstart", "executor=serial", "figures=[]", "record=none", "seed=3"),
    *("optimizer.population_size=4", "optimizer.generations=2", "course.time_limit_s=60"),
)
CONTROLS = ("controls=all", "controls.trials=6")


@pytest.fixture(scope="module")
def champion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run without controls."""
    folder = tmp_path_factory.mktemp("plain") / "run"
    evoros.run(SMALL, folder, display=NoDisplay())
    return folder


@pytest.fixture(scope="module")
def controlled(tmp_path_factory: pytest.TempPathFactory, champion: Path) -> Path:
    """The same run with all kinds of controls; the hand-made design equals the champion."""
    folder = tmp_path_factory.mktemp("controlled") / "run"
    own = folder.with_name("own.csv")
    shutil.copy(champion / "champion/design.csv", own)
    names = f"controls.designs=[no_sensors,random,'{own}']"
    evoros.run((*SMALL, *CONTROLS, names), folder, display=NoDisplay())
    return folder


def _missions(folder: Path) -> pd.DataFrame:
    return evoros.load_run(folder / "controls/evaluation").missions


def test_controls_change_nothing_in_the_run(champion: Path, controlled: Path) -> None:
    for name in ("champion/design.csv", "champion/certificate.json", "generations/00001.csv"):
        assert (champion / name).read_bytes() == (controlled / name).read_bytes()
    assert (champion / "missions.csv").read_bytes() == (controlled / "missions.csv").read_bytes()


def test_champion_and_controls_meet_the_same_draws(controlled: Path) -> None:
    missions = _missions(controlled)
    draws = missions.groupby(["world", "trial"])["draws"].nunique()
    assert len(draws) == missions["world"].nunique() * 6
    assert draws.eq(1).all()
    own = set(evoros.load_run(controlled).missions["draws"])
    assert own.isdisjoint(missions["draws"]), "the champion was selected on these"


def test_each_control_is_what_it_is_called(controlled: Path) -> None:
    designs = pd.read_csv(controlled / "controls/evaluation/designs_in.csv")
    sensors = designs.groupby("source")["sensor"].count()
    assert sensors["no_sensors"] == 0
    assert sensors["champion"] > 0
    searched = evoros.load_run(controlled / "controls/random").generations
    assert searched["operator"].isin(["random", "survivor"]).all()
    wanted = evoros.load_run(controlled).generations["id"].nunique()
    assert wanted <= searched["id"].nunique() < wanted + 2  # rounded up to whole generations


def test_a_control_equal_to_the_champion_shows_no_difference(controlled: Path) -> None:
    table = compare_controls(load_study([controlled])).set_index("control")
    own = next(name for name in table.index if name.endswith("own.csv 0") or "own.csv" in name)
    assert table.loc[own, "difference"] == 0.0
    assert table.loc[own, "control_fitness"] == table.loc[own, "champion_fitness"]
    assert table.loc[own, "low"] < 0 < table.loc[own, "high"]


def test_differences_are_those_of_the_missions(controlled: Path) -> None:
    table = compare_controls(load_study([controlled])).set_index("control")
    rates = _missions(controlled).groupby("source")["completed"].mean()
    difference = rates["champion"] - rates["no_sensors"]
    assert np.isclose(float(str(table.loc["no_sensors", "difference"])), difference)


@pytest.mark.slow
def test_missing_controls_are_made_by_resuming_with_the_same_bytes(
    controlled: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(controlled, folder)
    before = (folder / "controls/evaluation/missions.csv").read_bytes()
    rows = before.splitlines(keepends=True)
    (folder / "controls/evaluation/missions.csv").write_bytes(b"".join(rows[: len(rows) // 2]))
    status = folder / "controls/evaluation/status.json"
    status.unlink()
    assert not has_controls(folder)
    assert run_command(["resume", str(folder)]) == DONE
    assert (folder / "controls/evaluation/missions.csv").read_bytes() == before
    assert has_controls(folder)


def test_controls_can_be_added_to_a_finished_run(champion: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(champion, folder)
    added = ("controls=all", "controls.trials=2", "controls.designs=[no_sensors]")
    evoros.resume(folder, added, display=NoDisplay())
    assert set(_missions(folder)["source"]) == {"champion", "no_sensors"}


@pytest.mark.slow
def test_controls_of_a_smaller_search_are_refused(
    controlled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(controlled, folder)
    assert run_command(["resume", str(folder), "optimizer.generations=3"]) == INPUT
    assert f"{folder}/controls: made before the run was extended" in capsys.readouterr().err
    shutil.rmtree(folder / "controls")
    assert run_command(["resume", str(folder)]) == DONE


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("controls.trials=0",), "controls.trials: must be a positive integer, not 0"),
        (
            ("controls.designs=[]",),
            "controls.designs: must be a list of distinct entries: no_sensors, random",
        ),
        (("controls.designs=[missing.csv]",), "missing.csv: not found"),
        (("optimizer=random_search",), "random is not a control, because the run itself is"),
        (
            ("design.number=0", "optimizer=random_search"),
            "no_sensors is not a control, because the designs have no sensors",
        ),
    ],
)
def test_controls_that_mean_nothing_are_refused_before_the_run(
    overrides: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        evoros.run((*SMALL, *CONTROLS, *overrides), tmp_path / "run", display=NoDisplay())
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("champion", "high", "said"),
    [
        (1.0, 1.0 - LITTLE, "made little difference here"),
        (1.0, 1.01 - LITTLE, "no evidence that the champion is better"),
        (0.5, 1.0 - LITTLE, "no evidence that the champion is better"),  # a share of its missions
        (1.0, -0.01, "the control is better"),
        (0.0, 0.0, "the comparison is inconclusive"),
        (1.0, np.nan, "no evidence that the champion is better"),  # too few runs for an interval
    ],
)
def test_a_control_decides_little_only_if_its_interval_shows_it(
    champion: float, high: float, said: str
) -> None:
    row = {"treatment": "", "control": "random", "control_completed": champion}
    row |= {"champion_completed": champion, "low": -0.05, "high": high}
    row |= {"control_fitness": 1.0, "champion_fitness": 1.1}
    (line,) = describe_controls(pd.DataFrame([row]), "fitness")
    assert line.endswith(said)
    if champion:
        (line,) = describe_controls(pd.DataFrame([row | {"control_fitness": 1.1}]), "fitness")
        assert line.endswith("probably the champion itself")
        other = row | {"control_fitness": 1.1, "control_completed": champion / 2}
        (line,) = describe_controls(pd.DataFrame([other]), "fitness")
        assert line.endswith(said)  # other missions were completed, so it is another design
