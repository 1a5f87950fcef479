"""Fixtures of several files: the documents' folder ``mine``, and experiments in PyBullet."""

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from documents import part_files, write
from examples import short_run
from hypothesis import settings
from pure_calls import share_pure_calls
from pybullet_cases import short_experiment

import evoros
from evoros.base.lazy import collect_rarely
from evoros.evolution.experiment import Experiment
from evoros.session.screen import Pipe
from evoros.simulator.pybullet import IDLE
from evoros.terminal import activity

# Processes that tests start keep the bytecode of evoros, which costs each of them half a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# A first example may build an experiment, and no property is a time.
settings.register_profile("evoros", deadline=None, max_examples=50)
settings.register_profile("few", deadline=None, max_examples=10)  # of .ci/pythons
settings.load_profile("evoros")


_SHARED = ExitStack()


def pytest_sessionstart() -> None:
    """Make costly pure calls once in each process of tests, collection included."""
    gc.disable()
    _SHARED.enter_context(share_pure_calls())


def pytest_sessionfinish() -> None:
    """Make them as before, and leave all out of pytest's last garbage collections."""
    _SHARED.close()
    gc.freeze()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import files without slow tests if only these are asked for."""
    only_slow = config.getoption("markexpr") == "slow" and collection_path.suffix == ".py"
    return True if only_slow and "slow" not in collection_path.read_text() else None


def pytest_collection_finish() -> None:
    """Leave what is imported and collected out of garbage collections, which begin now."""
    collect_rarely()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def no_line_of_progress() -> Iterator[None]:
    """Keep what tests read from standard error independent of how long their runs take."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pipe, "first_s", 1e6)
        patch.setattr(activity, "SLOW_S", 1e6)
        yield


@pytest.fixture(scope="session", autouse=True)
def no_wait_for_the_disk() -> Iterator[None]:
    """Let the system write files when it likes, because no test of this process loses power.

    ``benchmarks/faults/disk.py``, which does, takes the place of the same call.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        yield


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A current folder with a folder ``mine`` that has the parts of all pages of docs/parts."""
    folder = tmp_path_factory.mktemp("parts")
    write(part_files(), folder)
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


@pytest.fixture(scope="module")
def closed_engines() -> Iterator[None]:
    """PyBullet's and Gazebo's engines of this process, closed after the tests of a file.

    They share them, as missions do, because Gazebo's server takes a third of a second to start.
    """
    yield
    _close_engines()


@pytest.fixture
def own_engines() -> Iterator[None]:
    """The same, closed after each test, for those of how engines start and end."""
    yield
    _close_engines()


def _close_engines() -> None:
    IDLE.close()
    gazebo = sys.modules.get("evoros.plugins.gazebo.simulator")
    if gazebo is not None:
        gazebo.IDLE.close()
