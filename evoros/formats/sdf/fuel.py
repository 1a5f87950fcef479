"""Models of Gazebo Fuel: their addresses, and where its local cache keeps them."""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from evoros.files.resources import expand_home
from evoros.formats.missing import Remedy

_ADDRESS = re.compile(
    r"https?://(?P<host>[^/]+)/(?:[0-9]+\.[0-9]+/)?(?P<owner>[^/]+)/(?P<kind>models|worlds)/"
    r"(?P<name>[^/]+)(?:/(?P<version>[0-9]+|tip))?(?:/files)?(?:/(?P<inner>.*))?",
    re.IGNORECASE,
)
_CACHES = {"GZ_FUEL_CACHE_PATH": "~/.gz/fuel", "IGN_FUEL_CACHE_PATH": "~/.ignition/fuel"}
# The server has two names, and a cache may know a model by either.
_HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")


@dataclass(frozen=True)
class FuelAddress:
    """A model on a Fuel server, or a file in it."""

    host: str
    owner: str
    kind: str
    name: str
    version: str  # a number; empty for the newest
    inner: str  # path in the model's folder; empty for the folder


def parse_address(uri: str) -> FuelAddress | None:
    """Return the parts of a web address of Fuel; None if it is none."""
    match = _ADDRESS.fullmatch(unquote(uri.strip()).rstrip("/"))
    if match is None:
        return None
    parts = {key: value or "" for key, value in match.groupdict().items()}
    if parts["version"].lower() == "tip":
        parts["version"] = ""
    return FuelAddress(**parts)


def find_in_cache(address: FuelAddress, declared: Sequence[Path]) -> Path | None:
    """Return the model's folder, or the file in it, from the cache or a declared model folder."""
    names = (address.name, address.name.replace(" ", "_"))
    given = (_child(folder, name) for folder in declared for name in names)
    places = (folder / address.inner for folder in (*_cached_folders(address), *given) if folder)
    return next((place for place in places if place.exists()), None)


def where_to_get(address: FuelAddress, uri: str) -> tuple[str, Remedy]:
    """Return what is missing and where it is expected, and the command that gets it."""
    cache = next(_cache_folders())
    expected = cache / address.host / address.owner.lower() / address.kind / address.name.lower()
    kind = f"/{address.kind}/"
    model = uri[: uri.index(kind)] + kind + address.name if address.inner else uri
    return (
        f"names a model of Fuel that is not in the local cache, where {expected} is expected",
        Remedy("get with: {}", f'gz fuel download -u "{model}"'),
    )


def _cache_folders() -> Iterator[Path]:
    for variable, default in _CACHES.items():
        yield expand_home(os.environ.get(variable) or default)


def _cached_folders(address: FuelAddress) -> Iterator[Path]:
    """Yield the folders of the model's versions in the caches, the newest first."""
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
    """Return the subfolder of a name in any case, also if it is written with %20."""
    if (folder / name).is_dir():
        return folder / name
    try:
        children = [child for child in folder.iterdir() if child.is_dir()]
    except OSError:
        return None
    return next((c for c in children if unquote(c.name).lower() == name.lower()), None)
