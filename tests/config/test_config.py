import re
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers import USER_PARTS
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.config.compose import MAX_LENGTH, add_config_dir, compose, job_name
from evoros.config.jobs import Job, Jobs
from evoros.config.like import EVALUATE
from evoros.config.own_files import ROBOT, WORLD, OwnFile, choose_name, parse_keys
from evoros.config.recorded import override_recorded, read_recorded
from evoros.dispatch.dispatcher import Dispatcher
from evoros.mission.plan import GENERATIONS


def test_what_a_run_keeps_composes_to_the_same_experiment(tmp_path: Path) -> None:
    config = compose(["experiment=as_run", "failure=spatial", "seed=4"])
    (tmp_path / "config.yaml").write_text(config.text)
    again = read_recorded(tmp_path / "config.yaml")
    assert (again.text, again.values) == (config.text, config.values)
    overridden, generations = override_recorded(again, [], None, GENERATIONS)
    assert (overridden.text, generations) == (config.text, None)
    assert again.build().design == config.build().design


def test_references_are_kept_and_not_their_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EVOROS_SECRET", "0.297531")
    config = compose(["+robot.arguments.front_axle_x=${oc.env:EVOROS_SECRET}"])
    assert "97531" not in config.text
    assert "97531" not in repr(config)
    assert config.overrides == ("+robot.arguments.front_axle_x=${oc.env:EVOROS_SECRET}",)
    assert "0.297531" in config.build().robot.urdf


def test_the_choices_of_groups_are_recorded_with_their_places() -> None:
    overrides = ["failure=spatial", "filter@failure.effect=stuck", "controller/avoidance=blind"]
    choices = compose(["experiment=quickstart", "world=maze", *overrides]).choices
    expected = {
        "experiment": "quickstart",
        "failure": "spatial",
        "filter@failure.effect": "stuck",
        "controller": "rover",
        "controller/avoidance": "blind",
        "world": "maze",
        "world/course@world.maze.course": "shared",
    }
    assert expected.items() <= choices.items()
    assert not any(group.startswith("hydra/") for group in choices)
    assert "experiment" not in compose().choices


def test_the_designs_of_an_evaluation_are_no_part_of_its_experiment() -> None:
    (job,) = Jobs(["designs=[a.csv,b]"], False, None, EVALUATE)
    assert isinstance(job, Job)
    assert job.config.designs == ["a.csv", "b"]
    assert "designs" not in job.config.values
    assert job.config.text == compose(["+evaluation_draws=evaluation"]).text


def test_composing_twice_is_composing_once() -> None:
    assert compose(["seed=1"]) == compose(["seed=1"])
    assert compose().values["seed"] == 0


@pytest.mark.slow
def test_an_experiment_changes_any_key_and_the_command_line_has_the_last_word() -> None:
    config = compose(["experiment=tiny"], config_dir=USER_PARTS)
    assert config.values["figures"] == [] != compose().values["figures"]
    changed = compose(["experiment=tiny", "figures=[fitness]"], config_dir=USER_PARTS)
    assert changed.values["figures"] == ["fitness"]
    assert compose(["experiment=dense"]).choices["final_choice"] == "halving"
    last = compose(["experiment=dense", "final_choice=successive_rejects"])
    assert last.choices["final_choice"] == "successive_rejects"


def test_physics_is_mujoco_everywhere_and_the_plane_is_the_default() -> None:
    for places in (
        ["simulator={}"],
        ["confirmation=physics", "simulator@confirmation.simulator={}"],
    ):
        texts = {
            compose([place.format(name) for place in places]).text for name in ("physics", "mujoco")
        }
        assert len(texts) == 1
    assert compose().text == compose(["simulator=planar"]).text


def test_a_folder_of_the_users_adds_groups_and_modules() -> None:
    assert compose(["experiment=tiny"], config_dir=USER_PARTS).build().simulator.time_step == 0.05
    with pytest.raises(InputError, match="folder not found"):
        add_config_dir(USER_PARTS / "nix")
    with pytest.raises(InputError, match="experiment: must be one of"):
        compose(["experiment=tiny"])


def test_an_experiment_that_does_not_pickle_is_refused_before_anything_is_flown() -> None:
    experiment = compose(["experiment=tiny", "executor=serial"], config_dir=USER_PARTS).build()
    failing = replace(experiment.failure)  # type: ignore[type-var]
    object.__setattr__(failing, "lock", threading.Lock())
    scenario = replace(experiment.scenario, failure=failing)
    middle = np.full(experiment.space.size, 0.5)
    missions = experiment.plan.selection(0, 0, experiment.space.decode(middle))
    with experiment.executor.open() as pool, pytest.raises(InputError, match="cannot be sent"):
        list(Dispatcher(pool, "stop").run(scenario, missions))


@given(st.lists(st.text(max_size=60), max_size=8))
def test_any_override_gives_a_name_that_is_one_safe_component(overrides: list[str]) -> None:
    name = job_name(overrides)
    assert re.fullmatch(r"[A-Za-z0-9._+-]+", name)
    assert name not in (".", "..")
    assert len(name) <= MAX_LENGTH + 9


def test_names_are_readable() -> None:
    assert job_name(["failure=random", "seed=0"]) == "failure-random_seed-0"
    assert job_name(["controller.avoidance.range_m=1.5"]) == "range_m-1.5"
    assert job_name(["world/course@boxes.course=square"]) == "course-square"
    assert job_name(["+a.b=[1,2]", "~failure"]) == "b-1-2_failure"
    assert job_name([]) == "baseline"


def test_a_path_is_named_by_its_end_and_stays_different() -> None:
    paths = [f"/home/me/outputs/{study}/run" for study in ("a", "b")]
    names = [job_name([f"designs={path}", "seed=0"]) for path in (*paths, "[x/a.csv,y/b/]")]
    for name, end in zip(names, ("run", "run", "a.csv-b"), strict=True):
        assert re.fullmatch(f"designs-{end}-[0-9a-f]{{6}}_seed-0", name)
    assert len(set(names)) == 3
    assert job_name(["designs=designs.csv"]) == "designs-designs.csv"


def test_long_names_that_differ_only_at_the_end_stay_different() -> None:
    first, second = (job_name(["key=" + "x" * 300 + end]) for end in "ab")
    assert first != second


scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
values = st.dictionaries(
    st.from_regex(r"[a-z]{1,8}", fullmatch=True),
    scalars | st.lists(scalars) | st.dictionaries(st.sampled_from(["a", "b"]), scalars),
    min_size=1,
)


@given(values)
def test_the_text_of_a_robot_gives_its_values_back(given_values: dict[str, Any]) -> None:
    content = yaml.safe_load(OwnFile(ROBOT, "scout", "A scout.", given_values).text)
    assert content.pop("defaults") == ["own", "_self_"]
    assert content == given_values


@given(values)
def test_the_text_of_a_world_gives_its_values_back(given_values: dict[str, Any]) -> None:
    content = yaml.safe_load(OwnFile(WORLD, "depot", "A depot.", given_values).text)
    assert content["depot"].pop("_target_") == "evoros.world.loading.load_world"
    assert content == {"depot": given_values}


def test_keys_are_nested_and_typed_as_in_yaml() -> None:
    words = ["arguments.laser=true", "arguments.x=0.3", "packages=[a, b]", "name=a b"]
    expected = {"arguments": {"laser": True, "x": 0.3}, "packages": ["a", "b"], "name": "a b"}
    assert parse_keys(words) == expected


@pytest.mark.parametrize("words", [["laser"], ["=3"], ["a=[1"], ["a=1", "a.b=2"]])
def test_a_malformed_key_is_refused(words: list[str]) -> None:
    with pytest.raises(InputError, match=r"must|already"):
        parse_keys(words)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("turtle.urdf.xacro", "turtle"),
        ("My Depot-2.world", "my_depot_2"),
        ("scout/model.sdf", "scout"),
        ("3wheels.urdf", "my_3wheels"),
        ("mule.xacro", "my_mule"),
    ],
)
def test_parts_are_named_after_their_files(file: str, name: str) -> None:
    assert choose_name(Path(file), ROBOT) == name
