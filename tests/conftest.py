"""Fixtures of several files: the documents' folder ``mine``, and experiments in PyBullet."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from documents import files, write
from examples import short_run
from pybullet_cases import short_experiment

import evoros
from evoros.evolution.experiment import Experiment
from evoros.simulator.pybullet import close_engines

pytest_plugins = ["missing_engine"]


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A current folder with the folder ``mine`` that extending.md describes."""
    folder = tmp_path_factory.mktemp("extending")
    write(files("extending"), folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", list(sys.path))
        yield folder


@pytest.fixture(scope="module")
def finished(mine: Path) -> evoros.Run:
    return short_run("outputs/mine", ["failure=frontal", "figures=[overlay,fitness,mission]"])


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return short_experiment()


@pytest.fixture
def closed_engines() -> Iterator[None]:
    """PyBullet's engines of this process, closed after the test."""
    yield
    close_engines()
