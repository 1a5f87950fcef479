"""What the SDF reader leaves out or assumes: one warning for each kind, with a count."""

import logging
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import local_tag, locate

LOG = logging.getLogger("evoros.sdf")


class Notes:
    """Collects warnings about elements, which ``report`` logs in the order of the first of each."""

    def __init__(self) -> None:
        self._notes: dict[str, tuple[str, list[str]]] = {}

    def add(self, element: Element, problem: str, kind: str = "") -> None:
        """Note that an element is left out or completed; ``problem`` completes a sentence.

        Notes of one ``kind``, by default of one tag with one problem, become one line.
        """
        text = f"{locate(element)} {problem}"
        _, others = self._notes.setdefault(kind or f"{local_tag(element)} {problem}", (text, []))
        others.append(text)

    def add_file(self, path: Path, problem: str) -> None:
        """Note once how a file that is not XML is used; ``problem`` is a sentence about it."""
        text = f"{path}: {problem}"
        self._notes.setdefault(text, (text, [text]))

    def report(self) -> None:
        """Log one warning for each kind."""
        for text, all_of_kind in self._notes.values():
            more = len(all_of_kind) - 1
            LOG.warning("%s%s", text, f" (and {more} more of this kind)" if more else "")
        self._notes.clear()
