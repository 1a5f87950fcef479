"""Compares the folders of two runs, evaluations or sweeps: equal, or the first difference."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.config.recorded import flatten_recorded
from evoros.observers import protocol
from evoros.session.file_differences import (
    FIGURES,
    NOTHING,
    compare_missions,
    find_difference,
    tell,
)
from evoros.storage.discovery import folders_below
from evoros.storage.file_reading import hash_file
from evoros.storage.layout import CONFIG, MANIFEST, STATUS, read_json
from evoros.storage.verification import verify_folder
from evoros.terminal.log import warn_left_out

COMPARED = (
    "setting.json",
    "designs_in.csv",
    "genes_in.csv",
    "generations/*",
    "designs.csv",
    "worst_cases.csv",
    "requirements.csv",
    "requirements.md",
    "junit.xml",
    "champion/**/*",
    "trajectories/**/*",
    "figures/*",
)
"""Files that follow from the configuration, after the missions, in the order in which they do."""
PAGE = ".html"
"""The end of the names of pages, whose content is that of the other files."""
FREE = (*protocol.FREE, "figures")
"""Keys, or first parts of keys, on which no file depends that is compared."""
OBSERVERS = "observers"
"""Key that is not even a circumstance: nothing in a folder is theirs."""
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
    """The result of a comparison; ``difference`` is the first difference, or empty."""

    folders: int = 0
    files: int = 0
    missions: int = 0
    difference: str = ""
    circumstances: dict[str, None] = field(default_factory=dict)  # in order, each once


def diff_runs(one: Path, other: Path) -> Diff:
    """Compare two runs or evaluations, or all below two folders, by their paths there.

    Raises:
        InputError: there are none, or a file is damaged.
    """
    diff = Diff()
    names, others = _list_runs(one), _list_runs(other)
    if (names == ["."]) != (others == ["."]):
        raise InputError(
            f"{one}, {other}: must both be folders of runs, or both folders with runs below them; "
            f"give two of a kind"
        )
    for name in dict.fromkeys([*names, *others]):
        if name not in names or name not in others:
            diff.difference = f"{name}: there is none in {other if name in names else one}"
        else:
            _diff_folders(one / name, other / name, diff)
        if diff.difference:
            break
    return diff


def _list_runs(path: Path) -> list[str]:
    """Return the paths of the folders of runs in a folder, relative to it."""
    if not path.is_dir():
        raise InputError(f"{path}: must be the folder of a run, and there is none; correct it")
    names = [str(folder.relative_to(path)) for folder in folders_below(path, warn_left_out)]
    if not names:
        raise InputError(
            f"{path}: must be the folder of a run or a sweep, and contains none; correct it"
        )
    return names


def _diff_folders(one: Path, other: Path, diff: Diff) -> None:
    verify_folder(one)
    verify_folder(other)
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
        if name.startswith(FIGURES) and name.endswith(PAGE):
            continue  # it names the folder, the date and the versions
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
        if key.partition(".")[0] != OBSERVERS:
            diff.circumstances[key.partition(".")[0]] = None
    return ""


def _diff_manifests(one: Path, other: Path, diff: Diff) -> str:
    """Compare the hashes of the sources of two folders, and note their circumstances."""
    first, second = (read_json(folder / MANIFEST) for folder in (one, other))
    same_text = hash_file(one / CONFIG) == hash_file(other / CONFIG)
    for name in _differing(first.get("sha256", {}), second.get("sha256", {})):
        if same_text or not name.startswith(OWN_HASHES):
            return f"{MANIFEST}: the hash of {name} differs between {one} and {other}"
    made_by = [name for name in MADE_BY if first.get(name) != second.get(name)]
    diff.circumstances |= dict.fromkeys(made_by)
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
