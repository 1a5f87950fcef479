"""Each page of docs/parts is a whole example: its files alone build, run and matter."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from documents import PARTS, commands, files, text, write
from examples import composed, short_run

from evoros.base.arrays import Array
from evoros.cli.command import parse_options
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission, Outcome
from evoros.mission.rollout import run_mission

MISSION_PARTS = (
    "robot|drive|design|sensor|filter|failure|controller|world|simulator"  # and no other group
)
SHORT = {"executor": "serial", "simulator": "planar", "world": "boxes", "course.time_limit_s": "5"}
EXAMPLES = [(page, line) for page in PARTS for line in commands(page)]
IN_MISSION = [
    (page, line) for page, line in EXAMPLES if re.search(rf"mine \+?({MISSION_PARTS})\b", line)
]
# The tests of missions build the others in another world, and with another executor.
TYPED = [
    example for example in EXAMPLES if example not in IN_MISSION or "controller=" in example[1]
]


def quick(overrides: list[str]) -> Experiment:
    """The experiment with short missions in one world of the plane, unless a key is chosen."""
    named = {word.split("=")[0] for word in overrides}
    added = [f"{key}={value}" for key, value in SHORT.items() if key not in named]
    if any("yard" in word for word in overrides):
        added.append("world.yard.course.time_limit_s=5")
    return compose([*added, *overrides], config_dir="mine").build()


def run_once(experiment: Experiment) -> tuple[Outcome, Array]:
    design = experiment.space.decode(np.linspace(0.1, 0.9, experiment.space.size))
    world = next(iter(experiment.world))
    mission = Mission(0, 0, design, world, 0, "evaluation", "a key of draws")
    (outcome,), track = run_mission(experiment.scenario, mission)
    return outcome, track


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A folder for each page, with the files of this page alone."""
    made = {page: tmp_path_factory.mktemp(page.replace("/", "_")) for page in PARTS}
    for page, folder in made.items():
        write(files(page), folder)
        (folder / "mine").mkdir(exist_ok=True)
    return made


@pytest.fixture(scope="module")
def baseline(mine: Path) -> Array:
    return run_once(quick([]))[1]


def test_the_index_names_every_page() -> None:
    assert sorted(re.findall(r"\]\((parts/\w+)\.md\)", text("extending"))) == PARTS


def test_every_page_has_files_and_a_command() -> None:
    assert all(files(page) and commands(page) for page in PARTS)


@pytest.mark.parametrize(("page", "line"), TYPED)
def test_the_examples_build(
    page: str, line: str, folders: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folders[page])
    monkeypatch.setattr(sys, "path", list(sys.path))
    for config in composed(line):
        config.build()


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), IN_MISSION)
def test_the_examples_run_and_matter(
    page: str, line: str, folders: dict[str, Path], baseline: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folders[page])
    monkeypatch.setattr(sys, "path", list(sys.path))
    experiment = quick(list(parse_options(shlex.split(line)[1:]).overrides))
    outcome, trajectory = run_once(experiment)
    assert outcome.ended in ("completed", "collision", "time_limit")
    repeated = run_once(experiment)
    assert str(repeated[0]) == str(outcome)  # NaN differs from itself
    np.testing.assert_array_equal(repeated[1], trajectory)
    assert not np.array_equal(baseline, trajectory, equal_nan=True)


def test_the_example_of_a_robot_drives_in_pybullet(mine: Path) -> None:
    outcome, _ = run_once(quick(["robot=cart", "simulator=pybullet", "world=yard"]))
    assert outcome.ended == "time_limit"
    assert 1.0 < outcome.distance_m < 2.0  # 0.3 m/s for 5 s


def test_the_example_of_a_drive_commands_the_joints_as_the_plane_turns(mine: Path) -> None:
    worn = quick(["drive@robot.drive=worn", "robot.drive.turn_ratio=0.5"]).robot.drive
    full = quick([]).robot.drive
    less = np.arctan(worn.turn_ratio * np.tan(0.3))
    for joints, expected in zip(worn.targets(0.3, 0.3), full.targets(0.3, less), strict=True):
        np.testing.assert_allclose(joints, expected, rtol=1e-12)


@pytest.mark.slow
def test_the_examples_of_optimizer_executor_and_fitness_run(mine: Path) -> None:
    serial = short_run("here", ["optimizer=hill_climber", "fitness=careful"])
    pooled = short_run("there", ["optimizer=hill_climber", "fitness=careful", "executor=standard"])
    lines = (serial.path / "missions.csv").read_text().splitlines()
    assert sorted(lines) == sorted((pooled.path / "missions.csv").read_text().splitlines())
    best = serial.generations.groupby("generation").fitness.max()
    assert best.is_monotonic_increasing
    first = serial.missions[serial.missions.purpose == "selection"].iloc[0]
    fitness = serial.generations.set_index("id").fitness[first.design]
    expected = first.progress + 0.5 * first.least_clearance_m
    assert float(np.max(fitness)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
def test_the_example_of_a_test_passes(tmp_path: Path) -> None:
    write({**files("parts/failure"), **files("extending")}, tmp_path)
    (line,) = re.findall(r"^python (-m pytest .*)$", text("extending"), re.M)
    chosen = [*shlex.split(line), "-p", "no:cacheprovider"]
    done = subprocess.run([sys.executable, *chosen], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout
