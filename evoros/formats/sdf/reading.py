"""How an SDF file is read: the choices of the user, and what is gathered on the way."""

import logging
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from lxml.etree import _Element as Element

from evoros.base.checks import Rule, checked, one_of
from evoros.base.errors import InputError
from evoros.files.resources import expand_home, read_file
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.missing import MISSING_RULE, Absences
from evoros.formats.notes import Notes
from evoros.formats.sdf.addresses import Addresses
from evoros.formats.sdf.old_versions import modernize
from evoros.formats.strict_xml import SOURCE, walk_up

LOG = logging.getLogger("evoros.sdf")

VEHICLES = one_of("leave_out", "hold_still")
ACTORS = one_of("walk", "leave_out")
FOLDERS = Rule(
    "a list of folders",
    lambda v: isinstance(v, list | tuple) and all(isinstance(i, str) and i for i in v),
)
UP_AXIS = one_of("ignore", "apply")
WORLD_NAME = Rule("a text", lambda v: isinstance(v, str))


@dataclass(frozen=True)
@checked
class SdfOptions:
    """How to read an SDF file."""

    model_paths: Annotated[tuple[str, ...], FOLDERS] = ()  # folders that hold models or meshes
    world_name: Annotated[str, WORLD_NAME] = ""  # of several in the file
    missing: Annotated[str, MISSING_RULE] = "error"  # of models and meshes
    vehicles: Annotated[str, VEHICLES] = "leave_out"
    mesh_up_axis: Annotated[str, UP_AXIS] = "ignore"  # <up_axis> of DAE files
    actors: Annotated[str, ACTORS] = "walk"

    def folders(self) -> list[Path]:
        """Return the folders of ``model_paths``."""
        for name in self.model_paths:
            if not expand_home(name).is_dir():
                raise InputError(f"model_paths: {name}: no such folder; give an existing one")
        return [expand_home(name).resolve() for name in self.model_paths]


@dataclass(eq=False)
class Reading:
    """The reading of one world: its options, the files it has read, and notes for the user."""

    file: Path  # of the world
    options: SdfOptions
    source: str  # its name in messages
    notes: Notes = field(default_factory=lambda: Notes(LOG))
    contents: dict[Path, bytes] = field(default_factory=dict)  # of all files but the world's own

    def __post_init__(self) -> None:
        self._roots: dict[Path, Element] = {}
        self.absences = Absences(self.source)
        self.incomplete: list[Element] = []  # models without one that they include
        self.addresses = Addresses(self.file, self.options.folders(), self.notes)

    def read(self, path: Path) -> bytes:
        """Return the content of a file."""
        real = path.resolve()
        if real not in self.contents:
            self.contents[real] = read_file(real)
        return self.contents[real]

    def parse(self, path: Path) -> Element:
        """Return the root of an XML file, which the caller may change."""
        if path not in self._roots:
            root = parse_leniently(self.read(path), str(path))
            root.set(SOURCE, str(path))  # a copy would lose the name of its file
            modernize(root, self.notes)
            self._roots[path] = root
        return deepcopy(self._roots[path])

    def folder_of(self, element: Element) -> Path:
        """Return the folder of the file that an element was read from."""
        sources = (str(owner.get(SOURCE, "")) for owner in walk_up(element))
        source = next((source for source in sources if source.startswith("/")), self.file)
        return Path(source).parent
