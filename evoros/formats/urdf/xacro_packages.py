"""The packages and files that a xacro file may name, with a record of missing ones."""

import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from evoros.formats.urdf.packages import PackageIndex, find_in_any_case, locate

IGNORED = "/ignored-package"  # folder returned by $(find) for ignored and missing packages
_FIND = re.compile(r"\$\(find(?:-pkg-share)? +([^)$\s]+)\)")
_WILDCARD = re.compile(r"[*?[]")


class OutsideError(Exception):
    """A description names a file that does not exist or is outside the declared folders."""


@dataclass
class Packages:
    """The packages of a request, and the parts left out with ignored or missing packages."""

    index: PackageIndex
    skipped: list[str] = field(default_factory=list)  # omitted includes and macros
    absent: dict[str, str] = field(default_factory=dict)  # missing packages, with their locations
    files: dict[str, str] = field(default_factory=dict)  # missing included files, with locations
    read: list[str] = field(default_factory=list)  # files read so far
    unlike: list[str] = field(default_factory=list)  # included files whose names differ in case
    legacy: list[str] = field(default_factory=list)  # tags to which the prefix xacro: was added

    def find(self, name: str, file: str) -> str:
        """Return the folder of a package, and record it if missing."""
        if name in self.index.ignored:
            return f"{IGNORED}/{name}"
        folder = self.index.find(name)
        if folder is not None:
            return str(folder)
        self.absent.setdefault(name, _place(file, name))
        return f"{IGNORED}/{name}"

    def include(self, node: Any, file: str, evaluate: Any) -> str:
        """Return the file named in an ``<include>`` of ``file``; "" if left out."""
        written = node.getAttribute("filename")
        name = str(evaluate(written)).removeprefix("file://")
        if name.startswith(IGNORED):
            self.skipped.append(name.removeprefix(IGNORED + "/"))
            return ""
        path = self._locate(Path(file).parent / name)
        if path is not None or _WILDCARD.search(name) or node.getAttribute("optional") == "true":
            return name if path is None else path
        self.files.setdefault(name, _place(file, written))
        return ""

    def open(self, name: str) -> BinaryIO:
        """Open an included or loaded file, which must be inside a declared folder."""
        path = self._locate(Path(name).absolute())
        if path is None:
            raise OutsideError(f"{name} does not exist; correct the name")
        real = Path(path).resolve()
        if not self.index.allows(real):
            fix = "or add the file's folder to robot.packages (for a world, to model_paths)"
            roots = ", ".join(map(str, self.index.roots))
            raise OutsideError(f"{name} must lie inside {roots}; {fix}")
        self.read.append(str(real))
        # XML allows no comments or blank lines before the declaration, so remove them.
        content = re.sub(rb"\A(\s|<!--.*?-->)+(?=<\?xml )", b"", real.read_bytes(), flags=re.DOTALL)
        return io.BytesIO(content)

    def _locate(self, path: Path) -> str | None:
        place = locate(path, (*self.index.roots, *self.index.folders.values()))
        if place is None:
            place = find_in_any_case(path)
            self.unlike += [] if place is None else [str(place)]
        return None if place is None else str(place)


def _place(file: str, text: str) -> str:
    try:
        lines = Path(file).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return file
    for i, line in enumerate(lines, 1):
        if text in line and (text in _FIND.findall(line) or not text.isidentifier()):
            return f"{file}:{i}"
    return file
