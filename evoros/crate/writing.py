"""Writes the archive of a study: its runs, their inputs, the software, metadata and a README."""

import os
import shlex
import socket
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from evoros.base.errors import InputError
from evoros.config.recorded import relocate_recorded
from evoros.crate.inputs import find_top, list_parts, list_read, read_input
from evoros.crate.layout import Layout
from evoros.crate.licence import check_licence
from evoros.crate.metadata import METADATA, RunFacts, StudyFacts, write_metadata
from evoros.crate.places import list_places, place_inside, place_named
from evoros.crate.readme import Code, write_readme
from evoros.crate.secrets import LOCAL, Secrets, is_telling
from evoros.crate.software import list_software, read_code
from evoros.evolution.experiment import Experiment
from evoros.files.disk import replacing
from evoros.files.origin import read_origin
from evoros.files.reads import collect_reads
from evoros.files.zipped import add_folder, add_member, require_fitting, seal_zip
from evoros.session.resume import rebuild
from evoros.storage.archives import CHECKSUMS, INPUTS, RECORD, is_run, write_record, write_sums
from evoros.storage.file_reading import read_bytes, read_sealed
from evoros.storage.layout import CONFIG, CONFIG_DIR, MANIFEST, STATUS, TRAJECTORIES, command_of
from evoros.storage.portable import PortableRun, hash_content
from evoros.storage.relocation import Relocation

README = "README.md"


@dataclass(frozen=True)
class Request:
    """A study to archive."""

    folders: Sequence[Path]
    output: Path
    config_dir: Path | None = None
    licence: str | None = None
    authors: Sequence[str] = ()


@dataclass(frozen=True)
class _Source:
    """A finished run or evaluation, built again, and what was read of the user's files."""

    folder: Path
    place: str  # in the archive
    manifest: Mapping[str, Any]
    experiment: Experiment
    reads: frozenset[Path]
    named: Mapping[str, str]  # folders that it may name, by their full paths, each with its place

    @property
    def working(self) -> Path:
        """The folder in which it was started, or the current one if there is no such folder."""
        return self.origin if self.origin.is_dir() else Path.cwd()

    @property
    def origin(self) -> Path:
        """The folder in which it was started, on whatever machine."""
        return Path(self.manifest["working_directory"])


def write_archive(request: Request) -> int:
    """Write the archive and return the number of its files. This builds all experiments.

    Raises:
        InputError: a folder has no finished run, something that a run is made of has changed, a
            file has what an archive must not have, or the archive cannot be written.
    """
    check_licence(request.licence)
    if request.output.exists():
        raise InputError(
            f"--output {request.output}: must be a new file, and it exists; delete it, or choose "
            f"another"
        )
    sources = [
        _build(folder, place, request) for folder, place in list_places(request.folders).items()
    ]
    files = _list_files(sources, request)
    try:
        folders = [INPUTS, *(source.place for source in sources)]
        return _write(request.output, files, folders, _secrets(sources, request))
    except OSError as error:
        raise InputError(
            f"--output {request.output}: cannot be written ({error.strerror}); free some space, or "
            f"choose another"
        ) from error


def _build(folder: Path, place: str, request: Request) -> _Source:
    manifest = read_sealed(folder, MANIFEST)
    if manifest.get(CONFIG_DIR) and request.config_dir is None:
        raise InputError(
            f"{folder}: was made with parts of your own, which belong into the archive; add "
            f"--config-dir {shlex.quote(str(manifest[CONFIG_DIR]))}"
        )
    with collect_reads() as reads:
        built = rebuild(folder, (), request.config_dir, command_of(folder), warns=False)
    read = list_read(reads, built.experiment, folder)
    named = place_named(folder, manifest, request.folders)
    return _Source(folder, place, manifest, built.experiment, frozenset(read), named)


def _find_inputs(sources: Sequence[_Source], own: Path | None) -> tuple[list[Path], Layout]:
    """Find the files from which the runs follow, and where they are placed."""
    working = {source.working for source in sources}
    parts = [] if own is None else list(list_parts(own))
    files = sorted({*parts, *(path for source in sources for path in source.reads)})
    known = Layout(dict.fromkeys([*working, *([own] if own else [])], ""))
    tops = {find_top(file) for file in files if not known.holds(file)}
    folders = [*sorted(working), *([own] if own else []), *sorted(tops)]
    return files, Layout.around(folders, Path.home())


def _list_files(sources: Sequence[_Source], request: Request) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of each file of the archive but the checksums."""
    own = None if request.config_dir is None else request.config_dir.resolve()
    inputs, layout = _find_inputs(sources, own)
    sizes: dict[str, int] = {}
    facts = StudyFacts(
        request.output.stem,
        _version(sources),
        [RunFacts(s.place, s.manifest, read_sealed(s.folder, STATUS)) for s in sources],
        sizes,
        request.licence,
        request.authors,
    )
    code = read_code([source.manifest for source in sources])
    contents = _list_content(sources, inputs, layout, own)
    for name, content in chain(contents, _list_figures(request.folders)):
        if f"/{TRAJECTORIES}/" not in name:
            sizes[name] = len(content)
        yield name, content
    own_parts = None if own is None else layout.place(own)
    summary = Code(code.commits, code.changed, code.patch is not None)
    readme = write_readme(facts, summary, request.output.name, own_parts)
    others = {README: readme, RECORD: write_record(facts.version)}
    for name, content in [*list_software(code, [s.manifest for s in sources]), *others.items()]:
        sizes[name] = len(content)
        yield name, content
    yield METADATA, write_metadata(facts)


def _version(sources: Sequence[_Source]) -> str:
    """Return the version of evoros that made the first run."""
    return str(sources[0].manifest["packages"].get("evoros") or read_origin().version)


def _list_content(
    sources: Sequence[_Source], inputs: Sequence[Path], layout: Layout, own: Path | None
) -> Iterator[tuple[str, bytes]]:
    for path in inputs:
        place, content = layout.place(path), read_input(path)
        if path.suffix == ".yaml":  # names files as they were typed; the runs have copies
            content = _relocation(sources[0], layout).relocate_bytes(content)
        yield place, content
    for source in sources:
        places = _relocation(source, layout)
        config = relocate_recorded(source.folder / CONFIG, places.relocate)
        run = PortableRun(
            source.folder,
            source.experiment,
            config.text,
            config.values,
            places,
            layout.place(source.working),
            None if own is None else layout.place(own),
        )
        yield from ((f"{source.place}/{name}", content) for name, content in run.files())


def _list_figures(folders: Sequence[Path]) -> Iterator[tuple[str, bytes]]:
    """Yield the figures of whole sweeps, which lie beside their runs."""
    for top in folders:
        for file in sorted((top / "figures").glob("[!.]*")):
            if not is_run(top) and file.is_file() and not file.is_symlink():
                yield f"{place_inside(top, top)}/figures/{file.name}", read_bytes(file)


def _relocation(source: _Source, layout: Layout) -> Relocation:
    others = {str(Path.home()): "~", str(source.origin): ".", **source.named}
    others[str(source.folder.resolve())] = source.place
    if is_telling(socket.gethostname()):  # of the scheduler of a cluster
        others[socket.gethostname()] = LOCAL
    others.pop("/", None)
    return layout.relocation(layout.place(source.working), others)


def _secrets(sources: Sequence[_Source], request: Request) -> Secrets:
    paths = {path for s in sources for path in (s.working, s.origin, s.folder.resolve())}
    paths |= {Path(name) for source in sources for name in source.named}
    if request.config_dir is not None:
        paths.add(request.config_dir.resolve())
    known: set[str] = set()
    for source in sources:
        texts = {**source.manifest, **source.manifest["packages"]}.values()
        known |= {text for text in texts if isinstance(text, str)}
    return Secrets(paths, known - {str(path) for path in paths}, os.environ)


def _write(
    output: Path, files: Iterator[tuple[str, bytes]], folders: Sequence[str], secrets: Secrets
) -> int:
    """Write the files, and last their checksums; if anything fails, there is no file."""
    digests: dict[str, str] = {}
    total = 0
    output.parent.mkdir(parents=True, exist_ok=True)
    with replacing(output) as file:
        with ZipFile(file, "w") as archive:
            for name, content in files:
                secrets.require_none(name, content)
                total += len(content)
                require_fitting(output, name, len(content), total)
                digests[name] = hash_content(content)
                add_member(archive, name, content)
            add_member(archive, CHECKSUMS, write_sums(digests))
            for name in folders:
                add_folder(archive, name)
        seal_zip(file)
    return len(digests) + 1
