"""Makes finished runs portable, without machine-specific paths; equal runs have equal files."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evoros.evolution.experiment import Experiment
from evoros.storage import layout
from evoros.storage.archives import Relocation
from evoros.storage.digests import Entry, describe_file, read_entries, write_entries
from evoros.storage.layout import read_bytes, read_sealed, seal_json, seal_rows
from evoros.storage.manifest import hash_sources
from evoros.storage.run_key import STATUS_KEY, read_key

LEFT_OUT = (layout.LOG, layout.LOST, layout.DAMAGED)  # files that are not needed to use a run
TEXTS = (".csv", ".json", ".yaml", ".urdf", ".sdf", ".xml", ".md", ".html")


@dataclass(frozen=True)
class PortableRun:
    """A finished run and its experiment, with archive paths instead of machine-specific paths."""

    folder: Path
    experiment: Experiment
    config: str
    values: Mapping[str, Any]
    places: Relocation
    working: str
    own_parts: str | None

    def files(self) -> Iterator[tuple[str, bytes]]:
        """Yield the name and the content of each file."""
        manifest = read_sealed(self.folder, layout.MANIFEST)
        moved = self._move_manifest(manifest)
        before, key = read_key(manifest), read_key(moved)
        known = read_entries(read_bytes(self.folder / layout.DIGESTS)).by_name
        changed: dict[str, Entry] = {}
        for name in list_files(self.folder):
            content = read_bytes(self.folder / name)
            new = self._move(name, content)
            if name == layout.MISSIONS and (new != content or key != before):
                header, *rows = new.decode().splitlines(keepends=True)
                bare = "".join(f"{row.rpartition(',')[0]}\n" for row in rows)
                new = header.encode() + seal_rows(bare, key)
            if name == layout.STATUS and key != before:
                status = read_sealed(self.folder, layout.STATUS)
                new = seal_json(layout.STATUS, {**status, STATUS_KEY: key.decode()}).encode()
            if new != content and name in known:
                changed[name] = describe_file(new, not name.startswith(f"{layout.TRAJECTORIES}/"))
            yield name, new
        yield layout.MANIFEST, seal_json(layout.MANIFEST, moved).encode()
        digests = read_bytes(self.folder / layout.DIGESTS)
        yield layout.DIGESTS, write_entries({**known, **changed}).encode() if changed else digests

    def _move(self, name: str, content: bytes) -> bytes:
        if name == layout.CONFIG:
            return self.config.encode()
        is_text = Path(name).suffix in TEXTS and name != layout.STATUS
        return self.places.relocate_bytes(content) if is_text else content

    def _move_manifest(self, manifest: Mapping[str, Any]) -> dict[str, Any]:
        relocate = self.places.relocate
        originals = [name for name in layout.ORIGINALS if name in manifest["sha256"]]
        texts = {name: self._move(name, read_bytes(self.folder / name)) for name in originals}
        files = {name: content.decode() for name, content in texts.items()}
        hashes = hash_sources(self.experiment, self.config, self.values, files, self.places)
        moved = {
            **manifest,
            "working_directory": self.working,
            "programs": {relocate(name): text for name, text in manifest["programs"].items()},
            "sha256": hashes,
            layout.CONFIG_DIR: self.own_parts,
        }
        if manifest.get(layout.SWEEP):
            moved[layout.SWEEP] = relocate(manifest[layout.SWEEP])
        if layout.OVERRIDES in manifest:
            moved[layout.OVERRIDES] = [relocate(text) for text in manifest[layout.OVERRIDES]]
        return moved


def list_files(folder: Path) -> list[str]:
    """List the files of a folder to archive, except the manifest and the digests."""
    files = (path for path in folder.rglob("*") if path.is_file())
    names = sorted(path.relative_to(folder).as_posix() for path in files)
    hidden = [name for name in names if any(part.startswith(".") for part in name.split("/"))]
    others = (layout.MANIFEST, layout.DIGESTS, *hidden)
    return [name for name in names if name not in others and name.split("/")[0] not in LEFT_OUT]
