import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import USER_PARTS

from evoros.base.errors import InputError
from evoros.config.compose import build, compose, own_folder, read, to_text
from evoros.evolution.dispatch import Dispatcher


def test_what_a_run_keeps_composes_to_the_same_experiment(tmp_path: Path) -> None:
    config = compose(["experiment=as_run", "failure=spatial", "seed=4"])
    (tmp_path / "config.yaml").write_text(to_text(config))
    again = read(tmp_path / "config.yaml")
    assert to_text(again) == to_text(config)
    assert build(again).design == build(config).design


def test_references_are_kept_and_not_their_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EVOROS_SECRET", "0.297531")
    config = compose(["+robot.arguments.front_axle_x=${oc.env:EVOROS_SECRET}"])
    assert "97531" not in to_text(config)
    assert "0.297531" in build(config).robot.urdf


def test_composing_twice_is_composing_once() -> None:
    assert to_text(compose(["seed=1"])) == to_text(compose(["seed=1"]))
    assert compose().seed == 0


def test_an_experiment_changes_any_key_and_the_command_line_has_the_last_word() -> None:
    config = compose(["experiment=tiny"], USER_PARTS)
    assert config.figures == [] != compose().figures
    assert compose(["experiment=tiny", "figures=[fitness]"], USER_PARTS).figures == ["fitness"]
    assert compose(["experiment=dense"]).trials == 2


def test_a_folder_of_the_users_adds_groups_and_modules() -> None:
    assert build(compose(["experiment=tiny"], USER_PARTS)).simulator.time_step == 0.05
    with pytest.raises(InputError, match="there is none"):
        own_folder(USER_PARTS / "nix")
    with pytest.raises(InputError, match="experiment: must be one of"):
        compose(["experiment=tiny"])


def test_an_experiment_that_does_not_pickle_is_refused_before_anything_is_flown() -> None:
    experiment = build(compose(["experiment=tiny", "executor=serial"], USER_PARTS))
    failing = replace(experiment.failure)  # type: ignore[type-var]
    object.__setattr__(failing, "lock", threading.Lock())
    scenario = replace(experiment.scenario, failure=failing)
    middle = np.full(experiment.space.size, 0.5)
    missions = experiment.plan.selection(0, 0, experiment.space.decode(middle))
    with experiment.executor.open() as pool, pytest.raises(InputError, match="cannot be sent"):
        list(Dispatcher(pool, 1, "stop").run(scenario, missions))
