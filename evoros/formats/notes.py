"""Notes of readers on omissions and assumptions; the terminal shows one line per kind."""

import logging
import math
import re
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import local_tag, locate, name_of, parse_number, walk_up

WORLD_KEYS: ContextVar[str] = ContextVar("world_keys", default="world.NAME.")
"""Replacement for ``world.NAME.`` in notes, because readers do not know the name of the world."""
_NAMED = 3  # maximum number of additional names per line


class Notes:
    """Collects notes about the input, logged by kind in ``report``."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._kinds: dict[str, list[tuple[str, str]]] = {}  # lines and names of each kind

    def add(self, element: Element, problem: str, kind: str = "", name: str = "") -> None:
        """Note an omitted or completed element; ``problem`` is the predicate of the sentence.

        Notes of the same ``kind`` (by default, with the same tag and problem) are merged into one
        line, which names each element by ``name``, by default the name of its model or robot.
        """
        kind = kind or f"{local_tag(element)} {problem}"
        line = f"{locate(element)} {problem}", name or name_of(element)
        self._kinds.setdefault(kind, []).append(line)

    def add_line(self, text: str, kind: str, name: str) -> None:
        """Add the line ``text`` about ``name``, unless it has been added before."""
        lines = self._kinds.setdefault(kind, [])
        if text not in (noted for noted, _ in lines):
            lines.append((text, name))

    def add_file(self, path: Path, remark: str) -> None:
        """Add a note about a file that is not XML; remarks equal up to numbers share a kind."""
        self.add_line(f"{path}: {remark}", re.sub(r"\d+", "N", remark), path.name)

    def report(self) -> None:
        """Log a line per kind with an example; write all lines to the log file."""
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
    """Return a line for each text that has names, followed by these names."""
    return [f"{text}: {', '.join(items)}" for text, items in names.items() if items]


LARGEST_RAD = 2.0 * math.pi + 0.01  # a full turn and a margin; larger angles are hardly radians
_LOOKS = ("gui", "light", "scene", "plugin")  # elements whose poses are ignored


def note_degrees(root: Element, notes: Notes) -> None:
    """Note each URDF ``<origin>`` and SDF ``<pose>`` with an angle above 360 deg."""
    for element in root.iter("origin", "pose"):
        words = _list_angles(element)
        # Words that are not numbers become NaN, which is not above a full turn.
        exceeds = any(LARGEST_RAD < abs(parse_number(word)) < math.inf for word in words)
        if exceeds and not any(owner.tag in _LOOKS for owner in walk_up(element)):
            turn = f"rotates by {' '.join(words)} rad, more than a full turn"
            notes.add(element, f"{turn}; if these are degrees, convert them to radians", "degrees")


def _list_angles(element: Element) -> list[str]:
    """Return an element's roll, pitch and yaw [rad] as written; nothing if they are in degrees."""
    if element.tag == "origin":
        return str(element.get("rpy", "")).split()
    if element.get("degrees", "").strip() in ("true", "1") or element.get("rotation_format"):
        return []
    return (element.text or "").split()[3:6]
