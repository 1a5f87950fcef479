"""The origin of this copy of evoros: version, commit and local changes.

Versions come from git tags, such as ``v1.2.0``. In a checkout, git is asked each time; a build
stores the origin (``hatch_build.py``), and ``git archive`` stores it in ``archive.txt``. The build
loads this file alone, so it must not import other modules of evoros.
"""

import json
import os
import re
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

FIRST = "0.1.0"  # the next version while there is no tag
RECORD = "origin.json"  # file in the package folder in which a build stores the origin
_PACKAGE = Path(__file__).resolve().parents[1]
_ROOT = _PACKAGE.parent
_ARCHIVE = Path(__file__).with_name("archive.txt")
_TAGS = ("--tags", "--long", "--abbrev=40", "--match=v[0-9]*")
_SOURCES = ("evoros", "analysis", "conf", "robots", "worlds", "pyproject.toml")
"""The paths in a checkout that a build contains."""


class Origin(NamedTuple):
    """The origin of a copy of evoros; unknown fields are None."""

    version: str
    commit: str | None = None
    dirty: bool | None = None  # True if files of evoros differ from the commit


@cache
def read_origin() -> Origin:
    """Return the origin of this copy of evoros."""
    return _ask_git() or _read_record() or _read_archive() or Origin(f"{FIRST}.dev0+unknown")


def _ask_git() -> Origin | None:
    if not (_ROOT / ".git").exists():
        return None
    commit = _git("rev-parse", "HEAD")
    changes = _git("status", "--porcelain", "--", *_SOURCES)
    if not commit or changes is None:
        return None
    described = _git("describe", *_TAGS) or f"-{_git('rev-list', '--count', 'HEAD') or 0}-"
    return Origin(form_version(described, commit, bool(changes)), commit, bool(changes))


def read_patch() -> str | None:
    """Return the changes to a checkout's sources as a patch, with new files; None if unknown."""
    changes = _git("diff", "--binary", "--no-ext-diff", "--no-color", "HEAD", "--", *_SOURCES)
    others = _git("ls-files", "-z", "--others", "--exclude-standard", "--", *_SOURCES)
    if not (_ROOT / ".git").exists() or changes is None or others is None:
        return None
    added = ("diff", "--binary", "--no-index", "--no-color", "--", "/dev/null")
    texts = [changes, *(_git(*added, name, status=1) for name in others.split("\0") if name)]
    return "".join(f"{text}\n\n" for text in texts if text)  # binary patches end with an empty line


def _git(*arguments: str, status: int = 0) -> str | None:
    """Run git in the checkout and return its output; None if git is missing or fails."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    command = ["git", "--no-optional-locks", "-C", str(_ROOT), *arguments]
    with suppress(OSError, subprocess.TimeoutExpired):
        done = subprocess.run(
            command,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=60,
            check=False,
            env=environment,
        )
        if done.returncode == status:
            return done.stdout.strip("\n")
    return None


def _read_record() -> Origin | None:
    with suppress(OSError, ValueError, TypeError):
        return Origin(**json.loads((_PACKAGE / RECORD).read_text(encoding="utf-8")))
    return None


def _read_archive() -> Origin | None:
    """Read the commit and the ``git describe`` output (empty if untagged) from archive.txt."""
    lines: Sequence[str] = ()
    with suppress(OSError):
        lines = _ARCHIVE.read_text(encoding="utf-8").splitlines()
    if not lines or not re.fullmatch("[0-9a-f]{40}", lines[0]):
        return None
    described = lines[1] if len(lines) > 1 and lines[1].startswith("v") else "-0-"
    if described.startswith("v") and not re.search(r"-\d+-g[0-9a-f]{40}$", described):
        described += "-0-"  # git describes a tagged commit by the tag alone
    return Origin(form_version(described, lines[0], False), lines[0], False)


def form_version(described: str, commit: str, dirty: bool) -> str:
    """Convert the output of ``git describe --long``, TAG-DISTANCE-..., to a PEP 440 version.

    The version of a tagged commit is the tag (``0.2.0``). Any other commit is a development version
    of the next release (``0.2.1.dev14+g0123456789``), which is ``FIRST`` if there is no tag.
    """
    tag, distance, _ = described.rsplit("-", 2)
    version = tag.removeprefix("v") or FIRST
    if tag and distance == "0" and not dirty:
        return version
    if tag:
        version = re.sub(r"\d+$", lambda match: str(int(match[0]) + 1), version)
    return f"{version}.dev{distance}+g{commit[:10]}{'.dirty' if dirty else ''}"
