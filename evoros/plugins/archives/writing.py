"""Writes archives, which contain runs, input files, software, metadata and a README."""

import os
import re
import socket
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import quote
from zipfile import ZipFile

from evoros.base.errors import InputError, shell_line
from evoros.config.recorded import flatten_recorded, relocate_recorded
from evoros.config.references import is_private
from evoros.evolution.experiment import Experiment
from evoros.files.disk import replacing
from evoros.files.origin import read_origin
from evoros.files.private import SECRET, find_home
from evoros.files.reads import collect_reads
from evoros.files.zipped import add_folder, add_member, require_fitting, seal_zip
from evoros.plugins.archives import metadata
from evoros.plugins.archives.layout import (
    Layout,
    find_top,
    list_parts,
    list_places,
    list_read,
    place_inside,
    place_named,
    read_input,
)
from evoros.plugins.archives.portable import PortableRun
from evoros.plugins.archives.software import list_software, read_code
from evoros.session.rebuilding import rebuild
from evoros.storage import archives
from evoros.storage.layout import (
    CONFIG,
    CONFIG_DIR,
    MANIFEST,
    STATUS,
    TRAJECTORIES,
    read_bytes,
    read_sealed,
)

_SHORTEST = 8  # length below which names and values of variables are treated as ordinary words
LOCAL = "localhost"
README = "README.md"


def is_telling(host: str) -> bool:
    """Return True if a machine's name is unlikely to be an ordinary word."""
    return len(host) >= _SHORTEST and host != LOCAL


class Secrets:
    """Strings that an archive must not contain, except within ``harmless`` strings like commits."""

    def __init__(
        self, paths: Iterable[Path], harmless: Collection[str], environment: Mapping[str, str]
    ) -> None:
        home = find_home()
        self._texts: dict[str, str] = {}
        for path in paths:
            if len(path.parts) > 2:
                self._texts[str(path)] = "a path on this machine"
        if home not in (None, Path("/")):
            self._texts[str(home)] = "the path of your home folder"
        host = socket.gethostname()
        if is_telling(host) and host not in harmless:
            self._texts[host] = "the name of this machine"
        for name, value in environment.items():
            system = os.path.isabs(value) and os.path.exists(value)
            telling = value not in harmless or SECRET.search(name)
            if len(value) >= _SHORTEST and not system and telling:
                self._texts.setdefault(value, f"the value of the environment variable {name}")
        slashed = [(text, kind) for text, kind in self._texts.items() if "/" in text]
        self._texts |= {quote(os.fsencode(text)): kind for text, kind in slashed}

    @cached_property
    def _pattern(self) -> re.Pattern[bytes]:
        texts = sorted(self._texts, key=len, reverse=True)
        return re.compile(b"|".join(map(_match, texts)))

    def require_none(self, name: str, content: bytes) -> None:
        """Check that neither the name nor the content of a file contains a secret."""
        if not any(os.fsencode(text) in content or text in name for text in self._texts):
            return
        match = self._pattern.search(content) or self._pattern.search(os.fsencode(name))
        if match is None:
            return
        kind = self._texts[os.fsdecode(match[0])]
        line = content.count(b"\n", 0, match.start()) + 1
        fix = "remove the value, or unset the variable if the value is not secret"
        if "variable" not in kind:
            fix = "make the path relative, or remove it"
        raise InputError(f"{name}: line {line} contains {kind}, which must not be archived; {fix}")


def _match(text: str) -> bytes:
    """Return the pattern for a string; a path does not match the start of a longer file name."""
    pattern = re.escape(os.fsencode(text))
    return rb"(?<![\w.-])" + pattern + rb"(?![\w-])" if os.path.isabs(text) else pattern


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
    folder: Path
    place: str  # path in the archive
    manifest: Mapping[str, Any]
    experiment: Experiment
    reads: frozenset[Path]
    named: Mapping[str, str]  # archive path of each folder that the files may name, by full path

    @property
    def working(self) -> Path:
        """The folder in which the run was started or, if missing, the current folder."""
        return self.origin if self.origin.is_dir() else Path.cwd()

    @property
    def origin(self) -> Path:
        """The folder in which the run was started, possibly on another machine."""
        return Path(self.manifest["working_directory"])


def write_archive(request: Request) -> int:
    """Build all experiments, write the archive, and return the number of archived files."""
    metadata.check_licence(request.licence)
    if request.output.exists():
        raise InputError(
            f"--output {request.output}: already exists; delete the file, or choose another"
        )
    sources = [_build(*place, request) for place in list_places(request.folders).items()]
    files = _list_files(sources, request)
    try:
        folders = [archives.INPUTS, *(source.place for source in sources)]
        return _write(request.output, files, folders, _secrets(sources, request))
    except OSError as error:
        raise InputError(
            f"--output {request.output}: cannot be written ({error.strerror}); free some space or "
            f"choose another file"
        ) from error


def _build(folder: Path, place: str, request: Request) -> _Source:
    manifest = read_sealed(folder, MANIFEST)
    if manifest.get(CONFIG_DIR) and request.config_dir is None:
        raise InputError(
            f"{folder}: was made with your own parts, which must also be archived; add "
            f"{shell_line('--config-dir', str(manifest[CONFIG_DIR]))}"
        )
    with collect_reads() as reads:
        built = rebuild(folder, (), request.config_dir, warns=False)
    read = list_read(reads, built.experiment, folder)
    named = place_named(folder, manifest, request.folders)
    return _Source(folder, place, manifest, built.experiment, frozenset(read), named)


def _find_inputs(sources: Sequence[_Source], own: Path | None) -> tuple[list[Path], Layout]:
    working = {source.working for source in sources}
    parts = [] if own is None else list(list_parts(own))
    files = sorted({*parts, *(path for source in sources for path in source.reads)})
    known = Layout(dict.fromkeys([*working, *([own] if own else [])], ""))
    tops = {find_top(file) for file in files if not known.holds(file)}
    folders = [*sorted(working), *([own] if own else []), *sorted(tops)]
    return files, Layout.around(folders, find_home())


def _list_files(sources: Sequence[_Source], request: Request) -> Iterator[tuple[str, bytes]]:
    own = None if request.config_dir is None else request.config_dir.resolve()
    inputs, layout = _find_inputs(sources, own)
    sizes: dict[str, int] = {}
    facts = metadata.StudyFacts(
        request.output.stem,
        str(sources[0].manifest["packages"].get("evoros") or read_origin().version),
        [metadata.RunFacts(s.place, s.manifest, read_sealed(s.folder, STATUS)) for s in sources],
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
    readme = metadata.write_readme(facts, code, request.output.name, own_parts)
    others = {README: readme, archives.RECORD: archives.write_record(facts.version)}
    for name, content in [*list_software(code, [s.manifest for s in sources]), *others.items()]:
        sizes[name] = len(content)
        yield name, content
    yield metadata.METADATA, metadata.write_metadata(facts)


def _list_content(
    sources: Sequence[_Source], inputs: Sequence[Path], layout: Layout, own: Path | None
) -> Iterator[tuple[str, bytes]]:
    for path in inputs:
        place, content = layout.place(path), read_input(path)
        if path.suffix == ".yaml":  # paths as typed; the runs contain copies of these files
            content = _relocation(sources[0], layout).relocate_bytes(content)
        yield place, content
    for source in sources:
        places = _relocation(source, layout)
        config = relocate_recorded(source.folder / CONFIG, places.relocate)
        built = source.experiment, config.text, config.values
        own_parts = None if own is None else layout.place(own)
        run = PortableRun(source.folder, *built, places, layout.place(source.working), own_parts)
        yield from ((f"{source.place}/{name}", content) for name, content in run.files())


def _list_figures(folders: Sequence[Path]) -> Iterator[tuple[str, bytes]]:
    for top in folders:
        for file in sorted((top / "figures").glob("[!.]*")):
            if not archives.is_run(top) and file.is_file() and not file.is_symlink():
                yield f"{place_inside(top, top)}/figures/{file.name}", read_bytes(file)


def _relocation(source: _Source, layout: Layout) -> archives.Relocation:
    home = find_home()
    others = {} if home is None else {str(home): "~"}
    others |= {str(source.origin): ".", **source.named}
    others[str(source.folder.resolve())] = source.place
    if is_telling(socket.gethostname()):  # addresses of cluster schedulers may contain the name
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
        texts = [*source.manifest.values(), *source.manifest["packages"].values()]
        recorded = flatten_recorded(source.folder / CONFIG).items()
        texts += [value for key, value in recorded if not is_private(key)]
        known |= {text for text in texts if isinstance(text, str)}
    return Secrets(paths, known - {str(path) for path in paths}, os.environ)


def _write(
    output: Path, files: Iterator[tuple[str, bytes]], folders: Sequence[str], secrets: Secrets
) -> int:
    """Write the files and then their checksums; leave no file behind on failure."""
    digests: dict[str, str] = {}
    total = 0
    output.parent.mkdir(parents=True, exist_ok=True)
    with replacing(output) as file:
        with ZipFile(file, "w") as archive:
            for name, content in files:
                secrets.require_none(name, content)
                total += len(content)
                require_fitting(output, name, len(content), total)
                digests[name] = sha256(content).hexdigest()
                add_member(archive, name, content)
            add_member(archive, archives.CHECKSUMS, archives.write_sums(digests))
            for name in folders:
                add_folder(archive, name)
        seal_zip(file)
    return len(digests) + 1
