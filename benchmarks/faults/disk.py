"""A disk that loses what was not synced, as a power cut may.

Only ``os.fsync`` is watched: it makes the content of a file, or the names in a folder, durable. At
each call the disk remembers what is durable and what else has been written. A power cut leaves, for
each name and each content by itself, either of the two, and of appended bytes some part.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import NamedTuple


class Tree(NamedTuple):
    """Names in folders and contents of files, by inode."""

    names: dict[int, dict[str, int]]
    contents: dict[int, bytes]


@dataclass(frozen=True)
class Cut:
    """The durable and the written content at a moment."""

    root: int
    durable: Tree
    written: Tree

    def restore(self, to: Path, rng: Random | None = None) -> Path:
        """Write what the disk may hold afterwards; without ``rng``, all that can be lost is."""
        self._restore(self.root, to, rng)
        return to

    def _restore(self, inode: int, path: Path, rng: Random | None) -> None:
        if inode in self.written.contents or inode in self.durable.contents:
            path.write_bytes(self._content(inode, rng))
            return
        path.mkdir()
        durable, written = (tree.names.get(inode, {}) for tree in (self.durable, self.written))
        for name in sorted({*durable, *written}):
            names = written if rng is not None and rng.random() < 0.5 else durable
            if name in names:
                self._restore(names[name], path / name, rng)

    def _content(self, inode: int, rng: Random | None) -> bytes:
        durable = self.durable.contents.get(inode, b"")
        written = self.written.contents.get(inode, durable)
        if rng is None:
            return durable
        if written.startswith(durable):
            return written[: rng.randint(len(durable), len(written))]
        return rng.choice((durable, written))


class Disk:
    """All files below a folder. What is there at first is durable, and so is the folder."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._kept: list[int] = []  # open, so that no inode is used again
        self._durable = self._read()
        self.cuts: list[Cut] = []
        for path in root.rglob("*"):
            self._kept.append(os.open(path, os.O_RDONLY))

    def fsync(self, descriptor: int) -> None:
        """Take the place of ``os.fsync``: a cut may come before it is done."""
        self.cut()
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        inode = os.fstat(descriptor).st_ino
        self._kept.append(os.dup(descriptor))
        if path.is_dir():
            self._durable.names[inode] = _names(path)
        else:
            self._durable.contents[inode] = path.read_bytes()

    def cut(self) -> Cut:
        """Remember what a power cut at this moment would leave."""
        written = self._read()
        durable = Tree(_copied(self._durable.names), dict(self._durable.contents))
        self.cuts.append(Cut(self._root.stat().st_ino, durable, written))
        return self.cuts[-1]

    def _read(self) -> Tree:
        tree = Tree({}, {})
        for folder, _, files in os.walk(self._root):
            tree.names[os.stat(folder).st_ino] = _names(Path(folder))
            for name in files:
                path = Path(folder, name)
                tree.contents[path.stat().st_ino] = path.read_bytes()
        return tree

    def close(self) -> None:
        """Release the inodes."""
        for descriptor in self._kept:
            os.close(descriptor)


def _names(folder: Path) -> dict[str, int]:
    return {entry.name: entry.inode() for entry in os.scandir(folder)}


def _copied(names: Mapping[int, dict[str, int]]) -> dict[int, dict[str, int]]:
    return {inode: dict(entries) for inode, entries in names.items()}
