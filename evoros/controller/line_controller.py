"""The base class of controllers that exchange a line of text with a program per decision."""

import json
import math
import shlex
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import orjson

from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.base.checks import FLAG, NOT_NEGATIVE, POSITIVE, Rule, checked, is_number, mapping_of
from evoros.base.errors import LaunchError, SimulationError, single_line
from evoros.bridge.pipes import LineConversation, start_pipes
from evoros.controller.briefing_text import describe_briefing
from evoros.controller.protocol import LOCALIZATION, Briefing, LiveController, Localizer, Pilot
from evoros.robot.model import Robot

TIME_TOLERANCE_S = 1e-9

TEXTS = Rule(
    "a list of strings",
    lambda v: isinstance(v, list | tuple) and all(isinstance(item, str) for item in v),
)
MODES = Rule(
    "a non-empty list of distinct strings",
    lambda v: TEXTS.holds(v) and len(v) == len(set(v)) > 0 and all(item.strip() for item in v),
)
PARAMETERS = Rule(
    "a mapping from names to numbers, strings, flags, nulls, or lists or mappings of these",
    lambda v: isinstance(v, Mapping) and _is_plain(v),
    plain=True,
)
COMMAND = Rule(
    "a command, as a list of strings or one string",
    lambda v: bool(v.split() if isinstance(v, str) else TEXTS.holds(v) and v and v[0]),
)


@dataclass(frozen=True, kw_only=True)
@checked
class LineController(LiveController):
    """Starts a program for each mission, and exchanges one line of text with it per decision."""

    period_s: Annotated[float, POSITIVE] = 0.1
    modes: Annotated[Sequence[str], MODES] = ("driving",)
    localization: Annotated[Mapping[str, Localizer], LOCALIZATION] = field(default_factory=dict)
    # sent to the program
    parameters: Annotated[Mapping[str, Any], PARAMETERS] = field(default_factory=dict)
    # additional environment variables of the program
    environment: Annotated[Mapping[str, str], mapping_of(str, "strings")] = field(
        default_factory=dict
    )
    files: Annotated[Sequence[str], TEXTS] = ()  # additional files on which the program depends
    command_timeout_s: Annotated[float | None, NOT_NEGATIVE] = None  # simulated; None: no limit
    start_limit_s: Annotated[float, POSITIVE] = 30.0  # wall-clock time
    answer_limit_s: Annotated[float, POSITIVE] = 10.0  # wall-clock time
    isolate: Annotated[bool, FLAG] = True

    @contextmanager
    def fly(
        self, command: Sequence[str], briefing: Briefing, told: Mapping[str, Any] | None = None
    ) -> Iterator[Pilot]:
        """Start a program for one mission and send its briefing, extended by ``told``."""
        starting = start_pipes(command, isolate=self.isolate, environment=self.environment)
        with starting as pipes:
            conversation = LineConversation(pipes)
            content = {
                **describe_briefing(briefing),
                "period_s": self.period_s,
                "modes": list(self.modes),
                "parameters": dict(self.parameters),
                **(told or {}),
            }
            answer = conversation.ask(json.dumps(content).encode(), self.start_limit_s)
            _require_ready(conversation.process.name, answer)
            yield LinePilot(conversation, self, briefing.robot)


def _is_plain(value: object) -> bool:
    if isinstance(value, Mapping):
        return all(isinstance(key, str) for key in value) and all(map(_is_plain, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | str | int) or is_number(value)


def _require_ready(name: str, answer: bytes) -> None:
    try:
        content = json.loads(answer)
    except (ValueError, RecursionError):
        content = None
    if content == {"ready": True}:
        return
    if isinstance(content, dict) and "refused" in content:
        why = single_line(content["refused"]) or "no reason given"
        raise LaunchError(f"{name} refuses the mission: {why}")
    raise LaunchError(
        f'{name}: the first line must be {{"ready": true}} or {{"refused": "why"}}, not '
        f"{_quote(answer)}; correct the program"
    )


class LinePilot:
    """A running program that controls the robot in one mission."""

    def __init__(
        self, conversation: LineConversation, controller: LineController, robot: Robot
    ) -> None:
        self._conversation, self._limit_s = conversation, controller.answer_limit_s
        several = any(part.stop - part.start > 1 for part in robot.layout)
        self._parts = robot.layout if several else None  # None: one value per sensor
        self._modes = len(controller.modes)
        timeout = controller.command_timeout_s
        self._timeout_s = math.inf if timeout is None else timeout
        self._commanded_s = 0.0

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        """Send state, leg and readings; read mode, speed and steering angle."""
        # orjson writes NaN, the value of a silent sensor or localization, as null
        seen = readings if self._parts is None else _group(readings, self._parts)
        told = orjson.dumps([time, state, leg, seen], option=orjson.OPT_SERIALIZE_NUMPY)
        answer = self._conversation.ask(told, self._limit_s, time)
        try:
            mode, speed, steering = orjson.loads(answer)
            usable = type(mode) is int and 0 <= mode <= self._modes
            usable = usable and (mode == 0 or (is_number(speed) and is_number(steering)))
        except (ValueError, TypeError, RecursionError, OverflowError):
            usable = False
        if not usable:
            raise SimulationError(
                f"{self._conversation.process.name} sent {_quote(answer)} at {time:g} s; it must "
                f"send [mode, speed, steering] with a mode from 0 to {self._modes} and finite "
                f"numbers"
            )
        if mode > 0:
            command[DRIVE_SPEED], command[STEERING] = speed, steering
            self._commanded_s = time
        elif time - self._commanded_s >= self._timeout_s - TIME_TOLERANCE_S:
            command[DRIVE_SPEED] = 0.0
        return int(mode)


def _group(readings: Array, parts: Sequence[slice]) -> list[Any]:
    return [readings[p] if p.stop - p.start > 1 else readings[p.start] for p in parts]


def _quote(answer: bytes) -> str:
    text = answer.decode(errors="replace")
    return repr(text if len(text) <= 80 else f"{text[:77]}...")


def split_command(command: Sequence[str]) -> list[str]:
    """Split a command into words; make existing paths absolute, as it starts in another folder."""
    words = shlex.split(command) if isinstance(command, str) else list(command)
    program = words[0] if "/" in words[0] else shutil.which(words[0]) or words[0]
    if "/" in program or _is_file(program):
        program = str(Path(program).absolute())
    rest = (str(Path(word).absolute()) if _is_file(word) else word for word in words[1:])
    return [program, *rest]


def _is_file(word: str) -> bool:
    return ("/" in word or "." in word) and len(word) < 4096 and Path(word).is_file()


def list_files(command: Sequence[str], further: Sequence[str]) -> tuple[str, ...]:
    """Return the files named in a split command and in ``further``, without duplicates."""
    named = [word for word in command if Path(word).is_absolute() and _is_file(word)]
    paths = [str(Path(path).absolute()) for path in further]
    return tuple(dict.fromkeys((*named, *paths)))


@dataclass(frozen=True, kw_only=True)
@checked
class Program(LineController):
    """Runs ``command`` in each mission; docs/programs.md describes the exchanged lines."""

    command: Annotated[Sequence[str], COMMAND]

    def __post_init__(self) -> None:
        command = split_command(self.command)
        object.__setattr__(self, "command", command)
        object.__setattr__(self, "files", list_files(command, self.files))

    def launch(self, briefing: Briefing) -> AbstractContextManager[Pilot]:
        """Start the program for one mission."""
        return self.fly(self.command, briefing)
