"""Starts, identifies and stops the processes of the user's nodes."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Collection


class Nodes:
    """The processes that the commands started, in the order of the commands."""

    def __init__(
        self,
        commands: list[list[str]],
        environment: dict[str, str],
        completed: list[list[str]] | None = None,
    ) -> None:
        """Start all commands, in the form ``completed`` if given; messages quote ``commands``.

        ``python3`` in a command or in a node's shebang line resolves to this process's Python.

        Raises:
            OSError: a command cannot be executed.
        """
        self._commands = commands
        path = os.pathsep.join([os.path.dirname(sys.executable), environment.get("PATH", "")])
        self._processes = [
            subprocess.Popen(command, env={**environment, "PATH": path}, stdin=subprocess.DEVNULL)
            for command in completed or commands
        ]

    def ended(self) -> str | None:
        """Describe a process that has exited, or return an empty string."""
        for process, command in zip(self._processes, self._commands):
            status = process.poll()
            if status is not None:
                how = f"with status {status}" if status >= 0 else f"on signal {-status}"
                return f"the node {shlex.join(command)} exited {how}"
        return None

    def place(self, pid: int) -> int | None:
        """Return the index of the command that started this process or an ancestor of it."""
        places = {process.pid: index for index, process in enumerate(self._processes)}
        while pid > 1:
            if pid in places:
                return places[pid]
            pid = _parent(pid)
        return None

    def others(self, places: Collection[int | None]) -> list[str]:
        """Return the commands whose indices are not in ``places``."""
        commands = enumerate(self._commands)
        return [shlex.join(command) for index, command in commands if index not in places]


def _parent(pid: int) -> int:
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return int(file.read().rpartition(b")")[2].split()[1])
    except OSError:
        return 0
