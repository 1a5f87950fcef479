"""The metadata of an archive: an RO-Crate with the profile Process Run Crate."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any
from urllib.parse import quote

from evoros.crate.licence import describe_licence
from evoros.storage.archives import INPUTS, RUNS
from evoros.storage.layout import CONFIG, DIGESTS, MANIFEST, MISSIONS, SETTING, STATUS

METADATA = "ro-crate-metadata.json"
SPECIFICATION = "https://w3id.org/ro/crate/1.1"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
PROGRAM = "#evoros"
LICENCE_FILE = "software/LICENSE"
_TYPES = {
    ".cff": "application/yaml",
    ".csv": "text/csv",
    ".dae": "model/vnd.collada+xml",
    ".html": "text/html",
    ".json": "application/json",
    ".md": "text/markdown",
    ".obj": "model/obj",
    ".patch": "text/x-diff",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".py": "text/x-python",
    ".sdf": "application/xml",
    ".stl": "model/stl",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
    ".urdf": "application/xml",
    ".xacro": "application/xml",
    ".xml": "application/xml",
    ".yaml": "application/yaml",
}
_ABOUT = {
    CONFIG: "the composed configuration, from which everything else follows",
    MANIFEST: "versions, machine and hashes of what the run was made from",
    MISSIONS: "a row for each mission",
    SETTING: "the robot, its sensors and the courses, for figures",
    DIGESTS: "digests of the other files of the run",
    STATUS: "the state of the run",
}
Entity = dict[str, Any]


@dataclass(frozen=True)
class RunFacts:
    """A run or an evaluation in an archive: its folder there, and its sealed files."""

    place: str
    manifest: Mapping[str, Any]
    status: Mapping[str, Any]


@dataclass(frozen=True)
class StudyFacts:
    """An archive as its metadata describe it."""

    name: str
    version: str  # of evoros
    runs: Sequence[RunFacts]
    files: Mapping[str, int]  # the size of each [bytes], but for the metadata
    licence: str | None  # its SPDX identifier
    authors: Sequence[str]


def write_metadata(facts: StudyFacts) -> bytes:
    """Return the content of ``METADATA``."""
    graph = [*_describe_root(facts), _describe_program(facts)]
    for run in facts.runs:
        graph += _describe_run(run, facts)
    graph += [_describe_folder(INPUTS, "the files from which the runs follow", facts)]
    graph += [_describe_file(name, facts) for name in facts.files]
    text = json.dumps({"@context": f"{SPECIFICATION}/context", "@graph": graph}, indent=1)
    return f"{text}\n".encode()


def _describe_root(facts: StudyFacts) -> list[Entity]:
    authors = [
        {"@id": f"#author-{index}", "@type": "Person", "name": name}
        for index, name in enumerate(facts.authors)
    ]
    licence = describe_licence(facts.licence)
    root: Entity = {
        "@id": "./",
        "@type": "Dataset",
        "name": facts.name,
        "description": f"The study {facts.name}: {len(facts.runs)} runs and evaluations by evoros "
        f"{facts.version}, with all that is needed to run them again.",
        "datePublished": max(run.status["updated"] for run in facts.runs),
        "license": {"@id": licence["@id"]},
        "conformsTo": {"@id": PROFILE},
        "hasPart": _refer(_list_parts(facts)),
        "mentions": _refer([_action_id(run) for run in facts.runs]),
    }
    if authors:
        root["author"] = _refer([author["@id"] for author in authors])
    profile = {"@id": PROFILE, "@type": "CreativeWork", "name": "Process Run Crate"}
    descriptor = {
        "@id": METADATA,
        "@type": "CreativeWork",
        "about": {"@id": "./"},
        "conformsTo": {"@id": SPECIFICATION},
    }
    return [descriptor, root, {**profile, "version": "0.5"}, licence, *authors]


def _list_parts(facts: StudyFacts) -> list[str]:
    """List the folders of the inputs and of each run, and the files outside of these."""
    folders = [f"{INPUTS}/", *(f"{run.place}/" for run in facts.runs)]
    return [*folders, *(name for name in facts.files if not name.startswith(tuple(folders)))]


def _describe_program(facts: StudyFacts) -> Entity:
    return {
        "@id": PROGRAM,
        "@type": "SoftwareApplication",
        "name": "evoros",
        "description": "A declarative framework for evolving robot designs in simulation.",
        "softwareVersion": facts.version,
        "softwareRequirements": {"@id": "software/requirements.txt"},
        **({"license": {"@id": LICENCE_FILE}} if LICENCE_FILE in facts.files else {}),
    }


def _describe_run(run: RunFacts, facts: StudyFacts) -> list[Entity]:
    own = [name for name in facts.files if name.startswith(f"{run.place}/")]
    config = f"{run.place}/{CONFIG}"
    results = [name for name in own if name != config]
    inputs = [config, *(name for name in facts.files if name.startswith(f"{INPUTS}/"))]
    manifest = run.manifest
    name = run.place.removeprefix(f"{RUNS}/")
    action: Entity = {
        "@id": quote(_action_id(run), safe="#/"),
        "@type": "CreateAction",
        "name": f"{manifest['command']}: {name}",
        "description": f"The command {manifest['command']} made {name}, from the seed "
        f"{manifest['seed']}, by {', '.join(manifest['simulators'])}.",
        "instrument": {"@id": PROGRAM},
        "object": _refer(inputs),
        "result": _refer(results),
        "startTime": manifest["created"],
        "endTime": run.status["updated"],
        "actionStatus": "http://schema.org/CompletedActionStatus",
    }
    if facts.authors:
        action["agent"] = {"@id": "#author-0"}
    return [action, _describe_folder(run.place, f"the files of {name}", facts)]


def _refer(names: Sequence[str]) -> Any:
    """Refer to some files; one stands alone, as in all JSON-LD of RO-Crates."""
    parts = [{"@id": quote(name, safe="#/")} for name in names]
    return parts[0] if len(parts) == 1 else parts


def _describe_folder(place: str, about: str, facts: StudyFacts) -> Entity:
    parts = [name for name in facts.files if name.startswith(f"{place}/")]
    name = PurePath(place).name
    return {
        "@id": _folder_id(place),
        "@type": "Dataset",
        "name": name,
        "description": about,
        "hasPart": _refer(parts),
    }


def _describe_file(name: str, facts: StudyFacts) -> Entity:
    file = PurePath(name)
    entity: Entity = {
        "@id": quote(name),
        "@type": "File",
        "name": file.name,
        "contentSize": str(facts.files[name]),
        "encodingFormat": _TYPES.get(file.suffix.lower(), "application/octet-stream"),
    }
    if name.startswith(f"{RUNS}/") and file.name in _ABOUT:
        entity["description"] = _ABOUT[file.name]
    return entity


def _folder_id(place: str) -> str:
    return f"{quote(place)}/"


def _action_id(run: RunFacts) -> str:
    return f"#{run.place}"
