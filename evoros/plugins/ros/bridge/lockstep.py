"""The mission with the user's nodes, shared by the bridges to ROS 1 and ROS 2."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

from .conversation import OWN_SHARE, Conversation, Modes, Wheels, end
from .nodes import Nodes
from .rest import Hidden, Rest

NO_COMMAND = (
    "no node sent a command; answer=each needs a command at each tick, answer=rest does not"
)


def fly_mission(
    ros: str, needed: Sequence[str], advice: str, create: Callable[[Conversation, Rest, float], Any]
) -> None:
    """Run one mission and exit; ``create`` must make the mission before a monotonic time [s]."""
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


class Crew:
    """The user's nodes and their commands; the nodes must keep running and come to rest."""

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
        """Reject the mission after a monotonic time [s], and name what is missing."""
        if time.monotonic() > until:
            self._conversation.refuse(
                f"controller.nodes: {missing() or self.unrest()}, after "
                f"{self.options['start_limit_s']:g} s; correct the nodes, or raise start_limit_s"
            )

    def require_nodes(self) -> None:
        """End the mission if a node has exited."""
        ended = self.nodes.ended()
        if ended is not None:
            end(ended)

    def require_rest(self, until: float) -> None:
        """Wait until all nodes are at rest; end the mission if they are not by ``until`` [s]."""
        if not self.rest.wait(until - time.monotonic()):
            end(self.unrest())

    def unrest(self) -> str:
        """Name the nodes that are still busy."""
        return f"the nodes did not come to rest: {'; '.join(self.rest.working())}"

    def answer(self, commands: Sequence[Any]) -> None:
        """Answer a tick with the last command, or with no decision."""
        if not commands:
            self._conversation.answer(0, 0.0, 0.0)
            return
        for message in commands:
            speed, steering = self._wheels.read(message)
        self._conversation.answer(self.modes.now, speed, steering)
