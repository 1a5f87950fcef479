"""YAML of paths whose bytes are no UTF-8, and locks where a file system has none."""

import fcntl
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from evoros.files.disk import NO_LOCKS, lock
from evoros.files.nested import parse_yaml


@given(st.binary(max_size=20).filter(lambda name: b"\0" not in name))
def test_a_path_of_any_bytes_is_read_as_yaml_writes_it(name: bytes) -> None:
    path = {"sdf": os.fsdecode(name)}
    assert parse_yaml(yaml.safe_dump(path)) == path


@pytest.mark.parametrize("answer", NO_LOCKS)
def test_a_file_system_without_locks_is_no_other_process(
    answer: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(answer, os.strerror(answer))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with (tmp_path / "table").open("w+b") as file:
        assert not lock(file)


def test_the_lock_of_another_is_an_error(tmp_path: Path) -> None:
    with (tmp_path / "table").open("w+b") as one, (tmp_path / "table").open("r+b") as other:
        assert lock(one)
        with pytest.raises(BlockingIOError):
            lock(other)
