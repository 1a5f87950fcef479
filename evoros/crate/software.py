"""The software of an archive: packages, the code of evoros, its licence and citation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from evoros.crate.packages import list_versions, write_hashes, write_requirements
from evoros.files.origin import read_origin, read_patch
from evoros.files.resources import PACKAGE
from evoros.storage.circumstances import OWN

FOLDER = "software"


@dataclass(frozen=True)
class RecordedCode:
    """The code of evoros that made some runs."""

    commits: Sequence[str]
    changed: bool  # whether its files differed from the commit in a run
    patch: bytes | None  # how they differ now; None if unknown, or if they never did


def read_code(manifests: Sequence[Mapping[str, Any]]) -> RecordedCode:
    """Return the code of runs. The patch is known in a checkout of their one commit."""
    known = (manifest.get("commit") for manifest in manifests)
    commits = list(dict.fromkeys(commit for commit in known if commit))
    changed = any(manifest.get("dirty") for manifest in manifests)
    patch = read_patch() if changed and commits == [read_origin().commit] else None
    return RecordedCode(commits, changed, patch.encode() if patch else None)


def list_software(
    code: RecordedCode, manifests: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of each file about the software."""
    versions = list_versions(manifests)
    yield f"{FOLDER}/requirements.txt", write_requirements(versions)
    yield f"{FOLDER}/packages.csv", write_hashes(versions)
    if code.patch is not None:
        yield f"{FOLDER}/evoros.patch", code.patch
    for name in ("LICENSE", "CITATION.cff"):
        content = _read_own(name)
        if content is not None:
            yield f"{FOLDER}/{name}", content


def _read_own(name: str) -> bytes | None:
    """Read a file that evoros has at the top of a checkout; a wheel has it in its metadata."""
    places = [PACKAGE.parent / name, PACKAGE / name]
    if not (PACKAGE.parent / "pyproject.toml").is_file():
        places = [PACKAGE / name]
        try:
            files = distribution(OWN).files or ()
            places += [Path(str(file.locate())) for file in files if file.name == name]
        except PackageNotFoundError:
            pass
    return next((place.read_bytes() for place in places if place.is_file()), None)
