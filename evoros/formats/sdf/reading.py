"""The options and the state of an SDF reader, and the lookup of files named in SDF.

A file may be given by model://, package://, file://, a Fuel address or a path; Gazebo Fuel
models are looked up in Fuel's local cache.
"""

import hashlib
import logging
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated
from urllib.parse import unquote

from lxml.etree import _Element as Element

from evoros.base.checks import POSITIVE, Rule, checked, one_of
from evoros.base.errors import InputError
from evoros.files.resources import expand_home, read_file
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.missing import MISSING_RULE, Absences, Remedy
from evoros.formats.notes import Notes
from evoros.formats.sdf.old_versions import modernize
from evoros.formats.strict_xml import SOURCE, walk_up
from evoros.formats.urdf import packages
from evoros.geometry.shapes import MeshFile, Shape

_VARIABLES = (
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "GAZEBO_MODEL_PATH",
    "GAZEBO_RESOURCE_PATH",
    "SDF_PATH",
)
_FIND = re.compile(r"^(?:file://)?\$\(find(?:-pkg-share)? +([^)\s]+)\)")
_LEVELS_UP = 4  # number of parent folders searched
_SCHEMES = ("model://", "package://", "file://")


class Addresses:
    """Locates files named in a world; ``declared`` are the folders of ``model_paths``."""

    def __init__(self, file: Path, declared: Sequence[Path], notes: Notes) -> None:
        self._file = file
        self._declared = declared
        self._notes = notes
        self._explained: dict[tuple[str, Path], tuple[str, Remedy]] = {}
        self._places: dict[tuple[str, Path, object], Path | None] = {}

    def find(
        self, uri: str, beside: Path, accepts: Callable[[Path], bool] = Path.exists
    ) -> Path | None:
        """Return the file or folder at an address in a file of the given folder, or None.

        ``accepts`` tests paths in turn; paths that differ only in upper and lower case come last.
        """
        key = (uri, beside, accepts)
        if key not in self._places:
            self._places[key] = self._find(_normalize(uri), beside, accepts)
        return self._places[key]

    def _find(self, uri: str, beside: Path, accepts: Callable[[Path], bool]) -> Path | None:
        address = _parse_address(uri)
        if address is not None:
            return _find_in_cache(address, self._declared)
        path = _strip_scheme(uri)
        place = next(filter(accepts, self._candidates(path, uri, beside)), None)
        if place is None:
            return self._find_in_any_case(uri, self._candidates(path, uri, beside), accepts)
        return place

    def _find_in_any_case(
        self, uri: str, candidates: Iterable[Path], accepts: Callable[[Path], bool]
    ) -> Path | None:
        places = (packages.find_in_any_case(path) for path in dict.fromkeys(candidates))
        place = next((place for place in places if place is not None and accepts(place)), None)
        if place is not None:
            text = f"{self._file}: {uri} not found; using {place} (upper and lower case differ)"
            self._notes.add_line(text, "case", place.name)
        return place

    def explain(self, uri: str, beside: Path) -> tuple[str, Remedy]:
        """Return the reason why no file was found at an address, and advice on obtaining it."""
        if (uri, beside) not in self._explained:
            self._explained[uri, beside] = self._explain(_normalize(uri), beside)
        return self._explained[uri, beside]

    def _explain(self, uri: str, beside: Path) -> tuple[str, Remedy]:
        address = _parse_address(uri)
        if address is not None:
            return _where_to_get(address, uri)
        if uri.startswith(("model://", "package://")):
            name, _, rest = _strip_scheme(uri).partition("/")
            folder = self.find(f"model://{name}", beside)
            if folder is not None:
                none = "neither an .sdf file nor a model.config that names one"
                lacking = f"no {rest}" if rest else none
                remedy = Remedy("add the missing files to the folder {}", str(folder))
                return f"names {uri}, but {folder} has {lacking}", remedy
            return (
                f"names {uri}, but no model folder contains {name} (searched: the declared "
                "folders, the folders around the file, and the folders in environment variables)",
                Remedy(
                    "add the folder that holds {} to GZ_SIM_RESOURCE_PATH, or type "
                    "world.NAME.model_paths=[FOLDER]",
                    name,
                ),
            )
        if "://" in uri and not uri.startswith("file://"):
            remedy = Remedy("download {}, and give the path of the file", uri)
            return f"names {uri}, which has not been downloaded", remedy
        remedy = Remedy("correct the path {}, or type world.NAME.model_paths=[FOLDER]", uri)
        return f"names {uri}, which is not in {beside}", remedy

    def _candidates(self, path: str, uri: str, beside: Path) -> Iterator[Path]:
        plain = expand_home(path)
        if plain.is_absolute():
            yield plain
            return
        named = uri.startswith(("model://", "package://"))
        if not named:
            yield beside / path
        first, _, rest = path.partition("/")
        for folder in self._declared:
            yield folder / path
            if folder.name == first:
                yield folder / rest
        for start in (beside, self._file.parent):
            yield from _around(start, path, first, rest)
        for variable in _VARIABLES:
            for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
                yield expand_home(entry) / path
        if named:
            package = self._packages.find(first)
            if package is not None:
                yield package / rest
                installed = packages.find_installed(package, rest)
                if installed is not None:
                    yield installed
            for package in self._packages.folders.values():
                yield package / "models" / path

    @cached_property
    def _packages(self) -> packages.PackageIndex:
        return packages.index_packages(self._file, [str(folder) for folder in self._declared])


def _around(start: Path, path: str, first: str, rest: str) -> Iterator[Path]:
    """Yield candidate paths of a file in the parent folders and in their model folders."""
    for folder in [start, *start.parents][: _LEVELS_UP + 1]:
        if len(folder.parts) <= 1:
            return
        yield folder / path
        yield folder / "models" / path
        if folder.name == first:
            yield folder / rest


def _normalize(uri: str) -> str:
    """Return an address with ROS's ``$(find NAME)/`` replaced by ``package://NAME/``."""
    return _FIND.sub(r"package://\1", uri.strip())


def _strip_scheme(uri: str) -> str:
    scheme = next((scheme for scheme in _SCHEMES if uri.startswith(scheme)), "")
    return unquote(uri[len(scheme) :]) if scheme else uri


_ADDRESS = re.compile(
    r"https?://(?P<host>[^/]+)/(?:[0-9]+\.[0-9]+/)?(?P<owner>[^/]+)/(?P<kind>models|worlds)/"
    r"(?P<name>[^/]+)(?:/(?P<version>[0-9]+|tip))?(?:/files)?(?:/(?P<inner>.*))?",
    re.IGNORECASE,
)
_CACHES = {"GZ_FUEL_CACHE_PATH": "~/.gz/fuel", "IGN_FUEL_CACHE_PATH": "~/.ignition/fuel"}
_HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")  # both names of the server in caches


@dataclass(frozen=True)
class _FuelAddress:
    host: str
    owner: str
    kind: str
    name: str
    version: str  # version number; empty for the newest
    inner: str  # path inside the folder of the model; empty for the folder


def _parse_address(uri: str) -> _FuelAddress | None:
    match = _ADDRESS.fullmatch(unquote(uri.strip()).rstrip("/"))
    if match is None:
        return None
    parts = {key: value or "" for key, value in match.groupdict().items()}
    if parts["version"].lower() == "tip":
        parts["version"] = ""
    return _FuelAddress(**parts)


def _find_in_cache(address: _FuelAddress, declared: Sequence[Path]) -> Path | None:
    names = (address.name, address.name.replace(" ", "_"))
    given = (_child(folder, name) for folder in declared for name in names)
    places = (folder / address.inner for folder in (*_cached_folders(address), *given) if folder)
    return next((place for place in places if place.exists()), None)


def _where_to_get(address: _FuelAddress, uri: str) -> tuple[str, Remedy]:
    """Return why an item is missing, with its expected path, and the command to download it."""
    cache = next(_cache_folders())
    expected = cache / address.host / address.owner.lower() / address.kind / address.name.lower()
    kind = f"/{address.kind}/"
    model = uri[: uri.index(kind)] + kind + address.name if address.inner else uri
    return (
        f"names a Fuel {address.kind[:-1]} that is not in the local cache (expected at {expected})",
        Remedy("get with: {}", f'gz fuel download -u "{model}"'),
    )


def _cache_folders() -> Iterator[Path]:
    for variable, default in _CACHES.items():
        yield expand_home(os.environ.get(variable) or default)


def _cached_folders(address: _FuelAddress) -> Iterator[Path]:
    """Yield the version folders of the model in all caches, newest first."""
    hosts = dict.fromkeys([address.host, *(_HOSTS if address.host.lower() in _HOSTS else ())])
    for cache in _cache_folders():
        for host in hosts:
            model: Path | None = cache
            for part in (host, address.owner, address.kind, address.name):
                model = None if model is None else _child(model, part)
            if model is not None:
                versions = [v for v in model.iterdir() if v.name.isdigit() and v.is_dir()]
                wanted = [v for v in versions if address.version in ("", v.name)]
                yield from sorted(wanted, key=lambda v: int(v.name), reverse=True)


def _child(folder: Path, name: str) -> Path | None:
    if (folder / name).is_dir():
        return folder / name
    try:
        children = [child for child in folder.iterdir() if child.is_dir()]
    except OSError:
        return None
    return next((c for c in children if unquote(c.name).lower() == name.lower()), None)


LOG = logging.getLogger("evoros.sdf")

FOLDERS = Rule(
    "a list of folders",
    lambda v: isinstance(v, list | tuple) and all(isinstance(i, str) and i for i in v),
)
WORLD_NAME = Rule("a string", lambda v: isinstance(v, str))


@dataclass(frozen=True)
@checked
class SdfOptions:
    """Options for reading an SDF file.

    Meshes within 30 m of the course are divided into convex parts in about ``mesh_effort`` minutes;
    with more than one minute, the distance grows in proportion.
    """

    model_paths: Annotated[tuple[str, ...], FOLDERS] = ()  # folders with models or meshes
    world_name: Annotated[str, WORLD_NAME] = ""  # name of the world to read if there are several
    missing: Annotated[str, MISSING_RULE] = "error"  # treatment of missing models and meshes
    vehicles: Annotated[str, one_of("leave_out", "hold_still")] = "leave_out"
    mesh_up_axis: Annotated[str, one_of("ignore", "apply")] = "ignore"  # <up_axis> of DAE files
    actors: Annotated[str, one_of("walk", "leave_out")] = "walk"
    mesh_effort: Annotated[float, POSITIVE] = 1.0  # minutes

    def folders(self) -> list[Path]:
        """Return the folders of ``model_paths``."""
        for name in self.model_paths:
            if not expand_home(name).is_dir():
                raise InputError(
                    f"SdfOptions.model_paths: {name}: no such folder; give an existing one"
                )
        return [expand_home(name).resolve() for name in self.model_paths]


@dataclass(eq=False)
class Reading:
    """The state of reading one world: options, files read so far, and notes."""

    file: Path  # path of the world file
    options: SdfOptions
    source: str  # name of the world file in messages
    notes: Notes = field(default_factory=lambda: Notes(LOG))
    digests: dict[Path, bytes] = field(default_factory=dict)  # digest of each file but the world's
    # keyed by address and folder
    models: dict[tuple[str, Path], Path | None] = field(default_factory=dict)
    meshes: dict[MeshFile, tuple[Shape, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._roots: dict[Path, Element] = {}
        self.absences = Absences(self.source)
        self.incomplete: list[Element] = []  # models without a missing included model
        self.addresses = Addresses(self.file, self.options.folders(), self.notes)

    def read(self, path: Path) -> bytes:
        """Return the content of a file, and record its digest."""
        real = path.resolve()
        content = read_file(real)
        self.digests[real] = hashlib.sha256(content).digest()
        return content

    def parse(self, path: Path) -> Element:
        """Return the root of an XML file, which the caller may modify."""
        if path not in self._roots:
            root = parse_leniently(self.read(path), str(path))
            root.set(SOURCE, str(path))  # copied elements lose the name of their file
            modernize(root, self.notes)
            self._roots[path] = root
        return deepcopy(self._roots[path])

    def folder_of(self, element: Element) -> Path:
        """Return the folder of the file from which an element was read."""
        sources = (str(owner.get(SOURCE, "")) for owner in walk_up(element))
        source = next((source for source in sources if source.startswith("/")), self.file)
        return Path(source).parent
