"""The version, the commit and whether files differ: of checkouts, archives, builds and copies."""

import json
import runpy
import subprocess
from pathlib import Path
from typing import Any

import pytest
from packaging.version import Version

from evoros.files import origin as module

FIRST = Version(module.FIRST)


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=Nobody", "-c", "user.email=nobody@example.org"]
    command = ["git", "-C", str(folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def commit(folder: Path, message: str = "A change") -> str:
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "--allow-empty", "-m", message)
    return git(folder, "rev-parse", "HEAD")


def read(folder: Path) -> Any:
    """Return the origin that the copy in a folder reports, loaded alone as a build does."""
    return runpy.run_path(str(folder / "evoros" / "base" / "origin.py"))["read_origin"]()


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A package that has nothing but its origin, and a page beside it."""
    base = tmp_path / "a copy" / "evoros" / "base"
    base.mkdir(parents=True)
    for name in ("origin.py", "archive.txt", ".gitattributes"):
        source = Path(module.__file__).with_name(name)
        (base / name).write_bytes(source.read_bytes())
    (tmp_path / "a copy" / "page.md").write_text("A page.\n")
    return tmp_path / "a copy"


@pytest.fixture
def checkout(copy: Path) -> Path:
    git(copy, "init", "-q")
    commit(copy)
    return copy


def test_a_copy_without_git_does_not_know(copy: Path) -> None:
    version, head, dirty = read(copy)
    assert (head, dirty) == (None, None)
    assert Version(version) < FIRST


def test_a_damaged_repository_stops_nothing(copy: Path) -> None:
    (copy / ".git").write_text("gitdir: nowhere\n")
    assert read(copy)[1:] == (None, None)


def test_versions_rise_from_commit_to_commit_and_tag_to_tag(checkout: Path) -> None:
    versions = [Version(read(checkout).version)]
    for tag in (None, "v0.1.0", None, None, "v0.2.0rc1", None, "v0.2.0", None, "v1.0.0"):
        head = commit(checkout)
        if tag:
            git(checkout, "tag", tag)
        version, told, dirty = read(checkout)
        assert (told, dirty) == (head, False)
        assert (str(Version(version)) == tag.removeprefix("v")) if tag else head[:10] in version
        versions.append(Version(version))
    assert versions == sorted(set(versions))


def test_a_tag_that_is_no_version_is_none(checkout: Path) -> None:
    git(checkout, "tag", "paper")
    assert Version(read(checkout).version) < FIRST


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        ("evoros/files/origin.py", True),  # committed and changed
        ("evoros/mine.py", True),  # not committed
        ("conf/failure/mine.yaml", True),
        ("page.md", False),  # no part of evoros
        ("outputs/run/config.yaml", False),
    ],
)
def test_files_of_evoros_that_differ_are_told(checkout: Path, file: str, counts: bool) -> None:
    git(checkout, "tag", "v1.2.3")
    path = checkout / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text((path.read_text() if path.exists() else "") + "\n# Mine\n")
    version, head, dirty = read(checkout)
    assert (head, dirty) == (git(checkout, "rev-parse", "HEAD"), counts)
    assert version.endswith(".dirty") == counts
    assert (version == "1.2.3") != counts


def test_a_tag_on_another_branch_does_not_count(checkout: Path) -> None:
    git(checkout, "checkout", "-q", "-b", "other")
    commit(checkout)
    git(checkout, "tag", "v3.0.0")
    git(checkout, "checkout", "-q", "-")
    assert Version(read(checkout).version) < FIRST


@pytest.mark.parametrize("tag", ["v0.3.0", ""])
@pytest.mark.parametrize("further", [0, 2])
def test_an_archive_knows_its_commit(
    checkout: Path, tmp_path: Path, tag: str, further: int
) -> None:
    if tag:
        git(checkout, "tag", tag)
    for _ in range(further):
        commit(checkout)
    archive, unpacked = tmp_path / "archive.tar", tmp_path / "unpacked"
    git(checkout, "archive", "--output", str(archive), "HEAD")
    unpacked.mkdir()
    subprocess.run(["tar", "-xf", archive, "-C", unpacked], check=True)
    expected, told = read(checkout), read(unpacked)
    assert told[1:] == expected[1:]
    if tag:  # without one, the number of commits is not in an archive
        assert told.version == expected.version


def test_a_build_keeps_what_was_recorded(copy: Path) -> None:
    record = {"version": "0.4.0", "commit": "1" * 40, "dirty": True}
    (copy / "evoros" / module.RECORD).write_text(json.dumps(record))
    assert tuple(read(copy)) == ("0.4.0", "1" * 40, True)


def test_variables_of_git_do_not_lead_elsewhere(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """git sets them for its hooks, in which tests may run."""
    other = tmp_path / "other"
    other.mkdir()
    git(other, "init", "-q")
    commit(other)
    head = git(checkout, "rev-parse", "HEAD")
    monkeypatch.setenv("GIT_DIR", str(other / ".git"))
    assert read(checkout).commit == head


def test_the_patch_makes_the_changed_files_of_the_commit(checkout: Path, tmp_path: Path) -> None:
    """Of text and bytes, changed and new; a page is no source."""
    sources = checkout / "evoros"
    (sources / "ends in blanks.py").write_text("a\n\n \n")
    (sources / "picture.png").write_bytes(bytes(range(256)))
    commit(checkout)
    patch = runpy.run_path(str(sources / "base" / "origin.py"))["read_patch"]
    assert patch() == ""
    git(checkout, "clone", "-q", str(checkout), str(tmp_path / "clean"))
    (sources / "ends in blanks.py").write_text("b\n\n \n")
    (sources / "picture.png").write_bytes(bytes(range(255, -1, -1)))
    (sources / "new file.py").write_text("new\n")
    (sources / "new.png").write_bytes(bytes(300))
    (checkout / "page.md").write_text("Another page.\n")
    (tmp_path / "patch").write_text(patch())
    git(tmp_path / "clean", "apply", str(tmp_path / "patch"))
    for file in sources.rglob("*.p*"):
        if "__pycache__" not in file.parts:
            other = tmp_path / "clean" / file.relative_to(checkout)
            assert other.read_bytes() == file.read_bytes(), file
    assert (tmp_path / "clean" / "page.md").read_text() == "A page.\n"
    assert "page.md" not in patch()
    assert str(checkout) not in patch()


def test_a_copy_without_git_has_no_patch(copy: Path) -> None:
    assert runpy.run_path(str(copy / "evoros" / "base" / "origin.py"))["read_patch"]() is None
