"""Bundled and private files, paths whose bytes are no UTF-8, and locks."""

import fcntl
import logging
import os
import shutil
from pathlib import Path

import pytest
import yaml
from fixture_types import Patch
from hypothesis import given
from hypothesis import strategies as st

from evoros.files.disk import NO_LOCKS, lock
from evoros.files.nested import parse_yaml
from evoros.files.private import cache_home, find_home, hash_secret, keep_fonts, private_folder
from evoros.files.resources import bundled_folder, find_file

NAME = "erle_rover/erle_rover.xacro"
BUNDLED = bundled_folder("robots") / NAME


@pytest.mark.parametrize("here", ["absent", "present", "linked", "started among the bundled"])
def test_a_file_in_the_current_folder_wins_over_a_bundled_one_and_it_is_told(
    here: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(bundled_folder("robots") if here.startswith("started") else tmp_path)
    own = tmp_path / NAME
    own.parent.mkdir()
    if here == "present":
        shutil.copy(BUNDLED, own)
    elif here == "linked":
        own.symlink_to(BUNDLED)
    with caplog.at_level(logging.WARNING):
        found = find_file(NAME, "robots")
    assert found == (own if here == "present" else BUNDLED)
    told = [f"{own} is used instead of {BUNDLED}; to use the bundled file, rename yours"]
    assert [record.getMessage() for record in caplog.records] == told * (here == "present")


@pytest.fixture
def without_home(tmp_path: Path, monkeypatch: Patch) -> Path:
    """The folder for temporary files of a user without a home, as in many containers."""
    monkeypatch.setattr("os.path.expanduser", lambda path: path)  # as without HOME and an entry
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_without_a_home_the_cache_is_among_the_temporary_files(
    without_home: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(without_home)
    assert find_home() is None
    folder = private_folder("code")
    assert folder is not None
    assert folder.is_relative_to(without_home / f"evoros-{os.getuid()}")
    assert cache_home().is_absolute()
    assert not (without_home / "~").exists()


@pytest.mark.parametrize("relative", ["", "cache", "~/cache"])
def test_a_relative_cache_is_ignored(relative: str, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", relative)
    assert cache_home() == tmp_path / ".cache"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become an unknown user")
def test_an_unknown_user_of_a_container_leaves_no_folder_named_tilde(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.delenv("HOME")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("tempfile.tempdir", ".")  # the parents of tmp_path are closed to others
    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o777)
    child = os.fork()
    if not child:
        os.setuid(54321)
        os._exit(0 if find_home() is None and private_folder("code") else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["evoros-54321"]


def test_a_file_system_without_hard_links_keeps_the_key_of_secrets(
    without_home: Path, monkeypatch: Patch
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("os.link", refuse)
    assert hash_secret("a") == hash_secret("a")
    (folder,) = without_home.rglob("key*")
    assert [path.name for path in folder.iterdir()] == ["secrets"]


@pytest.mark.parametrize("writable", [True, False])
def test_only_without_a_home_matplotlib_keeps_its_fonts_among_the_private_files(
    writable: bool, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setenv("MPLCONFIGDIR", "")  # restored afterwards
    monkeypatch.delenv("MPLCONFIGDIR")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("os.access", lambda path, _: writable or Path(path) != tmp_path)
    keep_fonts()
    kept = str(tmp_path / ".cache" / "evoros" / "matplotlib")
    assert os.environ.get("MPLCONFIGDIR") == (None if writable else kept)


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
