"""Runs a mission with the user's nodes, for the bridges to ROS 1 and ROS 2."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Sequence
from typing import Any

from .conversation import OWN_SHARE, Conversation, Modes, Wheels, end
from .rest import Hidden, Rest

NO_COMMAND = "no node sent a command; unlike answer=rest, answer=each needs a command at each tick"


def fly_mission(
    ros: str, needed: Sequence[str], advice: str, create: Callable[[Conversation, Rest, float], Any]
) -> None:
    """Run one mission and exit; ``create`` must create the mission by a monotonic time [s]."""
    conversation = Conversation()
    options = conversation.briefing["ros"]
    until = time.monotonic() + OWN_SHARE * options["start_limit_s"]
    conversation.require(ros, needed, advice)
    try:
        rest = Rest(options["isolate"])
    except OSError as error:
        conversation.refuse(
            f"the system does not show what threads wait for ({error}); use Linux with a full /proc"
        )
    try:
        mission = create(conversation, rest, until)
        mission.connect(until)
        conversation.ready()
        mission.fly()
    except Hidden as error:
        conversation.fail(f"controller.nodes: {error}")
    os._exit(0)  # does not wait for ROS threads


class Nodes:
    """The processes started by the commands, in the same order."""

    def __init__(
        self,
        commands: list[list[str]],
        environment: dict[str, str],
        completed: list[list[str]] | None = None,
    ) -> None:
        """Start the commands; error messages quote ``commands`` even if ``completed`` is run.

        ``python3`` in a command or in a node's shebang line resolves to this process's Python.
        """
        self._commands = commands
        path = os.pathsep.join([os.path.dirname(sys.executable), environment.get("PATH", "")])
        self._processes = [
            subprocess.Popen(command, env={**environment, "PATH": path}, stdin=subprocess.DEVNULL)
            for command in completed or commands
        ]

    def ended(self) -> str | None:
        """Describe a process that has exited; None if all are running."""
        for process, command in zip(self._processes, self._commands):
            status = process.poll()
            if status is not None:
                how = f"with status {status}" if status >= 0 else f"on signal {-status}"
                return f"the node {shlex.join(command)} exited {how}"
        return None

    def place(self, pid: int) -> int | None:
        """Return the index of the command that started a process or one of its ancestors."""
        places = {process.pid: index for index, process in enumerate(self._processes)}
        while pid > 1:
            if pid in places:
                return places[pid]
            pid = _parent(pid)
        return None

    def others(self, places: Collection[int | None]) -> list[str]:
        """Return the commands with indices outside ``places``."""
        commands = enumerate(self._commands)
        return [shlex.join(command) for index, command in commands if index not in places]


def _parent(pid: int) -> int:
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return int(file.read().rpartition(b")")[2].split()[1])
    except OSError:
        return 0


class Crew:
    """The user's nodes and their commands; nodes must keep running and must come to rest."""

    def __init__(self, conversation: Conversation, rest: Rest, start: Callable[[], Nodes]) -> None:
        briefing = conversation.briefing
        self.options: dict[str, Any] = briefing["ros"]
        self.rest = rest
        self.modes = Modes(briefing["modes"])
        self._conversation = conversation
        self._wheels = Wheels(briefing["drive"], self.options["twist"])
        try:
            self.nodes = start()
        except ValueError as error:
            conversation.refuse(str(error))
        except OSError as error:
            conversation.refuse(
                f"controller.nodes: this system cannot execute "
                f"{error.filename} ({error.strerror}); change the command or install the program"
            )

    def require_start(self, until: float, missing: Callable[[], str | None]) -> None:
        """Reject the mission once a monotonic time [s] has passed, and name what is missing."""
        if time.monotonic() > until:
            limit = f"{self.options['start_limit_s']:g} s"
            self._conversation.refuse(
                f"controller.nodes: not ready after {limit}, because {missing() or self.unrest()}; "
                f"correct the nodes, or raise start_limit_s"
            )

    def require_nodes(self) -> None:
        """End the mission if a node has exited."""
        ended = self.nodes.ended()
        if ended is not None:
            end(ended)

    def require_rest(self, until: float) -> None:
        """Wait until all nodes are at rest; at a monotonic time [s], end the mission."""
        if not self.rest.wait(until - time.monotonic()):
            end(self.unrest())

    def unrest(self) -> str:
        """Describe the busy nodes."""
        return f"the nodes did not come to rest: {'; '.join(self.rest.working())}"

    def answer(self, commands: Sequence[Any]) -> None:
        """Answer a tick with the last of the commands, or with no decision."""
        if not commands:
            self._conversation.answer(0, 0.0, 0.0)
            return
        for message in commands:
            speed, steering = self._wheels.read(message)
        self._conversation.answer(self.modes.now, speed, steering)
