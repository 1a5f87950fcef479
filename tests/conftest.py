"""Fixtures of several files: the documents' folder ``mine``, and experiments in PyBullet."""

import copy
import gc
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from documents import part_files, write
from examples import short_run
from hydra._internal.config_repository import ConfigRepository
from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigResult
from hypothesis import settings
from pybullet_cases import short_experiment

import evoros
from evoros.evolution.experiment import Experiment
from evoros.files.resources import bundled_folder
from evoros.formats.urdf import xacro_expansion
from evoros.session.screen import Pipe
from evoros.simulator.pybullet import close_engines

pytest_plugins = ["needs"]
# Processes that tests start keep the bytecode of evoros, which costs each of them half a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# A first example may build an experiment, and no property is a time.
settings.register_profile("evoros", deadline=None)
settings.load_profile("evoros")


def pytest_collection_finish() -> None:
    """Leave what is imported and collected out of garbage collections, which then take less."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def expanded_once() -> Iterator[None]:
    """Expand bundled robots once: the process for it takes an eighth of a second each time."""
    robots, expand = bundled_folder("robots"), xacro_expansion._run_child
    answers: dict[str, tuple[int, str, str]] = {}

    def expand_once(request: str, folder: Path, patience_s: float) -> tuple[int, str, str]:
        if not folder.is_relative_to(robots):
            return expand(request, folder, patience_s)
        key = json.dumps({**json.loads(request), "path": None})
        if key not in answers:
            answers[key] = expand(request, folder, patience_s)
        return answers[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(xacro_expansion, "_run_child", expand_once)
        yield


@pytest.fixture(scope="session", autouse=True)
def read_once() -> Iterator[None]:
    """Read bundled configuration files once: a third of the time in which Hydra composes."""
    load, results = ConfigRepository.load_config, dict[str, ConfigResult | None]()
    bundled = (str(bundled_folder("conf")), "hydra.conf")

    def load_once(self: ConfigRepository, config_path: str) -> ConfigResult | None:
        source = self._find_object_source(config_path, ObjectType.CONFIG)
        if source is None or source.path not in bundled:
            return load(self, config_path)
        if config_path not in results:
            results[config_path] = load(self, config_path)
        return copy.deepcopy(results[config_path])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConfigRepository, "load_config", load_once)
        yield


@pytest.fixture(scope="session", autouse=True)
def no_line_of_progress() -> Iterator[None]:
    """Keep what tests read from standard error independent of how long their runs take."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pipe, "first_s", 1e6)
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


@pytest.fixture
def closed_engines() -> Iterator[None]:
    """PyBullet's engines of this process, closed after the test."""
    yield
    close_engines()
