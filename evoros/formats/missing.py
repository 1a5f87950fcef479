"""Files, models and packages that a description names and that are absent: all in one message."""

from collections.abc import Iterator
from dataclasses import dataclass

from evoros.base.checks import one_of
from evoros.base.errors import InputError

MISSING = ("error", "leave_out", "box")
"""Treatments of absent models and meshes; ``box`` puts one in place of a mesh of known size."""

MISSING_RULE = one_of(*MISSING)


class MissingFileError(InputError):
    """A mesh or an image is absent or cannot be read, so that it may be left out."""


@dataclass(frozen=True)
class Remedy:
    """How to get what is absent: ``text`` has ``{}`` for a subject, such as a folder's name."""

    text: str
    subject: str = ""

    def __str__(self) -> str:
        return self.text.format(self.subject)


@dataclass(frozen=True)
class Absence:
    """Something absent: its name in the description, and where and why it is missed."""

    kind: str  # package, file, model or mesh
    name: str
    place: str  # file and line
    sentence: str  # with the place, of this absence alone
    remedy: Remedy


class Absences:
    """Collects all that is absent in one description, which messages call ``source``."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._absences: list[Absence] = []

    def names(self, kind: str = "") -> tuple[str, ...]:
        """Return the names of all that is absent, or of one kind of it, each once."""
        names = (absence.name for absence in self._absences if kind in ("", absence.kind))
        return tuple(dict.fromkeys(names))

    def add(self, absence: Absence) -> None:
        """Add something that is absent."""
        self._absences.append(absence)

    def require_none(self, choices: str) -> None:
        """Require that nothing is absent; ``choices``, if any, are the keys to type instead.

        Raises:
            InputError: something is; the message has all of it.
        """
        if not self._absences:
            return
        first, names = self._absences[0], self.names()
        if len(names) == 1:
            more = len(self._absences) - 1
            again = f" (and {more} times more)" if more else ""
            problem = f"{first.sentence}{again}"
        else:
            listed = ", ".join(self._list())
            problem = f"{self._source}: names {len(names)} things that are absent: {listed}"
        subjects: dict[str, dict[str, None]] = {}
        for absence in self._absences:
            subjects.setdefault(absence.remedy.text, {})[absence.remedy.subject] = None
        fixes = [
            text.format((" && " if text.startswith("get ") else ", ").join(named))
            for text, named in subjects.items()
        ]
        instead = f"; or {choices}" if choices else ""
        raise InputError(f"{problem}; {'; '.join(fixes)}{instead}")

    def _list(self) -> Iterator[str]:
        """Yield each name with its first place and how often it is missed."""
        places: dict[str, list[str]] = {}
        for absence in self._absences:
            places.setdefault(absence.name, []).append(absence.place)
        for name, where in places.items():
            place = where[0].removeprefix(f"{self._source}:")
            line = f"line {place}" if place.isdigit() else place
            title = f"package {name}" if name in self.names("package") else name
            yield f"{title} ({line}{f', {len(where)} times' if len(where) > 1 else ''})"
