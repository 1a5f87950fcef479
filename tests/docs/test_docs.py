"""The documents say what the code does: keys, columns, modules, commands and examples."""

import ast
import inspect
import re
import shlex
import sys
import types
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from documents import commands, documented, files, table, text, write
from helpers import ROOT
from omegaconf import DictConfig

import evoros
import evoros.session.api
from evoros.base.arrays import Array
from evoros.config.compose import build, compose
from evoros.config.jobs import Job, Jobs, options_of
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.outcome import TRAJECTORY, Outcome
from evoros.mission.rollout import run_mission
from evoros.storage.tables import (
    CANDIDATE_COLUMNS,
    DESIGN_COLUMNS,
    GENE_COLUMNS,
    MEASURED_COLUMNS,
    MISSIONS_HEADER,
)

CONF = ROOT / "conf"
DOCUMENTS = ("configuration", "run_folder", "worlds", "architecture", "extending", "python")


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
    optional = {"z_m", "pitch_deg", "link", "overhang_m", "key", "low", "high", "whole"}
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
SMALL = [
    "optimizer.population_size=2",
    "optimizer.generations=2",
    "optimizer.validation_trials=1",
    "figures=[]",
]


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
    return run_mission(experiment.scenario, mission)


@pytest.fixture(scope="module")
def baseline(mine: Path) -> Array:
    return flown(quick([]))[1]


EXAMPLES = commands("extending")
IN_FLIGHT = [line for line in EXAMPLES if re.match(rf".*mine \+?({'|'.join(FLIGHT)})\b", line)]


# Those that fly are built there, but in another simulator, whose time step may differ.
TYPED = [line for line in EXAMPLES if line not in IN_FLIGHT or "controller=" in line]


@pytest.mark.parametrize("line", TYPED)
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


def test_the_columns_of_missions_are_documented_in_order() -> None:
    assert tuple(documented("missions.csv")) == MISSIONS_HEADER


def test_the_columns_of_generations_are_documented_in_order() -> None:
    columns, head = documented("generations/NNNNN.csv"), (*CANDIDATE_COLUMNS, *MEASURED_COLUMNS)
    fixed, decoded = columns[: len(head)], columns[len(head) :]
    assert tuple(fixed) == head
    design = ["+sensor@design.sensors.other=sonar", "design.number=[1,2]"]
    ranges = ["+design.regions.front.z_m=[0.1,0.2]", "+design.regions.front.pitch_deg=[0,10]"]
    space = build(compose([*design, *ranges])).space
    known = list(space.values(np.zeros(space.size)))
    assert [name.replace("N", "1") for name in decoded] == [
        name for name in known if name.startswith("sensor1_")
    ]
    assert known[-1] == "number"


def test_the_columns_of_the_champion_are_documented_in_order() -> None:
    trajectory = (*TRAJECTORY, "range_N_m")
    assert tuple(documented("champion")) == (*DESIGN_COLUMNS, *GENE_COLUMNS, *trajectory)


@pytest.fixture(scope="module")
def finished(mine: Path) -> evoros.Run:
    return short_run("outputs/mine", ["failure=frontal", "figures=[overlay,fitness,mission]"])


def test_the_fields_of_manifest_and_status_are_documented_in_order(finished: evoros.Run) -> None:
    assert documented("manifest.json") == list(finished.manifest)
    assert documented("status.json") == list(finished.status)


def test_the_files_of_a_run_are_documented(finished: evoros.Run) -> None:
    names = {name for row in table(text("run_folder"), "file") for name in row[0].split("`, `")}
    there = {str(path.relative_to(finished.path)) for path in finished.path.rglob("*.*")}
    numbered = {re.sub(r"\d{5}", "NNNNN", name).replace("_yard", "_WORLD") for name in there}
    numbered = {re.sub(r"figures/\w+", "figures/NAME", name) for name in numbered}
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


# Architecture -------------------------------------------------------------------------------


@cache
def modules() -> dict[str, Path]:
    names = (*(ROOT / "evoros").rglob("*.py"), *(ROOT / "analysis").rglob("*.py"))
    return {str(path.relative_to(ROOT)): path for path in names}


@cache
def imported(path: Path) -> set[str]:
    """The modules that a file imports when it runs, dotted; those of evoros by their full name."""
    tree = ast.parse(path.read_text())
    names: set[str] = set()
    checking = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if id(node) in checking:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def ours(path: Path) -> set[str]:
    """Which modules and packages of evoros a file imports: the first name behind ``evoros.``"""
    known = {Path(name).parts[1].removesuffix(".py") for name in modules() if "evoros" in name}
    inside = {name.split(".")[1] for name in imported(path) if name.startswith("evoros.")}
    return inside & known


def named(cell: str) -> list[str]:
    return [part.strip(" `") for part in cell.split(",")]


def test_every_module_is_in_its_room_and_every_room_exists() -> None:
    rooms = [row[0] for row in table(text("architecture"), "module") if row[0].endswith(".py")]
    assert len(rooms) == len(set(rooms))
    assert set(rooms) == set(modules())


def test_libraries_are_imported_only_where_the_document_says() -> None:
    for library, places in table(text("architecture"), "library"):
        importers = {
            name
            for name, path in modules().items()
            if any(each.split(".")[0] == library for each in imported(path))
        }
        allowed = named(places)
        assert importers, library
        for name in importers:
            assert any(name == p or (p.endswith("/") and name.startswith(p)) for p in allowed), name
        for place in allowed:
            assert any(name.startswith(place) for name in importers), (library, place)


def test_imports_point_the_way_that_the_document_says() -> None:
    for places, forbidden in table(text("architecture"), "these"):
        for place in named(places):
            files = [path for name, path in modules().items() if name.startswith(place)]
            assert files, place
            for path in files:
                if forbidden.startswith("anything"):
                    excepted = set(named(forbidden.removeprefix("anything but")))
                    assert ours(path) <= excepted, path
                else:
                    assert not ours(path) & set(named(forbidden)), path


# Python -------------------------------------------------------------------------------------


def test_every_public_name_is_documented_and_no_other() -> None:
    rows = [row[0] for row in table(text("python"), "name")]
    assert {re.sub(r"\(.*", "", row).removeprefix("evoros.") for row in rows} == set(evoros.__all__)
    for row in rows:
        function = getattr(evoros, re.sub(r"\(.*", "", row).removeprefix("evoros."))
        for argument in re.findall(r"\w+", row.partition("(")[2]):
            assert argument in inspect.signature(function).parameters, row


def test_every_attribute_of_a_run_is_documented() -> None:
    public = {name for name in dir(evoros.Run) if not name.startswith("_")} | {"path"}
    assert {row[0].split("(")[0] for row in table(text("python"), "attribute")} == public


class Cma:
    """Stands for the library: asks for uniform draws."""

    def __init__(self, start: list[float], sigma: float, options: dict[str, Any]) -> None:
        self.size, self.rng, self.told = len(start), np.random.default_rng(0), 0

    def ask(self) -> list[Array]:
        return [self.rng.random(self.size) for _ in range(2)]

    def tell(self, genomes: list[Array], values: list[float]) -> None:
        assert len(genomes) == len(values)
        assert all(value <= 0 for value in values)  # fitness is maximized, cma minimizes
        self.told += 1


def test_the_examples_in_python_run(
    finished: evoros.Run, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the configuration of the example's simulator in place of the one that is typed."""
    cma = types.ModuleType("cma")
    cma.CMAEvolutionStrategy = Cma  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "cma", cma)
    typed: list[str] = []

    def quicker(overrides: Any) -> DictConfig:
        typed.extend(overrides)
        # The link and the worlds of the document stay: only what costs time is replaced.
        worlds = [f"world.{name}.course.time_limit_s=0.1" for name in ("boxes", "maze", "blocks")]
        small = [] if "experiment=quickstart" not in overrides else SMALL
        rest = ["simulator=kinematic", "executor=serial", "figures=[]", *worlds, *small]
        return compose([*overrides, *rest], "mine")

    monkeypatch.setattr(evoros.session.api, "_composed", quicker)
    for block in code("python"):
        less = block.replace("range(10)", "range(1)").replace("generations=5", "generations=3")
        exec(less, {"__name__": "__main__"})
    assert {"seed=1", "trials=3", "trials=2"} <= set(typed)
    said = capsys.readouterr().out
    assert all(word in said for word in ("maze_progress", "validated_fitness", "yard"))
