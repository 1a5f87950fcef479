"""Readers' notes on omissions and assumptions: a line per kind on the terminal, all in the log."""

import logging
import math
import re
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import local_tag, locate, name_of, parse_number, walk_up

WORLD_KEYS: ContextVar[str] = ContextVar("world_keys", default="world.NAME.")
"""Replacement for ``world.NAME.`` in notes, which readers write without knowing the name."""
_NAMED = 3  # maximum number of further names in a line


class Notes:
    """Collects notes about the input, which ``report`` logs kind by kind."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._kinds: dict[str, list[tuple[str, str]]] = {}  # lines and names by kind

    def add(self, element: Element, problem: str, kind: str = "", name: str = "") -> None:
        """Note an omitted or completed element; ``problem`` is the predicate of the sentence.

        Notes of the same ``kind`` (by default, with the same tag and problem) are merged into one
        line, which names each element by ``name``, by default the name of its model or robot.
        """
        kind = kind or f"{local_tag(element)} {problem}"
        line = f"{locate(element)} {problem}", name or name_of(element)
        self._kinds.setdefault(kind, []).append(line)

    def add_line(self, text: str, kind: str, name: str) -> None:
        """Add the line ``text`` about ``name``, unless the same line exists."""
        lines = self._kinds.setdefault(kind, [])
        if text not in (noted for noted, _ in lines):
            lines.append((text, name))

    def add_file(self, path: Path, remark: str) -> None:
        """Note a file that is not XML; remarks that differ only in numbers share a kind."""
        self.add_line(f"{path}: {remark}", re.sub(r"\d+", "N", remark), path.name)

    def report(self) -> None:
        """Log one line per kind with an example, and all lines of the kind for the log file."""
        for lines in self._kinds.values():
            names = _list([name for _, name in lines])
            more = f" (and {len(lines) - 1} more of this kind{names})" if len(lines) > 1 else ""
            self._log.warning("%s%s", _name_keys(lines[0][0]), more)
            for text, _ in lines if more else ():
                self._log.debug("%s", _name_keys(text))
        self._kinds.clear()


def _name_keys(text: str) -> str:
    return text.replace("world.NAME.", WORLD_KEYS.get())


def _list(names: list[str]) -> str:
    others = [name for name in dict.fromkeys(names) if name and name != names[0]]
    if not others:
        return ""
    more = f" and {len(others) - _NAMED} others" if len(others) > _NAMED else ""
    return f": {', '.join(others[:_NAMED])}{more}"


def list_notes(names: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a line for each text with the names to which it applies, if there are any."""
    return [f"{text}: {', '.join(items)}" for text, items in names.items() if items]


LARGEST_RAD = 2.0 * math.pi + 0.01
"""A full turn with a margin for rounding; nobody writes larger angles in radians."""
_LOOKS = ("gui", "light", "scene", "plugin")  # elements whose poses are not used


def note_degrees(root: Element, notes: Notes) -> None:
    """Note each ``<origin>`` of URDF and ``<pose>`` of SDF that turns by more than 360 deg."""
    for element in root.iter("origin", "pose"):
        words = _list_angles(element)
        # Words that are not numbers count as NaN, which does not exceed a full turn.
        exceeds = any(LARGEST_RAD < abs(parse_number(word)) < math.inf for word in words)
        if exceeds and not any(owner.tag in _LOOKS for owner in walk_up(element)):
            turn = f"rotates by {' '.join(words)} rad, more than a full turn"
            notes.add(element, f"{turn}; if these are degrees, convert them to radians", "degrees")


def _list_angles(element: Element) -> list[str]:
    """Return an element's words for roll, pitch and yaw [rad]; empty if these are in degrees."""
    if element.tag == "origin":
        return str(element.get("rpy", "")).split()
    if element.get("degrees", "").strip() in ("true", "1") or element.get("rotation_format"):
        return []
    return (element.text or "").split()[3:6]
