"""Notes of readers on omissions and assumptions: a line a kind on the terminal, all in the log."""

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import local_tag, locate, name_of

_NAMED = 3  # further things of a kind whose names its line has


@dataclass
class _Kind:
    level: int
    texts: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


class Notes:
    """Collects lines about what was read, which ``report`` logs in the order of the kinds."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._kinds: dict[str, _Kind] = {}

    def add(self, element: Element, problem: str, kind: str = "", name: str = "") -> None:
        """Note that an element is left out or completed; ``problem`` completes a sentence.

        Notes of one ``kind``, by default of one tag with one problem, become one line. There the
        element appears with ``name``, by default its model's or robot's.
        """
        kind = kind or f"{local_tag(element)} {problem}"
        self._put(f"{locate(element)} {problem}", kind, name or name_of(element), logging.WARNING)

    def tell(self, text: str, kind: str, name: str, level: int = logging.WARNING) -> None:
        """Note a line about the thing called ``name``, unless it has been noted before."""
        if text not in self._kinds.get(kind, _Kind(level)).texts:
            self._put(text, kind, name, level)

    def add_file(self, path: Path, remark: str) -> None:
        """Note how a file that is not XML is used; remarks that differ in numbers are of one kind.

        ``remark`` is a sentence about the file.
        """
        self.tell(f"{path}: {remark}", re.sub(r"\d+", "N", remark), path.name)

    def _put(self, text: str, kind: str, name: str, level: int) -> None:
        entry = self._kinds.setdefault(kind, _Kind(level))
        entry.texts.append(text)
        entry.names.append(name)

    def report(self) -> None:
        """Log a line for each kind with an example, and all lines of the kind for the log file."""
        for kind in self._kinds.values():
            first, count = kind.texts[0], len(kind.texts)
            more = "" if count == 1 else f" (and {count - 1} more of this kind{_list(kind.names)})"
            self._log.log(kind.level, "%s%s", first, more)
            for text in kind.texts if count > 1 else ():
                self._log.debug("%s", text)
        self._kinds.clear()


def _list(names: list[str]) -> str:
    """Return the names of all but the first of a kind, or how many there are beyond a few."""
    others = [name for name in dict.fromkeys(names) if name and name != names[0]]
    if not others:
        return ""
    more = f" and {len(others) - _NAMED} others" if len(others) > _NAMED else ""
    return f": {', '.join(others[:_NAMED])}{more}"
