"""Collects the missing files, models and packages of a description in one message."""

from collections.abc import Iterator
from dataclasses import dataclass

from evoros.base.checks import one_of
from evoros.base.errors import InputError

MISSING = ("error", "leave_out", "box")  # missing files; ``box`` replaces a mesh of known size
MISSING_RULE = one_of(*MISSING)


class MissingFileError(InputError):
    """A mesh or image is missing or unreadable, but can be left out."""


@dataclass(frozen=True)
class Remedy:
    """Advice on obtaining a missing file; ``{}`` in ``text`` is its subject, such as a folder."""

    text: str
    subject: str = ""

    def __str__(self) -> str:
        return self.text.format(self.subject)


@dataclass(frozen=True)
class Absence:
    """A missing item, with its name and location in the description, and the reason."""

    kind: str  # package, file, model, mesh, or wheel (the mesh of a wheel)
    name: str
    place: str  # file and line
    sentence: str  # the whole message if nothing else is missing
    remedy: Remedy


class Absences:
    """Collects all items missing in a description, which messages call ``source``."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._absences: list[Absence] = []

    def names(self, kind: str = "") -> tuple[str, ...]:
        """Return the distinct names of missing items of one kind, by default of all kinds."""
        names = (absence.name for absence in self._absences if kind in ("", absence.kind))
        return tuple(dict.fromkeys(names))

    def add(self, absence: Absence) -> None:
        """Add a missing item."""
        self._absences.append(absence)

    def require_none(self, choices: str) -> None:
        """Raise an error if anything is missing; the message suggests ``choices``, if not empty."""
        if not self._absences:
            return
        first, names = self._absences[0], self.names()
        if len(names) == 1:
            more = len(self._absences) - 1
            problem = first.sentence + (f" (and {more} more like this)" if more else "")
        else:
            listed = ", ".join(self._list())
            problem = f"{self._source}: refers to {len(names)} missing items: {listed}"
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
        places: dict[str, list[str]] = {}
        for absence in self._absences:
            places.setdefault(absence.name, []).append(absence.place)
        for name, where in places.items():
            place = where[0].removeprefix(f"{self._source}:")
            line = f"line {place}" if place.isdigit() else place
            title = f"package {name}" if name in self.names("package") else name
            yield f"{title} ({line}{f', {len(where)} times' if len(where) > 1 else ''})"
