"""Faults of Gazebo's server: programs in its place, processes that are killed, other libraries."""

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from evoros.files.private import cache_home
from evoros.plugins.gazebo.server import compile_server

Replace = Callable[[str], Path]
"""Puts a shell script in the place of the server; ``{server}`` in it is the real one."""


def own_cache(folder: Path) -> None:
    """Make a folder a cache that has all of evoros's but Gazebo's server."""
    ours = folder / "evoros"
    ours.mkdir(mode=0o700)
    (ours / "gazebo").mkdir(mode=0o700)
    for path in (cache_home() / "evoros").iterdir():
        if path.name != "gazebo":
            (ours / path.name).symlink_to(path)


def replace_server(folder: Path, script: str) -> Path:
    """Put a script in the place of the server in a cache of ``own_cache``."""
    server = compile_server()
    path = folder / "evoros" / "gazebo" / server.name
    path.unlink(missing_ok=True)
    path.write_text(f"#!/bin/sh\n{script.format(server=server)}\n")
    path.chmod(0o700)
    return path


def write_program(folder: Path, name: str, script: str) -> None:
    """Write a program of a name into a folder."""
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


MARK = "EVOROS_TEST_OF_GAZEBO"
os.environ[MARK] = str(os.getpid())
"""Tells this session's processes from those of others on the machine."""


def find_servers() -> Iterator[int]:
    """Yield the processes of this session that are servers, or scripts in their place."""
    mark = f"{MARK}={os.environ[MARK]}".encode()
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended
            words = path.read_bytes().split(b"\0")
            is_server = any(b"/gazebo_server-" in word for word in words)
            if is_server and mark in (path.parent / "environ").read_bytes().split(b"\0"):
                yield int(path.parent.name)


def list_ports(process: int) -> list[str]:
    """List the addresses on which a process listens, as the kernel writes them."""
    links = [os.readlink(path) for path in Path(f"/proc/{process}/fd").iterdir()]
    rows = [
        row.split()
        for table in ("tcp", "tcp6", "udp", "udp6")
        for row in Path(f"/proc/net/{table}").read_text().splitlines()[1:]
    ]
    return [row[1] for row in rows if f"socket:[{row[9]}]" in links]
