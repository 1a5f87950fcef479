"""On Pythons without PyBullet, everything works but its own simulator."""

import shlex
import sys
from pathlib import Path

import pytest
from fixture_types import Capture, Patch
from proposal_sites import is_of

from evoros.analysis.command import evoros_analyze
from evoros.cli.main import evoros
from evoros.config.compose import compose
from evoros.session.replay import replay
from evoros.simulator.engines.pybullet_model import import_pybullet
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE, INPUT

pytestmark = pytest.mark.slow

SMALL = [
    *("optimizer.population_size=3", "optimizer.generations=2", "optimizer.validation_trials=1"),
    *("world=boxes", "course.time_limit_s=20", "executor=serial"),
]


@pytest.fixture(autouse=True)
def _without_pybullet(monkeypatch: Patch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    import_pybullet.cache_clear()


def test_a_run_of_the_default_is_checked_in_physics_filmed_replayed_and_reproduced(
    tmp_path: Path, capsys: Capture
) -> None:
    run, checked = tmp_path / "run", tmp_path / "checked"
    assert evoros([*SMALL, f"hydra.run.dir={run}"]) == DONE
    (line,) = [text for text in capsys.readouterr().out.splitlines() if "check in physics" in text]
    assert is_of(line, "evoros/cli/summary.py trials=5")
    words = shlex.split(line.partition(" evoros ")[2])
    assert evoros([*words, "executor=serial", f"hydra.run.dir={checked}"]) == DONE
    (row,) = load_run(run).missions.head(1).to_dict("records")
    _, trajectory = replay(run, (row["generation"], row["design"], row["world"], row["trial"]))
    assert len(trajectory) > 10
    film = ["--to", "1", "--size", "64x64", "--output", str(tmp_path)]
    assert evoros_analyze(["video", str(run), *film]) == DONE
    assert evoros(["reproduce", str(run), "executor=serial"]) == DONE


def test_physics_confirms(tmp_path: Path) -> None:
    assert evoros([*SMALL, "confirmation=physics", f"hydra.run.dir={tmp_path / 'run'}"]) == DONE


def test_its_own_simulator_is_refused_in_one_line(tmp_path: Path, capsys: Capture) -> None:
    assert evoros(["simulator=pybullet", f"hydra.run.dir={tmp_path / 'run'}"]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    other = "evoros/simulator/engines/pybullet_model.py simulator=physics"
    assert is_of(line, other)
    compose(["simulator=physics"]).build()
    assert not (tmp_path / "run").exists()
