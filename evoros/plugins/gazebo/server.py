"""A server process that runs Gazebo's physics, and its cached simulations."""

import fcntl
import hashlib
import os
import shutil
import struct
import subprocess
import tempfile
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from enum import IntEnum
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, SimulationError, single_line
from evoros.bridge.pipes import start_pipes
from evoros.files.private import private_folder
from evoros.plugins.gazebo.gazebo_world import describe_scene
from evoros.simulator.engines.mujoco_model import Settings
from evoros.simulator.engines.teams import describe_for_engine, name_robots
from evoros.simulator.protocol import PlacedRobot
from evoros.terminal.activity import announce
from evoros.world.model import World

SOURCE = Path(__file__).with_name("gazebo_server.cc")
INSTALL = (
    "install with `apt-get install --no-install-recommends g++ pkg-config libeigen3-dev "
    "libignition-physics-core-dev libignition-physics-sdf-dev libignition-physics-mesh-dev "
    "libignition-physics5-dartsim-plugin5 libsdformat-dev` on Debian 12"
)
WORDS = 300  # maximum length of a compiler message quoted in errors [characters]


class Release(NamedTuple):
    """A Gazebo release, with the pkg-config names of its libraries."""

    name: str
    physics: str
    common: str
    plugin: str
    sdformat: str
    flags: tuple[str, ...] = ()

    @property
    def libraries(self) -> tuple[str, ...]:
        """The pkg-config names of all libraries that the server uses."""
        parts = (f"{self.physics}-sdf", f"{self.physics}-mesh", f"{self.common}-graphics")
        return (self.physics, *parts, f"{self.plugin}-loader", self.common, self.sdformat)


_OF_FORTRESS = "ignition-physics5", "ignition-common4", "ignition-plugin1", "sdformat12"
RELEASES = (
    Release("Jetty", "gz-physics", "gz-common", "gz-plugin", "sdformat"),
    Release("Ionic", "gz-physics8", "gz-common6", "gz-plugin3", "sdformat15"),
    Release("Harmonic", "gz-physics7", "gz-common5", "gz-plugin2", "sdformat14"),
    Release("Fortress", *_OF_FORTRESS, ("-DEVOROS_IGNITION",)),
)
"""Supported releases, newest first; only Fortress has been tested."""


class Library(NamedTuple):
    """The installed release, the versions of its parts, and the compiler arguments."""

    release: Release
    versions: Mapping[str, str]
    arguments: tuple[str, ...]


@cache
def find_library() -> Library:
    """Return the newest release whose libraries are all installed."""
    for program in ("pkg-config", "g++"):
        if shutil.which(program) is None:
            raise InputError(f"simulator=gazebo: program {program} not found; {INSTALL}")
    lacking = []
    for release in RELEASES:
        found = _call("pkg-config", "--print-errors", "--cflags", "--libs", *release.libraries)
        if found.returncode == 0:
            versions = {
                name: _call("pkg-config", "--modversion", name).stdout.strip()
                for name in (release.physics, release.sdformat)
            }
            return Library(release, versions, (*release.flags, *found.stdout.split()))
        if _call("pkg-config", "--exists", release.physics).returncode == 0:
            lacking.append(single_line(found.stderr)[:WORDS])
    known = ", ".join(release.physics for release in RELEASES)
    reason = lacking[0] if lacking else f"pkg-config found none of {known}"
    raise InputError(f"simulator=gazebo: needs Gazebo's physics library ({reason}); {INSTALL}")


def _call(*command: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace")


def compile_server() -> Path:
    """Return the path of the compiled server; if another process is compiling it, wait."""
    library = find_library()
    recipe = (SOURCE.read_text(encoding="utf-8"), *library.versions.values(), *library.arguments)
    key = hashlib.sha256("\0".join(recipe).encode()).hexdigest()[:16]
    folder = private_folder("gazebo")
    if folder is None:
        raise InputError(
            "simulator=gazebo: needs a folder that only this user can write to, for the compiled "
            "server; set XDG_CACHE_HOME to such a folder"
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
    with tempfile.TemporaryDirectory(dir=server.parent) as folder:
        made = Path(folder) / "server"
        options = ("-std=c++17", "-O2", "-o", str(made), str(SOURCE))
        done = _call("g++", *options, *library.arguments)
        if done.returncode != 0:
            lines = [line for line in done.stderr.splitlines() if "error" in line] or [done.stderr]
            raise InputError(
                f"simulator=gazebo: {SOURCE.name} does not compile with {library.release.physics} "
                f"{library.versions[library.release.physics]} ({single_line(lines[0])[:WORDS]}); "
                f"{INSTALL}, or use simulator=mujoco"
            )
        os.replace(made, server)


_REQUEST = struct.Struct("=iiiiq")  # operation, simulation, steps, 1 to list contacts, size
_ANSWER = struct.Struct("=qq")  # 1 for an error, size of the answer
_READ_BYTES = 1 << 16


class Operation(IntEnum):
    """The operations of the server; PROBE is used only by tests."""

    START, OPEN, RESET, ADVANCE, FORGET, PROBE = range(6)


class GazeboServer:
    """Starts the server, which has a private home and ends with this process; not thread-safe."""

    def __init__(self, program: Path, limit_s: float) -> None:
        """Start the program; an answer may take up to ``limit_s`` [s] of wall-clock time."""
        self.limit_s = limit_s
        with ExitStack() as stack:
            starting = start_pipes([str(program)], isolate=False, environment={})
            self._pipes = stack.enter_context(starting)
            try:
                self.ask(Operation.START, 0)
            except SimulationError as error:
                raise InputError(f"simulator=gazebo: {error}; {INSTALL}") from error
            self._stack = stack.pop_all()

    def close(self) -> None:
        """End the process."""
        self._stack.close()

    def ask(
        self,
        operation: Operation,
        number: int,
        body: bytes = b"",
        steps: int = 0,
        feeling: bool = False,
        time: float | None = None,
    ) -> Array:
        """Send a request for simulation ``number``, and return the values in the answer."""
        self._pipes.begin(self.limit_s, time)
        self._pipes.send(_REQUEST.pack(operation, number, steps, feeling, len(body)) + body)
        data = self._pipes.receive(_READ_BYTES)
        while len(data) < _ANSWER.size:
            data += self._pipes.receive(_READ_BYTES)
        failed, size = _ANSWER.unpack_from(data)
        parts, missing = [data], _ANSWER.size + size - len(data)
        while missing > 0:
            parts.append(self._pipes.receive(_READ_BYTES))
            missing -= len(parts[-1])
        answer = b"".join(parts)
        if failed:
            reason = answer[_ANSWER.size :].decode(errors="replace")
            raise SimulationError(f"Gazebo: {single_line(reason)}")
        return np.frombuffer(answer, offset=_ANSWER.size)


KEPT = 4  # number of cached simulations, which later trials of a design use again


class Scene(NamedTuple):
    """A simulation in a server, and its initial values in a mission."""

    server: GazeboServer
    number: int
    values: Array


class Engine:
    """A server for one mission at a time, with cached simulations."""

    def __init__(self, program: Path, limit_s: float) -> None:
        self._server = GazeboServer(program, limit_s)
        self._kept: OrderedDict[tuple[Any, ...], int] = OrderedDict()
        self._numbers = count()

    def close(self) -> None:
        """End the server, after which the engine is unusable."""
        self._server.close()

    def limit(self, seconds: float) -> None:
        """Set the wall-clock limit [s] for each answer."""
        self._server.limit_s = seconds

    def forget(self) -> None:
        """Discard all cached simulations."""
        while self._kept:
            self._drop_oldest()

    def prepare(self, robots: Sequence[PlacedRobot], world: World, settings: Settings) -> Scene:
        """Return a simulation at the start of a mission: cached and reset, or new."""
        described = tuple((*describe_for_engine(robot), home) for robot, home in robots)
        sizes = () if world.crowd is None else world.crowd.sizes
        source = (described, world.bodies, world.gravity_mps2, settings, sizes)
        number = self._kept.pop(source, None)
        if number is not None:
            values = self._server.ask(Operation.RESET, number)
        else:
            values = self._open(number := next(self._numbers), robots, world, settings)
        self._kept[source] = number
        while len(self._kept) > KEPT:
            self._drop_oldest()
        return Scene(self._server, number, values)

    def _open(
        self, number: int, robots: Sequence[PlacedRobot], world: World, settings: Settings
    ) -> Array:
        scene = describe_scene(robots, world, settings)
        try:
            return self._server.ask(Operation.OPEN, number, scene)
        except SimulationError as error:
            raise SimulationError(
                f"{name_robots(robots)} in the world {world.name!r}: {error}; try "
                "simulator=pybullet or simulator=planar"
            ) from error

    def _drop_oldest(self) -> None:
        _, number = self._kept.popitem(last=False)
        self._server.ask(Operation.FORGET, number)
