"""The metadata (RO-Crate, profile Process Run Crate) and README of an archive."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from jinja2 import StrictUndefined, Template

from evoros.base.errors import InputError
from evoros.plugins.archives.software import RecordedCode
from evoros.storage.archives import INPUTS, RUNS
from evoros.storage.layout import CONFIG, DIGESTS, MANIFEST, MISSIONS, SETTING, STATUS

_README = Path(__file__).with_name("README.md.jinja")
_IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+-]*")
METADATA = "ro-crate-metadata.json"
SPECIFICATION = "https://w3id.org/ro/crate/1.1"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
PROGRAM = "#evoros"
LICENCE_FILE = "software/LICENSE"
_SUFFIXES = {
    "application/json": "json",
    "application/pdf": "pdf",
    "application/xml": "sdf urdf xacro xml",
    "application/yaml": "cff yaml",
    "image/png": "png",
    "image/svg+xml": "svg",
    "model/obj": "obj",
    "model/stl": "stl",
    "model/vnd.collada+xml": "dae",
    "text/csv": "csv",
    "text/html": "html",
    "text/markdown": "md",
    "text/plain": "txt",
    "text/x-diff": "patch",
    "text/x-python": "py",
}
_TYPES = {f".{suffix}": kind for kind, names in _SUFFIXES.items() for suffix in names.split()}
_ABOUT = {
    CONFIG: "the composed configuration, which determines everything else",
    MANIFEST: "versions, machine and hashes of the inputs",
    MISSIONS: "one row per mission",
    SETTING: "the robot, its sensors and the courses, for figures",
    DIGESTS: "digests of the run's other files",
    STATUS: "the state of the run",
}
Entity = dict[str, Any]


@dataclass(frozen=True)
class RunFacts:
    """A run or evaluation: its path in the archive, and its sealed files."""

    place: str
    manifest: Mapping[str, Any]
    status: Mapping[str, Any]


@dataclass(frozen=True)
class StudyFacts:
    """The content of an archive, for its metadata."""

    name: str
    version: str  # version of evoros
    runs: Sequence[RunFacts]
    files: Mapping[str, int]  # size [bytes] of each file except the metadata
    licence: str | None  # SPDX identifier
    authors: Sequence[str]


def write_metadata(facts: StudyFacts) -> bytes:
    """Return the content of the file ``METADATA``."""
    graph = [*_describe_root(facts), _describe_program(facts)]
    for run in facts.runs:
        graph += _describe_run(run, facts)
    graph += [_describe_folder(INPUTS, "the input files of the runs", facts)]
    graph += [_describe_file(name, facts) for name in facts.files]
    text = json.dumps({"@context": f"{SPECIFICATION}/context", "@graph": graph}, indent=1)
    return f"{text}\n".encode()


def _describe_root(facts: StudyFacts) -> list[Entity]:
    authors = [
        {"@id": f"#author-{index}", "@type": "Person", "name": name}
        for index, name in enumerate(facts.authors)
    ]
    licence = _describe_licence(facts.licence)
    root: Entity = {
        "@id": "./",
        "@type": "Dataset",
        "name": facts.name,
        "description": f"The study {facts.name}: runs and evaluations by evoros {facts.version} "
        f"({len(facts.runs)} in total), with everything needed to rerun them.",
        "datePublished": max(run.status["updated"] for run in facts.runs),
        "license": {"@id": licence["@id"]},
        "conformsTo": {"@id": PROFILE},
        "hasPart": _refer(_list_parts(facts)),
        "mentions": _refer([f"#{run.place}" for run in facts.runs]),
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
    config, own = f"{run.place}/{CONFIG}", f"{run.place}/"
    results = [name for name in facts.files if name.startswith(own) and name != config]
    inputs = [config, *(name for name in facts.files if name.startswith(f"{INPUTS}/"))]
    manifest = run.manifest
    name = run.place.removeprefix(f"{RUNS}/")
    action: Entity = {
        "@id": quote(f"#{run.place}", safe="#/"),
        "@type": "CreateAction",
        "name": f"{manifest['command']}: {name}",
        "description": f"The command {manifest['command']} made {name} from the seed "
        f"{manifest['seed']} with {', '.join(manifest['simulators'])}.",
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
    """Return references to files: a list or, as is customary in RO-Crates, a single reference."""
    parts = [{"@id": quote(name, safe="#/")} for name in names]
    return parts[0] if len(parts) == 1 else parts


def _describe_folder(place: str, about: str, facts: StudyFacts) -> Entity:
    return {
        "@id": f"{quote(place)}/",
        "@type": "Dataset",
        "name": PurePath(place).name,
        "description": about,
        "hasPart": _refer([name for name in facts.files if name.startswith(f"{place}/")]),
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


def check_licence(identifier: str | None) -> None:
    """Check that the licence, if given, is an SPDX identifier."""
    if identifier is not None and not _IDENTIFIER.fullmatch(identifier):
        raise InputError(
            f"--license: must be an SPDX identifier such as CC-BY-4.0, not {identifier!r}; choose "
            f"one from https://spdx.org/licenses"
        )


def _describe_licence(identifier: str | None) -> dict[str, Any]:
    if identifier is None:
        return {
            "@id": "#license",
            "@type": "CreativeWork",
            "name": "No licence was chosen",
            "description": "The authors have not chosen a licence for this study.",
        }
    return {
        "@id": f"https://spdx.org/licenses/{identifier}",
        "@type": "CreativeWork",
        "name": identifier,
        "description": f"The SPDX licence {identifier}.",
    }


def write_readme(
    facts: StudyFacts, code: RecordedCode, archive: str, own_parts: str | None
) -> bytes:
    """Return the content of ``README.md`` for an archive with the file name ``archive``."""
    template = Template(
        _README.read_text(encoding="utf-8"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    text: str = template.render(facts=facts, code=code, archive=archive, own_parts=own_parts)
    return text.encode(errors="backslashreplace")
