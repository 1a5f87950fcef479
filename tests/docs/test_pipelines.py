"""The pipelines in docs/examples: their commands run as they are, and their files are there."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from documents import DOCS
from helpers import ROOT, USER_PARTS
from junitparser import JUnitXml

from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

DESIGN = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\n"
EXPERIMENT = """# @package _global_
defaults:
  - override /world: plains
  - override /simulator: bicycle
  - override /executor: serial
figures: []
world: {near: {course: {time_limit_s: 2}}, far: {course: {time_limit_s: 2}}}
"""
CLAIM = """_target_: evoros.requirement.requirements.collect
far:
  of: distance_m
  at_least: %s
  share: 0.5
"""
# tests/package/test_installation.py installs evoros in this way.
INSTALLS = 'pip install "git+$EVOROS"'


def read(name: str) -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((DOCS / "examples" / f"{name}.yml").read_text())
    return content


def list_steps() -> list[dict[str, Any]]:
    steps: list[dict[str, Any]] = read("github")["jobs"]["robot"]["steps"]
    return steps


def sh(script: str, folder: Path, **variables: str) -> int:
    """Run a script as both services do, until a command fails."""
    programs = variables.pop("programs", str(Path(sys.executable).parent))
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, **variables}
    words = ["bash", "-e", "-c", script]
    return subprocess.run(words, cwd=folder, env=environment).returncode


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A clone of a project, with a simulator that needs no compilation."""
    origin, clone = tmp_path / "origin", tmp_path / "clone"
    shutil.copytree(USER_PARTS, origin / "robot", ignore=shutil.ignore_patterns("__pycache__"))
    files = {
        "robot/designs.csv": DESIGN,
        "robot/experiment/mine.yaml": EXPERIMENT,
        "robot/requirements/mine.yaml": CLAIM % 0.1,
    }
    for name, content in files.items():
        (origin / name).parent.mkdir(parents=True, exist_ok=True)
        (origin / name).write_text(content)
    who = "git -c user.name=t -c user.email=t@example.org"
    assert sh(f"git init -q -b main && git add . && {who} commit -q -m base", origin) == 0
    assert sh(f"git clone -q {origin} clone", tmp_path) == 0
    return clone


def require_artifacts(project: Path) -> None:
    assert [suite.name for suite in JUnitXml.fromfile(str(project / "tested" / "junit.xml"))]
    for name in ("requirements.md", "figures/requirements.html", "missions.csv"):
        assert (project / "tested" / name).is_file()


@pytest.mark.slow
def test_github(project: Path) -> None:
    steps = list_steps()
    assert steps[2]["run"] == INSTALLS
    scripts = {step["name"]: step["run"] for step in steps if "name" in step}
    summary = project.parent / "summary.md"
    variables = {"GITHUB_STEP_SUMMARY": str(summary), "GITHUB_BASE_REF": "main"}
    assert sh(scripts["Requirements"], project, **variables) == DONE
    assert "| **met** | far: " in summary.read_text()
    require_artifacts(project)
    assert sh(scripts["Regression"], project, **variables) == DONE
    assert (project / "compared" / "regression_margins.csv").is_file()


def test_the_status_of_the_requirements_ends_the_job(tmp_path: Path) -> None:
    """With a command in place of evoros that only ends as it does."""
    (script,) = (step["run"] for step in list_steps() if step.get("name") == "Requirements")
    for status in (NOT_MET, NOT_DECIDED):
        write = f"mkdir -p tested; echo ended {status} > tested/requirements.md"
        (tmp_path / "evoros").write_text(f"#!/bin/sh\n{write}; exit {status}\n")
        (tmp_path / "evoros").chmod(0o755)
        variables = {"GITHUB_STEP_SUMMARY": "summary.md", "programs": str(tmp_path)}
        assert sh(script, tmp_path, **variables) == status
        assert f"ended {status}\n" in (tmp_path / "summary.md").read_text()


def test_gitlab_runs_the_commands_of_github() -> None:
    content = read("gitlab")
    addresses = (read("github")["jobs"]["robot"]["env"], content["variables"])
    assert all(one["EVOROS"].endswith("/YOU/evoros@main") for one in addresses)
    assert content["default"]["before_script"] == [INSTALLS]
    scripts = {step.get("name"): step.get("run", "") for step in list_steps()}
    for name in ("requirements", "regression"):
        job: Mapping[str, Any] = content[name]
        assert job["allow_failure"] == {"exit_codes": NOT_DECIDED}
        for line in job["script"]:
            typed = line.replace("CI_MERGE_REQUEST_TARGET_BRANCH_NAME", "GITHUB_BASE_REF")
            assert typed in scripts[name.capitalize()]
        (folder,) = job["artifacts"]["paths"]
        assert f"={folder}" in job["script"][0] or f"--output {folder}" in job["script"][-1]
    assert content["requirements"]["artifacts"]["reports"]["junit"] == "tested/junit.xml"


def test_the_container_has_the_versions_that_the_documents_and_the_tests_use() -> None:
    """The steps themselves are run by .ci/container, which takes minutes."""
    steps = re.findall(r"^([A-Z]+) (.+)$", (ROOT / "Containerfile").read_text(), re.M)
    known = set(re.findall(r"^    ([A-Z]+)\)", (ROOT / ".ci" / "container").read_text(), re.M))
    assert {name for name, _ in steps} <= known
    (release,) = (rest for name, rest in steps if name == "FROM")
    assert release == "debian:12"  # as the README and .ci/run
    (rclpy,) = (rest for _, rest in steps if "ros-rclpy" in rest)
    page = (ROOT / "evoros" / "plugins" / "ros" / "README.md").read_text()
    wanted = set(re.findall(r"ros-[\w-]+(?:\[\w+\])?==[\d.]+", page))
    assert wanted == set(re.findall(r"ros-[\w-]+(?:\[\w+\])?==[\d.]+", rclpy))
    order = [name for name, _ in steps]
    assert order.index("USER") > max(i for i, name in enumerate(order) if name == "RUN")
