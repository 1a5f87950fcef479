"""Compares the folders of two runs, evaluations or sweeps: equal, or the first difference."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.config.recorded import flatten_recorded
from evoros.session.file_differences import (
    FIGURES,
    NOTHING,
    compare_missions,
    find_difference,
    tell,
)
from evoros.storage.discovery import folders_below
from evoros.storage.layout import CONFIG, MANIFEST, STATUS, read_json
from evoros.storage.verification import verify_folder

COMPARED = (
    "setting.json",
    "designs_in.csv",
    "genes_in.csv",
    "generations/*",
    "designs.csv",
    "worst_cases.csv",
    "champion/**/*",
    "trajectories/**/*",
    "figures/*",
)
"""Files that follow from the configuration, after the missions, in the order in which they do."""
FREE = ("executor", "figures")
"""Keys, or first parts of keys, on which no result depends."""
OWN_HASHES = "configuration"
"""Hashes of the configuration in the manifest begin with this."""
MADE_BY = (
    "commit",
    "dirty",
    "packages",
    "programs",
    "python",
    "platform",
    "operating_system",
    "processor",
)
"""Fields of the manifest that may differ between equal runs."""


@dataclass
class Diff:
    """What was compared; ``difference`` is the first difference, or empty."""

    folders: int = 0
    files: int = 0
    missions: int = 0
    difference: str = ""
    circumstances: dict[str, None] = field(default_factory=dict)  # in order, each once


def diff_runs(one: Path, other: Path) -> Diff:
    """Compare two runs or evaluations, or all below two folders, which have to have equal paths.

    Raises:
        InputError: there are none, or a file is damaged.
    """
    diff = Diff()
    for name, present in _pair(one, other).items():
        missing = [path for path, found in zip((one, other), present, strict=True) if not found]
        if missing:
            diff.difference = f"{name}: there is none in {missing[0]}"
        else:
            _diff_folders(one / name, other / name, diff)
        if diff.difference:
            return diff
    return diff


def _pair(one: Path, other: Path) -> dict[str, tuple[bool, bool]]:
    """Return the paths of the folders of runs below either, and which of the two has each."""
    found = []
    for path in (one, other):
        if not path.is_dir():
            raise InputError(f"{path}: must be the folder of a run, and there is none; correct it")
        names = [str(folder.relative_to(path)) for folder in folders_below(path)]
        if not names:
            raise InputError(
                f"{path}: must be the folder of a run or a sweep, and contains none; correct it"
            )
        found.append(names)
    if (found[0] == ["."]) != (found[1] == ["."]):
        raise InputError(
            f"{one}, {other}: must both be folders of runs, or both folders with runs below them; "
            f"give two of a kind"
        )
    return {name: (name in found[0], name in found[1]) for name in dict.fromkeys(chain(*found))}


def _diff_folders(one: Path, other: Path, diff: Diff) -> None:
    for folder in (one, other):
        verify_folder(folder)
    diff.folders += 1
    for difference in _list_differences(one, other, diff):
        if difference:
            diff.difference = difference
            return
        diff.files += 1


def _list_differences(one: Path, other: Path, diff: Diff) -> Iterator[str]:
    """Yield the difference of each file, or an empty text for equal ones, in order."""
    yield _diff_configurations(one, other, diff)
    yield _diff_manifests(one, other, diff)
    difference, count = compare_missions(one, other)
    diff.missions += count
    yield difference
    for name in _list_files(one, other):
        absent = [folder for folder in (one, other) if not (folder / name).is_file()]
        if not absent:
            yield find_difference(one, other, name)
        elif not name.startswith(FIGURES):
            yield f"{name}: there is none in {absent[0]}"


def _list_files(one: Path, other: Path) -> Iterator[str]:
    """Yield the names of all files of either folder that follow from the configuration."""
    for pattern in COMPARED:
        paths = [path.relative_to(base) for base in (one, other) for path in base.glob(pattern)]
        names = sorted({str(path) for path in paths if not path.name.startswith(".")})
        yield from (name for name in names if (one / name).is_file() or (other / name).is_file())


def _diff_configurations(one: Path, other: Path, diff: Diff) -> str:
    first, second = (flatten_recorded(folder / CONFIG) for folder in (one, other))
    for key in _differing(first, second):
        if key.partition(".")[0] not in FREE:
            values = [values.get(key, NOTHING) for values in (first, second)]
            return f"{CONFIG}: {tell(key, one, values[0], other, values[1])}"
        diff.circumstances[key.partition(".")[0]] = None
    return ""


def _diff_manifests(one: Path, other: Path, diff: Diff) -> str:
    """Compare the hashes of what the folders were made from, and note who made them."""
    first, second = (read_json(folder / MANIFEST) for folder in (one, other))
    same_text = (one / CONFIG).read_bytes() == (other / CONFIG).read_bytes()
    hashes = [manifest.get("sha256", {}) for manifest in (first, second)]
    for name in _differing(*hashes):
        if same_text or not name.startswith(OWN_HASHES):
            return f"{MANIFEST}: the hash of {name} differs between {one} and {other}"
    for name in _differing(*({key: m.get(key) for key in MADE_BY} for m in (first, second))):
        diff.circumstances[name] = None
    states = [read_json(folder / STATUS).get("state") for folder in (one, other)]
    if states[0] != states[1]:
        diff.circumstances["state"] = None
    return ""


def _differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    return [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]


def describe_diff(diff: Diff) -> str:
    """Describe the result in one or two lines."""
    if diff.difference:
        return f"different: {diff.difference}"
    runs = f"{diff.folders} folders, " if diff.folders > 1 else ""
    lines = [f"equal: {runs}{diff.missions} missions, {diff.files} files"]
    if diff.circumstances:
        lines.append(f"made with another {', '.join(diff.circumstances)}")
    return "\n".join(lines)
