"""Finds files that are not where a description names them.

A package's CMakeLists.txt installs files at other places: ``$(find NAME)/x`` names a place in the
installed package, which ``install(DIRECTORY description/x DESTINATION share/NAME)`` fills from
elsewhere in the sources. People also write names in another case of letters, as ``Barrel.DAE`` for
``barrel.dae``, on systems that do not mind.
"""

import os
import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path, PurePosixPath

_COMMENT = re.compile(r"#[^\n]*")
_PROJECT = re.compile(r"\bproject\s*\(\s*\"?([^\s\")]+)", re.IGNORECASE)
_INSTALL = re.compile(r"\binstall\s*\(([^()]*)\)", re.IGNORECASE)
_WORD = re.compile(r'"([^"]*)"|(\S+)')
_SOURCES = ("DIRECTORY", "FILES", "PROGRAMS")
_SHARE = ("share/{}", "${{CATKIN_PACKAGE_SHARE_DESTINATION}}", "${{CMAKE_INSTALL_DATADIR}}/{}",
          "${{CMAKE_INSTALL_DATAROOTDIR}}/{}")  # fmt: skip


def find_installed(package: Path, inner: str) -> Path | None:
    """Return the source of the file or folder that is at ``inner`` in an installed package."""
    for place, source in _read_rules(package):
        if place == "." or inner == place or inner.startswith(f"{place}/"):
            rest = inner if place == "." else inner[len(place) :].lstrip("/")
            path = package / source / rest if rest else package / source
            if path.exists():
                return path
    return None


def locate(path: Path, packages: Iterable[Path]) -> Path | None:
    """Return an existing path, or the source of what is installed there in one of the packages."""
    if path.exists():
        return path
    for package in packages:
        if path.is_relative_to(package):
            installed = find_installed(package, str(path.relative_to(package)))
            if installed is not None:
                return installed
    return None


def find_in_any_case(path: Path) -> Path | None:
    """Return the only existing path that differs from an absolute one in case alone, or None."""
    here = Path(path.anchor)
    for part in path.parts[1:]:
        if not (here / part).exists():
            try:
                names = [name for name in os.listdir(here) if name.lower() == part.lower()]
            except OSError:
                return None
            if len(names) != 1:
                return None
            part = names[0]
        here /= part
    return here


@lru_cache(maxsize=1024)
def _read_rules(package: Path) -> tuple[tuple[str, str], ...]:
    """Return places in the share folder of a package, with the sources that fill them."""
    try:
        text = (package / "CMakeLists.txt").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    text = _COMMENT.sub("", text)
    project = _PROJECT.search(text)
    name = project[1] if project else package.name
    return tuple(
        rule
        for arguments in _INSTALL.findall(text)
        for rule in _read_rule(arguments.replace("${PROJECT_NAME}", name), name)
    )


def _read_rule(arguments: str, name: str) -> Iterator[tuple[str, str]]:
    words = [quoted or plain for quoted, plain in _WORD.findall(arguments)]
    if not words or words[0] not in _SOURCES or "DESTINATION" not in words[:-1]:
        return
    destination = words[words.index("DESTINATION") + 1].rstrip("/")
    share = next(filter(destination.startswith, (text.format(name) for text in _SHARE)), None)
    if share is None or destination[len(share) :][:1] not in ("", "/"):
        return
    folder = PurePosixPath(destination[len(share) :].lstrip("/"))
    for source in words[1 : words.index("DESTINATION")]:
        if source.isupper():  # a keyword, such as PATTERN
            return
        contents = words[0] == "DIRECTORY" and source.endswith("/")
        yield str(folder if contents else folder / PurePosixPath(source).name), source
