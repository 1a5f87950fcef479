"""Private folders of users with a home, with none, and with one that does not help."""

import os
from pathlib import Path

import pytest
from fixture_types import Patch

from evoros.files.private import cache_home, find_home, hash_secret, keep_fonts, private_folder


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
