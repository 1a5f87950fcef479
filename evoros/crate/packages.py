"""The packages with which a study was made: versions, and hashes of what is installed."""

import csv
import io
import re
from collections.abc import Iterable, Mapping
from hashlib import sha256
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from typing import Any

from evoros.storage.circumstances import OWN, normalize

_OF_INSTALLER = ("INSTALLER", "REQUESTED", "RECORD", "direct_url.json")
"""Files that tell how a package came, and not what it is."""


def list_versions(manifests: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """List the packages of runs, and those that these require, with their versions.

    The first run counts for a package that another one had in another version.
    """
    versions: dict[str, str] = {}
    for manifest in manifests:
        for name, version in manifest["packages"].items():
            if version is not None and name != OWN:
                versions.setdefault(name, version)
    pending = list(versions)
    while pending:
        found = _find(pending.pop())
        for text in (found and found.requires) or ():
            name = normalize(re.split(r"[^\w.-]", text, maxsplit=1)[0])
            required = _find(name)
            if "extra ==" not in text and name not in versions and required is not None:
                versions[name] = required.version
                pending.append(name)
    return dict(sorted(versions.items()))


def write_requirements(versions: Mapping[str, str]) -> bytes:
    """Return the versions as ``pip install -r`` reads them."""
    return "".join(f"{name}=={version}\n" for name, version in versions.items()).encode()


def write_hashes(versions: Mapping[str, str]) -> bytes:
    """Return a table of the packages, with the hash of each that is installed in this version.

    It is the SHA-256 of the hashes of its files by their names, as pip has recorded them.
    """
    table = io.StringIO()
    rows = [(name, version, _hash(name, version)) for name, version in versions.items()]
    csv.writer(table, lineterminator="\n").writerows([("package", "version", "sha256"), *rows])
    return table.getvalue().encode()


def _hash(name: str, version: str) -> str:
    found = _find(name)
    if found is None or found.version != version:
        return ""
    lines = sorted(
        f"{file.as_posix()} {file.hash.mode}:{file.hash.value}\n"
        for file in found.files or ()
        if file.hash is not None and ".." not in file.parts and file.name not in _OF_INSTALLER
    )
    return sha256("".join(lines).encode()).hexdigest()


def _find(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None
