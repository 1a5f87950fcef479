"""Where the files from which runs follow lie in an archive."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from evoros.storage.archives import INPUTS
from evoros.storage.relocation import Relocation


@dataclass(frozen=True)
class Layout:
    """Folders by their full paths, each with its place in the archive."""

    places: Mapping[Path, str]

    @classmethod
    def around(cls, folders: Iterable[Path], home: Path) -> "Layout":
        """Place folders as they lie to each other, so that relative paths stay right.

        They are placed side by side if a folder above the user's ``home`` is all that they share,
        because paths from there name the user.
        """
        given = dict.fromkeys(folders)
        tops = [one for one in given if not any(_is_inside(one, other) for other in given)]
        if not tops:
            return cls({})
        base = Path(os.path.commonpath(tops))
        if len(base.parts) > 1 and not _is_inside(home, base):
            return cls({path: _join(INPUTS, path.relative_to(base)) for path in (base, *given)})
        places: dict[Path, str] = {}
        for top in tops:
            names = {place.casefold() for place in places.values()}
            place = f"{INPUTS}/{top.name}"
            while place.casefold() in names:
                place += "_"
            places[top] = place
        for path in given:
            top = next(top for top in tops if path.is_relative_to(top))
            places[path] = _join(places[top], path.relative_to(top))
        return cls(places)

    def place(self, path: Path) -> str:
        """Return the place of a file or a folder in one of the folders."""
        above = next(folder for folder in (path, *path.parents) if folder in self.places)
        return _join(self.places[above], path.relative_to(above))

    def holds(self, path: Path) -> bool:
        """Whether a file lies in one of the folders."""
        return any(folder in self.places for folder in path.parents)

    def relocation(self, working: str, others: Mapping[str, str]) -> Relocation:
        """Return the paths from the place of a working folder, and ``others``."""
        named = {str(path): place for path, place in self.places.items() if len(path.parts) > 1}
        inside = {path: os.path.relpath(place, working) for path, place in named.items()}
        return Relocation({**others, **inside})


def _is_inside(path: Path, other: Path) -> bool:
    return path != other and path.is_relative_to(other)


def _join(place: str, rest: Path) -> str:
    return place if rest == Path() else f"{place}/{rest.as_posix()}"
