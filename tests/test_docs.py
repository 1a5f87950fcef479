"""The documents say what the code does: keys, columns, modules, commands and examples."""

import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser

import evoros
from evoros.config import build, compose
from evoros.experiment import Experiment
from evoros.mission import Mission, run_mission
from evoros.outcome import Outcome
from evoros.types import Array

ROOT = Path(__file__).resolve().parent.parent
DOCS, CONF = ROOT / "docs", ROOT / "conf"
DOCUMENTS = ("configuration", "extending")


def text(name: str) -> str:
    return (DOCS / f"{name}.md").read_text()


def table(content: str, first: str) -> list[list[str]]:
    """The cells of all rows of the tables whose first heading is ``first``, backticks removed."""
    rows, inside = [], False
    for line in content.splitlines():
        # A | inside backticks would split a cell; the documents have none.
        cells = [cell.strip().strip("`") for cell in line.strip("|").split("|")]
        if not line.startswith("|"):
            inside = False
        elif not inside:
            inside = cells[0] == first
        elif not set(line) <= set("|-"):
            rows.append(cells)
    return rows


def files(name: str) -> dict[str, str]:
    """The files that a document spells out: a line with a path, then a block of code."""
    found = re.findall(r"^`(mine/[\w./]+)`:\n\n```\w+\n(.*?)^```$", text(name), re.M | re.S)
    return dict(found)


def write(contents: Mapping[str, str], folder: Path) -> None:
    for path, content in contents.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)


def commands(name: str) -> list[str]:
    """The lines that call evoros."""
    blocks = re.findall(r"^```bash\n(.*?)^```$", text(name), re.M | re.S)
    return [line for block in blocks for line in block.splitlines() if line.startswith("evoros ")]


# Configuration ------------------------------------------------------------------------------


def sections() -> dict[str, str]:
    """The sections of configuration.md that describe one file of conf/, by its path."""
    parts = re.split(r"^### `([^`]+)`$", text("configuration"), flags=re.M)
    return {parts[i].replace("=", "/"): parts[i + 1] for i in range(1, len(parts), 2)}


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for name, inner in value.items():
            if name not in ("_target_", "defaults"):
                yield from leaves(inner, f"{key}.{name}" if key else str(name))
    elif key:
        yield key, value


def chosen(defaults: list[Any]) -> Iterator[tuple[str, Any]]:
    """What a defaults list chooses, by where it is placed: {/filter@effect: silence}."""
    for entry in defaults:
        if isinstance(entry, Mapping):
            ((name, choice),) = entry.items()
            yield str(name).removeprefix("override ").split("@")[-1].lstrip("/"), choice
        elif "@" in entry:
            choice, _, place = entry.partition("@")
            yield place, choice


def keys(path: Path) -> dict[str, Any]:
    """Every key that a file sets, with its value; the user's names of regions are one."""
    content = yaml.safe_load(path.read_text())
    found = dict(chosen(content.get("defaults", []))) | dict(leaves(content))
    return {re.sub(r"^regions\.\w+", "regions.NAME", key): found[key] for key in found}


CHOICES = sorted(str(path.relative_to(CONF).with_suffix("")) for path in CONF.rglob("*.yaml"))


def test_every_choice_has_a_section_and_no_section_is_without_one() -> None:
    assert sorted(sections()) == CHOICES


@pytest.mark.parametrize("choice", CHOICES)
def test_exactly_the_keys_of_each_file_are_documented_with_their_defaults(choice: str) -> None:
    documented = {row[0]: row[1] for row in table(sections()[choice], "key")}
    configured = keys(CONF / f"{choice}.yaml")
    # What a region and a gene may have besides: fields of their classes.
    optional = {"z_m", "pitch_deg", "link", "key", "low", "high", "whole"}
    extra = {key for key in documented if ".NAME." in key and key.split(".")[-1] in optional}
    assert set(documented) - extra == set(configured)
    for key, value in configured.items():
        if ".NAME." not in key:
            assert yaml.safe_load(documented[key]) == value, key


def test_the_table_of_regions_is_that_of_the_design() -> None:
    regions = yaml.safe_load((CONF / "design/six_sonars.yaml").read_text())["regions"]
    documented = {
        row[0]: [list(map(float, cell.split(" to "))) for cell in row[1:]]
        for row in table(sections()["design/six_sonars"], "region")
    }
    assert documented == {
        name: [region[key] for key in ("x_m", "y_m", "yaw_deg")] for name, region in regions.items()
    }


def jobs(line: str) -> Iterator[tuple[list[str], str | None]]:
    """The overrides of each job that a command runs, and its folder of configuration."""
    words = shlex.split(line, comments=True)[1:]
    own = words[words.index("--config-dir") + 1] if "--config-dir" in words else None
    words = [word for word in words if word not in ("-m", "--config-dir", own)]
    split: list[list[list[str]]] = BasicSweeper.split_arguments(
        OverridesParser.create().parse_overrides(words), None
    )
    for job in (job for batch in split for job in batch):
        yield job, own


COMMANDS = sorted({line for name in DOCUMENTS if name != "extending" for line in commands(name)})


@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_compose_and_build(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(files("configuration"), tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # the user's own folder is added to it
    every = list(jobs(line))
    for overrides, own in (every[0], every[-1])[: len(every)]:
        resumed = [word for word in overrides if word.startswith("resume=")]
        if resumed:
            allowed = ("resume", "executor", "executor.workers", "optimizer.generations")
            assert all(word.partition("=")[0] in allowed for word in overrides)
            continue
        build(compose(overrides, own))


# Extending ----------------------------------------------------------------------------------

# The part replaces one of these; the fitness, optimizer and executor do not touch a mission.
FLIGHT = ("robot", "sensor", "filter", "failure", "controller", "simulator")
SMALL = ["optimizer.population_size=3", "optimizer.generations=2", "optimizer.validation_trials=1"]


LIMIT = "world.yard.course.time_limit_s=5"


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A current folder with the folder ``mine`` that extending.md describes."""
    folder = tmp_path_factory.mktemp("extending")
    write(files("extending"), folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", list(sys.path))
        yield folder


def quick(overrides: list[str]) -> Experiment:
    """The experiment in the example's simulator and world, unless they are chosen."""
    named = {word.split("=")[0] for word in overrides}
    rest = {"simulator": "kinematic", "world": "yard", "executor": "serial"}
    added = [f"{group}={choice}" for group, choice in rest.items() if group not in named]
    return build(compose([*added, *overrides, LIMIT], "mine"))


def flown(experiment: Experiment) -> tuple[Outcome, Array]:
    design = experiment.space.decode(np.linspace(0.1, 0.9, experiment.space.size))
    mission = Mission(0, 0, design, "yard", 0, "evaluation", "a key of draws")
    return run_mission(experiment.task, mission)


@pytest.fixture(scope="module")
def baseline(mine: Path) -> Array:
    return flown(quick([]))[1]


EXAMPLES = commands("extending")
IN_FLIGHT = [line for line in EXAMPLES if re.match(rf".*mine \+?({'|'.join(FLIGHT)})\b", line)]


@pytest.mark.parametrize("line", [line for line in EXAMPLES if line not in IN_FLIGHT])
def test_the_examples_of_parts_build(line: str, mine: Path) -> None:
    for overrides, own in jobs(line):
        assert own == "mine"
        build(compose(overrides, own))


@pytest.mark.parametrize("line", IN_FLIGHT)
def test_the_examples_of_parts_fly_and_matter(line: str, mine: Path, baseline: Array) -> None:
    ((overrides, _),) = jobs(line)
    outcome, trajectory = flown(quick(overrides))
    assert outcome.ended in ("completed", "collision", "time_limit")
    again = flown(quick(overrides))
    assert str(again[0]) == str(outcome)  # NaN differs from itself
    np.testing.assert_array_equal(again[1], trajectory)
    if overrides != ["simulator=kinematic"]:
        assert not np.array_equal(baseline, trajectory, equal_nan=True)


def test_the_example_of_a_robot_drives_in_pybullet(mine: Path) -> None:
    pytest.importorskip("pybullet")
    outcome, _ = flown(quick(["robot=cart", "simulator=pybullet"]))
    assert outcome.ended == "time_limit"
    assert 1.0 < outcome.distance_m < 2.0  # 0.3 m/s for 5 s


def short_run(name: str, overrides: list[str]) -> evoros.Run:
    common = ["simulator=kinematic", "simulator.time_step=0.1", "world=yard", LIMIT, *SMALL]
    config = compose(["executor=serial", *common, *overrides], "mine")
    return evoros.run(config, Path(name))


def test_the_examples_of_optimizer_executor_and_fitness_run(mine: Path) -> None:
    here = short_run("here", ["optimizer=hill_climber", "fitness=careful"])
    there = short_run("there", ["optimizer=hill_climber", "fitness=careful", "executor=standard"])
    lines = (here.path / "missions.csv").read_text().splitlines()
    assert sorted(lines) == sorted((there.path / "missions.csv").read_text().splitlines())
    best = here.generations.groupby("generation").fitness.max()
    assert best.is_monotonic_increasing
    first = here.missions[here.missions.purpose == "selection"].iloc[0]
    fitness = here.generations.set_index("id").fitness[first.design]
    expected = first.progress + 0.5 * first.least_clearance_m
    assert float(np.max(fitness)) == pytest.approx(expected, abs=1e-12)
