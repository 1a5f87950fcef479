"""The meshes and textures that a description names, moved into a package."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.base.errors import InputError

KINDS = (".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".png", ".jpg", ".jpeg", ".tga", ".bmp")
"""The files that are copied; a description from somebody else may name any file."""
_UNSAFE = re.compile(r"[^A-Za-z0-9_.-]")
_NAMED = re.compile(rb"<init_from>\s*([^<\s]+)\s*</init_from>|^mtllib\s+(\S+)", re.M)


@dataclass
class MeshFiles:
    """The files of a package's ``meshes/``, and what could not be copied there."""

    package: str
    files: dict[str, bytes] = field(default_factory=dict)  # by path in the package
    packages: set[str] = field(default_factory=set)  # others, which the description names
    notes: list[str] = field(default_factory=list)
    _addresses: dict[str, str] = field(default_factory=dict)

    def move(self, robot: Element) -> None:
        """Copy the files that a description names, and let it name the copies."""
        for element in robot.iter("mesh", "texture"):
            name = element.get("filename", "")
            if name not in self._addresses:
                self._addresses[name] = self._copy(name)
            element.set("filename", self._addresses[name])

    def _copy(self, name: str) -> str:
        """Copy a file; return its address in the package, or its name if it stays where it is."""
        path = Path(name.removeprefix("file://"))
        if not path.is_absolute() or not path.is_file() or path.suffix.lower() not in KINDS:
            self._keep(name)
            return name
        copied = self._free_name(_UNSAFE.sub("_", path.name))
        try:
            self.files[copied] = path.read_bytes()
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); make it readable"
            ) from error
        inner = sorted(set(_named_files(self.files[copied])))
        if inner:
            self.notes.append(
                f"{copied} names further files, which are not copied: {', '.join(inner)}"
            )
        return f"package://{self.package}/{copied}"

    def _keep(self, name: str) -> None:
        package = re.match(r"package://([^/]+)/", name)
        if package:
            self.packages.add(package[1])
            self.notes.append(f"{name} must be installed on the robot, with its package")
        else:
            self.notes.append(f"{name} is not copied; add it, and name it in the description")

    def _free_name(self, name: str) -> str:
        stem, dot, suffix = name.rpartition(".")
        free, count = f"meshes/{name}", 1
        while free in self.files:
            count += 1
            free = f"meshes/{stem}_{count}{dot}{suffix}"
        return free


def _named_files(content: bytes) -> Iterator[str]:
    """Yield the textures of a Collada mesh and the materials of an OBJ mesh."""
    for texture, material in _NAMED.findall(content):
        yield (texture or material).decode(errors="replace")
