"""simulator=physics takes an engine that is installed, and a run stays with the one it took."""

import json
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from helpers import everything, resume, tiny

from evoros.base.errors import InputError
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.physics import physics
from evoros.simulator.pybullet import PyBullet
from evoros.terminal.console import DONE, INPUT


def without(*missing: str) -> Callable[[str], object]:
    """Python's search for modules, on a machine that lacks some."""
    return lambda name: None if name in missing else find_spec(name)


def hide(patch: pytest.MonkeyPatch, *missing: str) -> None:
    for module in ("physics", "mujoco", "pybullet"):
        patch.setattr(f"evoros.simulator.{module}.find_spec", without(*missing))


def test_mujoco_comes_first_and_pybullet_stands_in(monkeypatch: pytest.MonkeyPatch) -> None:
    assert physics(0.02, 0.8, 0.1) == Mujoco(0.02, 0.8, 0.1)
    hide(monkeypatch, "mujoco")
    stand_in = PyBullet(time_step=0.02, wheel_friction=0.8, steering_lag_s=0.1)
    assert physics(0.02, 0.8, 0.1) == stand_in
    hide(monkeypatch, "mujoco", "pybullet")
    with pytest.raises(InputError, match=r"simulator=mujoco: .*`pip install mujoco-core`"):
        physics()


def test_a_run_records_its_engine_and_is_not_resumed_with_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    assert tiny(run, "simulator=physics", "executor=serial", "optimizer.generations=1") == DONE
    recorded = json.loads((run / "manifest.json").read_text())
    assert recorded["simulators"] == ["evoros.simulator.mujoco.Mujoco"]
    assert recorded["packages"]["mujoco-core"]
    before = everything(run)
    capsys.readouterr()
    hide(monkeypatch, "mujoco")
    assert resume(run) == INPUT
    assert "simulators must be as it was when the run began" in capsys.readouterr().err
    assert everything(run) == before
