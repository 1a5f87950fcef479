"""Neither packages that nobody has declared nor variables of libraries decide what evoros does."""

import os
import subprocess
import sys
from importlib.metadata import distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from evoros.cli.main import evoros
from evoros.terminal.console import DONE

INSTALLERS = {"pip", "setuptools", "wheel", "uv"}
SMALL = (
    *("world=blocks", "executor=serial", "figures=[]", "record=none", "optimizer.generations=1"),
    *("optimizer.population_size=2", "optimizer.validation_trials=0", "validation.trials=1"),
)


def list_required(name: str, extra: str, known: set[tuple[str, str]]) -> None:
    """Add what an extra of a package needs, directly and through others."""
    if (name, extra) in known:
        return
    known.add((name, extra))
    for text in requires(name) or ():
        wanted = Requirement(text)
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": extra}):
            continue
        for inner in ("", *wanted.extras):
            list_required(canonicalize_name(wanted.name), inner, known)


def test_the_environment_of_the_tests_has_the_declared_packages_and_no_others() -> None:
    known: set[tuple[str, str]] = set()
    list_required("evoros", "dev", known)
    installed = {canonicalize_name(package.metadata["Name"]) for package in distributions()}
    assert installed - {name for name, _ in known} <= INSTALLERS


@pytest.mark.slow
def test_variables_of_numba_change_no_byte(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "evoros", *SMALL, f"hydra.run.dir={tmp_path / 'set'}"]
    variables = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run(command, env=variables, check=True, capture_output=True)
    assert evoros([*SMALL, f"hydra.run.dir={tmp_path / 'plain'}"]) == DONE
    set_table, plain = (
        (tmp_path / name / "missions.csv").read_bytes() for name in ("set", "plain")
    )
    assert set_table == plain
