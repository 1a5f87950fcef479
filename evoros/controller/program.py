"""A controller in a user's program, in any language."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import checked
from evoros.controller.line_controller import COMMAND, LineController, list_files, split_command
from evoros.controller.protocol import Briefing, Pilot


@dataclass(frozen=True, kw_only=True)
@checked
class Program(LineController):
    """Runs ``command`` for each mission. docs/programs.md describes its lines."""

    command: Annotated[Sequence[str], COMMAND]

    def __post_init__(self) -> None:
        command = split_command(self.command)
        object.__setattr__(self, "command", command)
        object.__setattr__(self, "files", list_files(command, self.files))

    def launch(self, briefing: Briefing) -> AbstractContextManager[Pilot]:
        """Start the program for one mission.

        Raises:
            LaunchError: the program cannot be started, or refuses the briefing.
            PilotLost: it was not ready in time.
        """
        return self.fly(self.command, briefing)
