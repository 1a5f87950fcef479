"""Notes of readers on omissions and assumptions: a line a kind on the terminal, all in the log."""

import logging
import re
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import local_tag, locate, name_of

_NAMED = 3  # further things of a kind whose names its line has


class Notes:
    """Collects lines about what was read, which ``report`` logs in the order of the kinds."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._kinds: dict[str, list[tuple[str, str]]] = {}  # texts, with names

    def add(self, element: Element, problem: str, kind: str = "", name: str = "") -> None:
        """Note that an element is left out or completed; ``problem`` completes a sentence.

        Notes of one ``kind``, by default of one tag with one problem, become one line. There the
        element appears with ``name``, by default its model's or robot's.
        """
        kind = kind or f"{local_tag(element)} {problem}"
        line = f"{locate(element)} {problem}", name or name_of(element)
        self._kinds.setdefault(kind, []).append(line)

    def tell(self, text: str, kind: str, name: str) -> None:
        """Note a line about the thing called ``name``, unless it has been noted before."""
        lines = self._kinds.setdefault(kind, [])
        if text not in (noted for noted, _ in lines):
            lines.append((text, name))

    def add_file(self, path: Path, remark: str) -> None:
        """Note how a file that is not XML is used; remarks that differ in numbers are of one kind.

        ``remark`` is a sentence about the file.
        """
        self.tell(f"{path}: {remark}", re.sub(r"\d+", "N", remark), path.name)

    def report(self) -> None:
        """Log a line for each kind with an example, and all lines of the kind for the log file."""
        for lines in self._kinds.values():
            names = _list([name for _, name in lines])
            more = f" (and {len(lines) - 1} more of this kind{names})" if len(lines) > 1 else ""
            self._log.warning("%s%s", lines[0][0], more)
            for text, _ in lines if more else ():
                self._log.debug("%s", text)
        self._kinds.clear()


def _list(names: list[str]) -> str:
    """Return the names of all but the first of a kind, or how many there are beyond a few."""
    others = [name for name in dict.fromkeys(names) if name and name != names[0]]
    if not others:
        return ""
    more = f" and {len(others) - _NAMED} others" if len(others) > _NAMED else ""
    return f": {', '.join(others[:_NAMED])}{more}"
