"""Paths of one machine in the texts of a run, replaced by paths in an archive."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from re import Match, Pattern

_BEFORE, _AFTER = r"(?<![\w.~-])", r"(?![\w-]|\.\w)"
"""No part of the name of a folder comes before a path, or after it."""


@dataclass(frozen=True)
class Relocation:
    """Folders by their full paths, each with the path that replaces it."""

    places: Mapping[str, str] = field(default_factory=dict)

    def relocate(self, text: str) -> str:
        """Replace the paths in a text; those of inner folders first."""
        return self._pattern.sub(self._replace, text) if self._is_in(text) else text

    def relocate_bytes(self, content: bytes) -> bytes:
        """Replace the paths in the content of a text file."""
        if not any(path.encode() in content for path in self.places):
            return content
        text = content.decode(errors="surrogateescape")
        return self.relocate(text).encode(errors="surrogateescape")

    def _is_in(self, text: str) -> bool:
        return any(path in text for path in self.places)

    @cached_property
    def _pattern(self) -> Pattern[str]:
        paths = sorted(self.places, key=len, reverse=True)
        return re.compile(f"{_BEFORE}({'|'.join(map(re.escape, paths))})(?:(/)|{_AFTER})")

    def _replace(self, match: Match[str]) -> str:
        place = self.places[match[1]]
        if place == ".":  # the rest is relative to it
            return "" if match[2] else place
        return place + (match[2] or "")


NOWHERE = Relocation()
"""Replaces nothing."""
