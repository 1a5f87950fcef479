"""Gazebo's physics library: which of its versions is installed, and the server compiled for it."""

import fcntl
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from evoros.base.errors import InputError, single_line
from evoros.files.private import private_folder
from evoros.terminal.activity import announce

SOURCE = Path(__file__).with_name("gazebo_server.cc")
PACKAGES = (
    "g++ pkg-config libeigen3-dev libignition-physics-core-dev libignition-physics-sdf-dev "
    "libignition-physics-mesh-dev libignition-physics5-dartsim-plugin5 libsdformat-dev"
)
"""Of Debian 12."""
INSTALL = f"install with `apt-get install --no-install-recommends {PACKAGES}` on Debian 12"
WORDS = 300
"""Characters of a compiler's message in an error."""


class Release(NamedTuple):
    """A release of Gazebo, by the names that pkg-config knows."""

    name: str
    physics: str
    common: str
    plugin: str
    sdformat: str
    flags: tuple[str, ...] = ()

    @property
    def libraries(self) -> tuple[str, ...]:
        """The names of all libraries of the server."""
        parts = (f"{self.physics}-sdf", f"{self.physics}-mesh", f"{self.common}-graphics")
        return (self.physics, *parts, f"{self.plugin}-loader", self.common, self.sdformat)


RELEASES = (
    Release("Jetty", "gz-physics", "gz-common", "gz-plugin", "sdformat"),
    Release("Ionic", "gz-physics8", "gz-common6", "gz-plugin3", "sdformat15"),
    Release("Harmonic", "gz-physics7", "gz-common5", "gz-plugin2", "sdformat14"),
    Release(
        "Fortress",
        "ignition-physics5",
        "ignition-common4",
        "ignition-plugin1",
        "sdformat12",
        ("-DEVOROS_IGNITION",),
    ),
)
"""The newest comes first. Only Fortress's is tested."""


class Library(NamedTuple):
    """The installed release, with the versions of its parts and the arguments to compile for it."""

    release: Release
    versions: Mapping[str, str]
    arguments: tuple[str, ...]


@cache
def find_library() -> Library:
    """Find the newest release whose libraries are all installed, and a compiler.

    Raises:
        InputError: there is none.
    """
    for program in ("pkg-config", "g++"):
        if shutil.which(program) is None:
            raise InputError(f"simulator=gazebo: needs the program {program}; {INSTALL}")
    lacking = []
    for release in RELEASES:
        found = _call("pkg-config", "--print-errors", "--cflags", "--libs", *release.libraries)
        if found.returncode == 0:
            versions = {name: _read_version(name) for name in (release.physics, release.sdformat)}
            return Library(release, versions, (*release.flags, *found.stdout.split()))
        if _call("pkg-config", "--exists", release.physics).returncode == 0:
            lacking.append(single_line(found.stderr)[:WORDS])
    known = " and ".join(release.physics for release in RELEASES)
    reason = lacking[0] if lacking else f"pkg-config knows none of {known}"
    raise InputError(f"simulator=gazebo: needs Gazebo's physics library ({reason}); {INSTALL}")


def _read_version(name: str) -> str:
    return _call("pkg-config", "--modversion", name).stdout.strip()


def _call(*command: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace")


def compile_server() -> Path:
    """Return the compiled server, which one process compiles and all others wait for.

    Its name is a hash of its source and of the libraries.

    Raises:
        InputError: it cannot be compiled, or there is no place for it.
    """
    library = find_library()
    recipe = (SOURCE.read_text(encoding="utf-8"), *library.versions.values(), *library.arguments)
    key = hashlib.sha256("\0".join(recipe).encode()).hexdigest()[:16]
    folder = private_folder("gazebo")
    if folder is None:
        raise InputError(
            "simulator=gazebo: needs a folder for the compiled server that only this user can "
            "write to; set XDG_CACHE_HOME to such a folder"
        )
    server = folder / f"gazebo_server-{key}"
    if server.exists():
        return server
    with (folder / "lock").open("w") as lock, announce("compiling Gazebo's server"):
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not server.exists():
            _compile(server, library)
    return server


def _compile(server: Path, library: Library) -> None:
    """Compile the server, all or nothing."""
    with tempfile.TemporaryDirectory(dir=server.parent) as folder:
        made = Path(folder) / "server"
        options = ("-std=c++17", "-O2", "-o", str(made), str(SOURCE))
        done = _call("g++", *options, *library.arguments)
        if done.returncode != 0:
            lines = [line for line in done.stderr.splitlines() if "error" in line] or [done.stderr]
            raise InputError(
                f"simulator=gazebo: {SOURCE.name} must compile with {library.release.physics} "
                f"{library.versions[library.release.physics]} ({single_line(lines[0])[:WORDS]}); "
                f"{INSTALL}, or use simulator=mujoco"
            )
        os.replace(made, server)
