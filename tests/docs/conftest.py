"""What the documents' examples share: the folder ``mine`` and a finished run in it."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from documents import files, write
from examples import short_run

import evoros


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
