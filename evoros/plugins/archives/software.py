"""The software in an archive: packages, and the code, licence and citation of evoros."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from evoros.files.origin import read_origin, read_patch
from evoros.files.resources import PACKAGE
from evoros.storage.circumstances import OWN, normalize
from evoros.storage.tables import to_csv

_OF_INSTALLER = ("INSTALLER", "REQUESTED", "RECORD", "direct_url.json")  # written by installers
FOLDER = "software"


@dataclass(frozen=True)
class RecordedCode:
    """The commits of evoros that made some runs, and uncommitted changes."""

    commits: Sequence[str]  # unique
    changed: bool  # whether any run had uncommitted changes
    patch: bytes | None  # the uncommitted changes; None if there are none or if they are unknown


def read_code(manifests: Sequence[Mapping[str, Any]]) -> RecordedCode:
    """Return the code of runs; the patch is known only if all used the commit checked out here."""
    known = (manifest.get("commit") for manifest in manifests)
    commits = list(dict.fromkeys(commit for commit in known if commit))
    changed = any(manifest.get("dirty") for manifest in manifests)
    patch = read_patch() if changed and commits == [read_origin().commit] else None
    return RecordedCode(commits, changed, patch.encode() if patch else None)


def list_software(
    code: RecordedCode, manifests: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of each file that describes the software."""
    versions = _list_versions(manifests)
    required = "".join(f"{name}=={version}\n" for name, version in versions.items())
    yield f"{FOLDER}/requirements.txt", required.encode()
    hashes = [(name, version, _hash(name, version)) for name, version in versions.items()]
    table = to_csv([("package", "version", "sha256"), *hashes])
    yield f"{FOLDER}/packages.csv", table.encode()
    if code.patch is not None:
        yield f"{FOLDER}/evoros.patch", code.patch
    for name in ("LICENSE", "CITATION.cff"):
        content = _read_own(name)
        if content is not None:
            yield f"{FOLDER}/{name}", content


def _read_own(name: str) -> bytes | None:
    """Read a file from the root of evoros's checkout, or from its wheel."""
    places = [PACKAGE.parent / name, PACKAGE / name]
    if not (PACKAGE.parent / "pyproject.toml").is_file():
        places = [PACKAGE / name]
        try:
            files = distribution(OWN).files or ()
            places += [Path(str(file.locate())) for file in files if file.name == name]
        except PackageNotFoundError:
            pass
    return next((place.read_bytes() for place in places if place.is_file()), None)


def _list_versions(manifests: Iterable[Mapping[str, Any]]) -> dict[str, str]:
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


def _hash(name: str, version: str) -> str:
    """Return a digest of a package's files, or "" unless this version is installed."""
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
