"""Whatever a message proposes to type can be typed.

``proposal_sites`` collects from the source all that messages propose. A new proposal must be one
that evoros takes and that a test types, or be among those that nobody types (``NOT_TYPED``).
"""

import argparse
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from operator import attrgetter
from pathlib import Path
from typing import Any, NoReturn

import pytest
import yaml
from helpers import ROOT, TINY
from proposal_sites import (
    COMMAND,
    INSTALL,
    NOT_TYPED,
    OPTION,
    OVERRIDE,
    is_of,
    list_alternatives,
    list_extras,
    list_messages,
    list_named,
    list_proposals,
    replaces,
)
from typed_cases import ROBOTS, RUNS, Robot, Words
from typed_finished import CASES

from evoros.analysis import subcommands as analysis
from evoros.base.errors import InputError
from evoros.cli.command import parse_options
from evoros.cli.subcommands import FIGURES, SUBCOMMANDS
from evoros.config.compose import add_config_dir, compose_with_hydra
from evoros.config.jobs import Job, Jobs
from evoros.drive.automatic import AutomaticDescription
from evoros.files.resources import bundled_folder
from evoros.formats.sdf.reading import SdfOptions
from evoros.robot.loading import load_robot
from evoros.session.run import check_run
from evoros.world.course import Course

FILLED: Mapping[str, str] = {
    "+{key}=...": "+measure@descriptors.front=front_coverage",
    "{key}.slip": "simulator.slip",
    "{side}": "left",
    "seed=range({": "seed={",  # of a sweep
    "...": "1",
    "%d": "12",
    "{self.key}": "",
    "agents.{name}": "agents.oncoming",
    "{name}=NAME": "world=boxes",
    "{group}": "objectives",
    "world.NAME.": "world.boxes.",
    "world.{name}.": "world.boxes.",
    "[FOLDER]": "[.]",
    "[[X, Y], ...]": "[[1,2]]",
    "=X": "=1",
    "=Y": "=1",
    "failure={kind}": "failure=spatial",
    "{kind}": "differential",
    "{held}": "",
    "{nearest}": "benchmark_boxes",
    "{BASELINE}": "none",
    "{failure}": "random",
    "{fix}": "all",
    "{key}": "seed",
    "{error.full_key}": "seed",
    "{choice}": "failure",
    "{x}": "world.boxes.course.home_x_m",
    "{y}": "world.boxes.course.home_y_m",
    "{differing[0]}": "design",
    "{ignored}": "arm",
    "{growing}": "trials",
}
"""Values of what messages fill in; all others are numbers."""
NEEDS: Mapping[str, tuple[str, ...]] = {
    "controller.isolate": ("controller=program",),
    "agents.oncoming.design.number": ("agents=oncoming", "+design@agents.oncoming.design=around"),
    "executor.device": ("executor=gpu",),
    "executor.fallback": ("executor=gpu",),
    "failure.sensors": ("failure=given",),
    "failure.time_s": ("failure=given",),
    "robot.drive": ("robot=own", "robot.description=r.urdf"),
    "robot.drive.kind": ("robot=own", "robot.description=r.urdf"),
    "robot.drive.left_wheel_joints": ("robot=own", "robot.description=r.urdf"),
    "robot.drive.right_wheel_joints": ("robot=own", "robot.description=r.urdf"),
    "robot.drive.turning_x_m": ("drive@robot.drive=ackermann",),
    "robot.drive.turning_resistance": ("drive@robot.drive=skid_steer",),
    "robot.drive.wheel_joints": ("drive@robot.drive=differential",),
    "allocation.first": ("allocation=racing",),
    "allocation.max_trials": ("allocation=racing",),
    "controller.modes": ("controller=program",),
    "controller.parameters": ("controller=ardupilot",),
    "controller.nodes": ("controller=ros2",),
    "controller.python": ("controller=ros2",),
    "controller.topics": ("controller=ros2",),
    "executor.address": ("executor=dask",),
    "failure.onset": ("failure=drive",),
    "failure.validation": ("failure=adversarial",),
    "final_choice.method.budget": ("final_choice=halving",),
    "optimizer.candidates": ("optimizer=set_cover",),
    "optimizer.cells": ("optimizer=map_elites",),
    "optimizer.failed": ("optimizer=set_cover",),
    "optimizer.width_deg": ("optimizer=set_cover",),
    "worst_cases.latest_s": ("worst_cases=search",),
    "worst_cases.times_s": ("worst_cases=search",),
    "robot.missing": ("robot=own", "robot.description=r.urdf"),
    "robot.ignored_packages": ("robot=own", "robot.description=r.urdf"),
    "descriptors.front": ("optimizer=map_elites",),
    "objectives.cost": ("optimizer=nsga2",),
    "simulator.slip_impedance": ("simulator=mujoco",),
}
"""Choices with which a configuration has a key."""

KEY = re.compile(r"(?<![\w./<\"{}%@-])([a-z_]\w*(?:\.[a-z_]\w*)+)(?![\w=(\[./@{])")
TOPS = frozenset(
    (
        *("allocation", "controller", "design", "executor", "failure", "final_choice"),
        *("optimizer", "robot", "simulator", "validation", "worst_cases"),
    )
)
"""First parts of keys of a run, which are no modules of Python and no hosts."""
NO_KEYS: Mapping[str, str] = {"design.csv": "a file"}
"""Mentions that are no keys, with the reason."""

OF_EVALUATIONS = frozenset(
    ("designs", "like", "requirements", "worst_cases", "evaluation_draws", "trials")
)
IN_FILES = frozenset(field.name for field in fields(SdfOptions))
OF_WORLDS = IN_FILES.union(field.name for field in fields(Course))
"""Keys of the file of a world, which evoros inspect takes, too."""
PROSE = frozenset((
    *("again", "and", "answers", "beside", "by", "can", "cannot", "casts", "computed", "core"),
    *("does", "evaluates", "for", "from", "has", "ignores", "in", "is", "itself", "made", "or"),
    *("printed", "publishes", "ran", "root", "run", "runs", "see", "supports", "takes", "that"),
    *("there", "treats", "under", "which", "with", "writes", "wrote"),
))  # fmt: skip
"""Words that follow evoros in a sentence."""
FOREIGN = frozenset({"--count", "--no-install-recommends", "--scheduler-file", "--simulation"})
"""Options of other programs: of git, apt-get, dask and scenario_execution."""


def typed_overrides() -> Iterator[tuple[str, str, str]]:
    """Each override that is proposed: its key and value, filled in, and the message's place."""
    for message in list_messages():
        for found in OVERRIDE.finditer(message.text):
            if not any(re.fullmatch(pattern, found[0]) for pattern in NOT_TYPED):
                key, _, value = _fill(found[0]).partition("=")
                yield key, value.rstrip(".:)"), message.place


def _fill(text: str) -> str:
    for name, value in FILLED.items():
        text = text.replace(name, value)
    return re.sub(r"\{.*?\}", "1", text)


def pack(pairs: Iterable[tuple[str, str]]) -> Iterator[list[str]]:
    """Pack overrides, with what their keys need, into as few lines as these allow."""
    lines: list[dict[str, list[str]]] = []
    for key, value in pairs:
        words = [*NEEDS.get(key, ()), f"{key}={value}"]
        tops = [re.split("[.@/=]", word.lstrip("+~"))[0] for word in words]
        line = next((line for line in lines if line.keys().isdisjoint(tops)), None)
        if line is None:
            lines.append(line := {})
        for top, word in zip(tops, words, strict=True):
            line.setdefault(top, []).append(word)
    return ([word for words in line.values() for word in words] for line in lines)


@pytest.mark.slow
def test_every_override_is_one_that_evoros_takes() -> None:
    overrides = {(key, value): place for key, value, place in typed_overrides()}
    of_commands: dict[str, list[tuple[str, str]]] = {"evaluate": [], "config": []}
    for (key, value), place in overrides.items():
        chosen = bundled_folder("conf") / key.lstrip("+").partition("@")[0]
        if key in IN_FILES:
            SdfOptions(**{key: yaml.safe_load(value)})
        elif re.match(r"world\.|course\.", key.lstrip("+")):
            assert key.rpartition(".")[2] in OF_WORLDS, place
        elif chosen.is_dir() and not value.isidentifier():
            pass  # a choice of the user
        else:
            primary = "evaluate" if key in OF_EVALUATIONS else "config"
            of_commands[primary].append((key, value))
    for primary, pairs in of_commands.items():
        for line in pack(pairs):
            compose_with_hydra(line, primary=primary)


def mentioned_keys() -> Iterator[tuple[str, str]]:
    """Each dotted key of a configuration that a message mentions without a value; its place."""
    for message in list_messages():
        for key in KEY.findall(re.sub(r"\{[^{}]*\}", "1", message.text)):
            if key.partition(".")[0] in TOPS and key not in NO_KEYS:
                yield key, message.place


@pytest.mark.slow
def test_every_key_that_is_mentioned_exists() -> None:
    keys = dict.fromkeys(key for key, _ in mentioned_keys())
    for line in pack((key, "1") for key in keys):
        compose_with_hydra(line)


def test_every_option_is_one_of_a_command() -> None:
    known = {option for command in SUBCOMMANDS.values() for option in command.options}
    known |= {"--help", "--check", "--known", "--license", "--port"}
    for name in analysis.SUBCOMMANDS:
        parser = argparse.ArgumentParser()
        analysis.add_all_arguments(parser, analysis.import_subcommand(name))
        known.update(*(action.option_strings for action in parser._actions))
    for message in list_messages():
        for option in OPTION.findall(message.text):
            assert option in known | FOREIGN, message.place


def test_every_command_is_one_of_evoros() -> None:
    for message in list_messages():
        for word, figure in COMMAND.findall(message.text):
            assert word in SUBCOMMANDS or word in PROSE, message.place
            if word == FIGURES and figure:
                assert figure in analysis.SUBCOMMANDS, message.place


def test_every_package_to_install_is_one_that_evoros_declares() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    lines = [*project["dependencies"], *(line for lines in extras.values() for line in lines)]
    declared = {re.split("[^A-Za-z0-9-]", line)[0] for line in lines}
    for extra, place in list_extras():
        assert extra in extras, place
    for message in list_messages():
        for name in INSTALL.findall(message.text):
            match = re.fullmatch(r"evoros\[(.*)\]", name)
            if "{" not in name:
                assert match[1] in extras if match else name in declared, message.place


def test_every_proposal_is_typed_in_a_test() -> None:
    """A new message needs a case, and one that is gone needs none."""
    cases = {*(case.key for case in ROBOTS), *(case.key for case in RUNS)}
    cases |= {key for case in CASES for key in (case.key, *case.others)}
    assert set(list_proposals().values()) == list_named() | cases


def examine(words: Iterable[str], of_default: bool) -> str:
    """Build and check a run, and start nothing; return why it is refused, or nothing."""
    base = () if of_default else TINY
    options = parse_options([*base, "executor=serial", "hydra.run.dir=none", *words])
    if options.config_dir:
        add_config_dir(options.config_dir)
    try:
        (job,) = Jobs(options.overrides, False, options.config_dir, "config", refuse_run)
        assert isinstance(job, Job)
        check_run(job.config, None)
    except InputError as error:
        return str(error)
    return ""


def refuse_run(source: str, typed: frozenset[str]) -> NoReturn:
    raise InputError(f"{source}: no case reads a run; leave it out")


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.slow] * case.slow, id=case.words) for case in RUNS],
)
def test_a_refusal_of_a_run_is_lifted_by_each_of_its_proposals(
    case: Words, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In place of what was typed; another refusal has another reason."""
    monkeypatch.chdir(tmp_path)
    words = case.words.split()
    message = examine(words, case.of_default)
    assert is_of(message, case.key), message
    alternatives = list_alternatives(message, case.filled)
    assert alternatives
    for proposed in alternatives:
        chosen = {word.lstrip("+~").partition("=")[0] for word in proposed}
        kept = [word for word in words if not replaces(chosen, word)]
        refusal = examine([*kept, *proposed], case.of_default)
        assert not is_of(refusal, case.key), proposed
        assert "is not in the configuration" not in refusal, proposed


def load(file: Path, words: Iterable[str]) -> str:
    """Load a robot with overrides; return why it is refused, or nothing."""
    keys: dict[str, dict[str, Any]] = {"robot": {}, "drive": {}, "arguments": {}}
    for word in words:
        key, _, value = word.partition("=")
        group, _, name = key.rpartition(".")
        keys[group.rpartition(".")[2]][name] = yaml.safe_load(value)
    try:
        drive = AutomaticDescription(**keys["drive"])
        load_robot(str(file), drive, arguments=keys["arguments"], **keys["robot"])
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("case", ROBOTS, ids=attrgetter("key"))
def test_a_refusal_of_a_robot_is_lifted_by_each_of_its_proposals(
    case: Robot, tmp_path: Path
) -> None:
    """Whatever is typed, the robot is loaded: nothing else is wrong with it."""
    file = tmp_path / ("r.xacro" if case.root else "r.urdf")
    file.write_text(f'<robot name="r" {case.root}>{case.content}</robot>')
    message = load(file, ())
    assert is_of(message, case.key), message
    alternatives = list_alternatives(message, case.filled)
    assert alternatives
    for proposed in alternatives:
        assert load(file, proposed) == "", proposed
