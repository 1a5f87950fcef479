"""The files of a finished run or evaluation as an archive has them, without paths of one machine.

If no text has such a path, all but the manifest have the bytes of the folder. Otherwise hashes and
digests are computed anew from the changed texts, so that runs of the same content are equal,
wherever their files lie.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from evoros.evolution.experiment import Experiment
from evoros.storage.digests import Entry, describe_file, read_entries, write_entries
from evoros.storage.file_reading import read_bytes, read_sealed
from evoros.storage.layout import (
    CONFIG,
    CONFIG_DIR,
    DAMAGED,
    DIGESTS,
    LOG,
    LOST,
    MANIFEST,
    MISSIONS,
    ORIGINALS,
    OVERRIDES,
    STATUS,
    SWEEP,
    TRAJECTORIES,
)
from evoros.storage.manifest import hash_sources
from evoros.storage.relocation import Relocation
from evoros.storage.run_key import STATUS_KEY, read_key
from evoros.storage.seals import seal_json, seal_rows

LEFT_OUT = (LOG, LOST, DAMAGED)
"""What only the own machine tells, and nothing follows from."""
TEXTS = (".csv", ".json", ".yaml", ".urdf", ".sdf", ".xml", ".md", ".html")


@dataclass(frozen=True)
class PortableRun:
    """A finished folder, with the experiment built from it.

    ``config`` and ``values`` are the configuration, without paths of the machine; ``working`` and
    ``own_parts`` are the places of the working folder and of the user's parts in the archive.
    """

    folder: Path
    experiment: Experiment
    config: str
    values: Mapping[str, Any]
    places: Relocation
    working: str
    own_parts: str | None

    def files(self) -> Iterator[tuple[str, bytes]]:
        """Yield the name and the content of each file."""
        manifest = read_sealed(self.folder, MANIFEST)
        moved = self._move_manifest(manifest)
        before, key = read_key(manifest), read_key(moved)
        known = read_entries(read_bytes(self.folder / DIGESTS)).by_name
        changed: dict[str, Entry] = {}
        for name in list_files(self.folder):
            content = read_bytes(self.folder / name)
            new = self._move(name, content)
            if name == MISSIONS and (new != content or key != before):
                new = _seal_again(new, key)
            if name == STATUS and key != before:
                new = self._move_status(key)
            if new != content and name in known:
                changed[name] = describe_file(new, not name.startswith(f"{TRAJECTORIES}/"))
            yield name, new
        yield MANIFEST, seal_json(MANIFEST, moved).encode()
        digests = read_bytes(self.folder / DIGESTS)
        yield DIGESTS, write_entries({**known, **changed}).encode() if changed else digests

    def _move(self, name: str, content: bytes) -> bytes:
        if name == CONFIG:
            return self.config.encode()
        is_text = Path(name).suffix in TEXTS and name != STATUS
        return self.places.relocate_bytes(content) if is_text else content

    def _move_manifest(self, manifest: Mapping[str, Any]) -> dict[str, Any]:
        relocate = self.places.relocate
        originals = [name for name in ORIGINALS if name in manifest["sha256"]]
        texts = {name: self._move(name, read_bytes(self.folder / name)) for name in originals}
        files = {name: content.decode() for name, content in texts.items()}
        hashes = hash_sources(self.experiment, self.config, self.values, files, self.places)
        moved = {
            **manifest,
            "working_directory": self.working,
            "programs": {relocate(name): text for name, text in manifest["programs"].items()},
            "sha256": hashes,
            CONFIG_DIR: self.own_parts,
        }
        if manifest.get(SWEEP):
            moved[SWEEP] = relocate(manifest[SWEEP])
        if OVERRIDES in manifest:
            moved[OVERRIDES] = [relocate(text) for text in manifest[OVERRIDES]]
        return moved

    def _move_status(self, key: bytes) -> bytes:
        status = read_sealed(self.folder, STATUS)
        return seal_json(STATUS, {**status, STATUS_KEY: key.decode()}).encode()


def list_files(folder: Path) -> list[str]:
    """List the files of a folder that an archive has, but for the manifest and the digests."""
    files = (path for path in folder.rglob("*") if path.is_file())
    names = sorted(path.relative_to(folder).as_posix() for path in files)
    hidden = [name for name in names if any(part.startswith(".") for part in name.split("/"))]
    others = (MANIFEST, DIGESTS, *hidden)
    return [name for name in names if name not in others and name.split("/")[0] not in LEFT_OUT]


def _seal_again(table: bytes, key: bytes) -> bytes:
    header, *rows = table.decode().splitlines(keepends=True)
    return header.encode() + seal_rows("".join(f"{row.rpartition(',')[0]}\n" for row in rows), key)


def hash_content(content: bytes) -> str:
    """Return the SHA-256 of a file's content."""
    return sha256(content).hexdigest()
