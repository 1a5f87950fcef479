"""The documents say what the code does: keys, columns, modules, commands and examples."""

import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from omegaconf import DictConfig

import evoros
from evoros.config import build, compose
from evoros.experiment import Experiment
from evoros.jobs import Job, Jobs, options_of
from evoros.mission import Mission, run_mission
from evoros.outcome import TRAJECTORY, Outcome
from evoros.tables import CANDIDATE_COLUMNS, DESIGN_COLUMNS, GENE_COLUMNS, MISSIONS_HEADER
from evoros.types import Array

ROOT = Path(__file__).resolve().parent.parent
DOCS, CONF = ROOT / "docs", ROOT / "conf"
DOCUMENTS = ("configuration", "extending", "run_folder")


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
        if ".NAME." not in key and key != "hydra.help.template":
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


def composed(line: str, *more: str) -> Iterator[DictConfig]:
    """The configurations of the jobs that a command runs."""
    options = options_of([*shlex.split(line, comments=True)[1:], *more])
    for job in Jobs(options.overrides, bool(options.multirun), options.config_dir):
        assert isinstance(job, Job), job
        yield job.config


COMMANDS = sorted({line for name in DOCUMENTS if name != "extending" for line in commands(name)})


@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_compose_and_build(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(files("configuration"), tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # the user's own folder is added to it
    if "resume=" in line:
        overrides = options_of(shlex.split(line)[1:]).overrides
        allowed = ("resume", "executor", "executor.workers", "optimizer.generations")
        assert all(each.partition("=")[0] in allowed for each in overrides)
    else:
        every = list(islice(composed(line), 3))
        for config in (every[0], every[-1])[: len(every)]:
            build(config)


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
    for config in composed(line):
        build(config)


@pytest.mark.parametrize("line", IN_FLIGHT)
def test_the_examples_of_parts_fly_and_matter(line: str, mine: Path, baseline: Array) -> None:
    overrides = options_of(shlex.split(line)[1:]).overrides
    experiment = quick(overrides)
    outcome, trajectory = flown(experiment)
    assert outcome.ended in ("completed", "collision", "time_limit")
    again = flown(experiment)
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


# The run folder -----------------------------------------------------------------------------


def documented(heading: str) -> list[str]:
    """The columns of the tables of one section of run_folder.md, in order."""
    content = re.split(r"^## ", text("run_folder"), flags=re.M)
    (section,) = (part for part in content if part.startswith(heading + "\n"))
    return [row[0] for first in ("column", "field") for row in table(section, first)]


def test_the_columns_of_missions_are_documented_in_order() -> None:
    assert tuple(documented("missions.csv")) == MISSIONS_HEADER


def test_the_columns_of_generations_are_documented_in_order() -> None:
    fixed, decoded = (
        documented("generations/NNNNN.csv")[:7],
        documented("generations/NNNNN.csv")[7:],
    )
    assert tuple(fixed) == CANDIDATE_COLUMNS
    design = ["+sensor@design.sensors.other=sonar", "design.number=[1,2]"]
    ranges = ["+design.regions.front.z_m=[0.1,0.2]", "+design.regions.front.pitch_deg=[0,10]"]
    known = build(compose([*design, *ranges])).space.columns()
    assert [name.replace("N", "1") for name in decoded] == [
        name for name in known if name.startswith("sensor1_")
    ]
    assert known[-1] == "number"


def test_the_columns_of_the_champion_are_documented_in_order() -> None:
    trajectory = (*TRAJECTORY, "range_N_m")
    assert tuple(documented("champion")) == (*DESIGN_COLUMNS, *GENE_COLUMNS, *trajectory)


@pytest.fixture(scope="module")
def finished(mine: Path) -> evoros.Run:
    return short_run("outputs/mine", ["failure=frontal"])


def test_the_fields_of_manifest_and_status_are_documented_in_order(finished: evoros.Run) -> None:
    assert documented("manifest.json") == list(finished.manifest)
    assert documented("status.json") == list(finished.status)


def test_the_files_of_a_run_are_documented(finished: evoros.Run) -> None:
    names = {name for row in table(text("run_folder"), "file") for name in row[0].split("`, `")}
    there = {str(path.relative_to(finished.path)) for path in finished.path.rglob("*.*")}
    numbered = {re.sub(r"\d{5}", "NNNNN", name).replace("_yard", "_WORLD") for name in there}
    assert numbered == names


def code(name: str) -> list[str]:
    """The blocks of Python of a document that are no files."""
    content = re.sub(r"^`mine/[\w./]+`:\n\n```python\n.*?^```$", "", text(name), flags=re.M | re.S)
    return re.findall(r"^```python\n(.*?)^```$", content, re.M | re.S)


def test_the_replay_of_a_mission_gives_what_was_recorded(finished: evoros.Run) -> None:
    (block,) = code("run_folder")
    for number in range(len(finished.missions)):
        names: dict[str, Any] = {}
        exec(block.replace("iloc[-1]", f"iloc[{number}]"), names)
        assert names["outcome"].progress == names["row"].progress
        assert names["outcome"].least_clearance_m == names["row"].least_clearance_m
