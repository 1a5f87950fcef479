"""Reads the faces of a mesh file, and their colours."""

import logging
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.files.resources import read_file
from evoros.formats.mesh_dae import Submesh, read_dae
from evoros.formats.strict_xml import list_names, shorten
from evoros.geometry.shapes import MeshFile

FORMATS = (".stl", ".obj", ".dae")
MOST_MB = 500  # maximum size [MB] of a file, because reading a larger one could fill the memory
_TEXTS = {".stl": ("facet", "endsolid"), ".dae": ("<collada", "collada>")}
"""Lower-case words near the start and near the end of each kind of complete text file."""
_SHORT = 10_000  # number of bytes searched at each end
_NOWHERE = logging.NullHandler()  # discards tracebacks of failed attempts if logging is off
_NO_MATERIAL = "material_0"  # trimesh's name for the substitute of a missing material


def read_content(path: Path) -> bytes:
    """Return the content of a complete mesh file in a supported format."""
    if path.suffix.lower() not in FORMATS:
        known = ", ".join(FORMATS)
        raise InputError(f"{path}: unknown mesh format; convert the mesh to one of {known}")
    with suppress(OSError):
        if (size := path.stat().st_size / 1e6) > MOST_MB:
            problem = f"the file has {size:.0f} MB, more than the limit of {MOST_MB} MB"
            raise InputError(
                f"{path}: {problem}; simplify the mesh, for example with Blender's "
                "Decimate modifier"
            )
    content = read_file(path)
    problem = _find_cut(path.suffix.lower(), content)
    if problem:
        raise InputError(f"{path}: truncated ({problem}); copy the file again")
    return content


def _find_cut(suffix: str, content: bytes) -> str:
    """Describe how a file is truncated; "" if complete, or if the format has no end mark."""
    begin, end = _TEXTS.get(suffix, ("", ""))
    is_text = begin.encode() in content[:_SHORT].lower()
    if suffix == ".stl" and not is_text:  # a binary file states the number of faces
        whole = 84 + 50 * int.from_bytes(content[80:84], "little")
        return f"the file has {len(content)} of {whole} bytes" if len(content) < whole else ""
    cut = is_text and end.encode() not in content[-_SHORT:].lower()
    return f"the file does not end with {end}" if cut else ""


def _to_utf8(content: bytes) -> bytes:
    try:
        return content.decode("utf-8-sig").encode()
    except UnicodeDecodeError:  # another encoding, which affects only names
        return content.decode("latin-1").encode()


def read_faces(file: MeshFile, painted: bool = False) -> Submesh:
    """Read the faces [m] of a mesh, with colours if ``painted``; negative scales mirror faces."""
    path, submesh = file.path, file.submesh
    is_dae = path.suffix.lower() == ".dae"
    parts = read_dae(path, file.up_axis) if is_dae else _read_with_trimesh(path, submesh, painted)
    chosen = _select(path, parts, submesh)
    if any(part.triangles.shape[1:] != (3, 3) for part in chosen):
        raise InputError(f"{path}: must have three coordinates per corner; export the mesh again")
    triangles = np.concatenate([part.triangles for part in chosen]) if chosen else np.empty(0)
    if not len(triangles):
        raise InputError(f"{path}: must have at least one face; export the mesh again")
    if not np.isfinite(triangles).all():
        raise InputError(f"{path}: all coordinates must be finite; export the mesh again")
    if file.center:
        points = triangles.reshape(-1, 3)
        triangles = triangles - (points.min(axis=0) + points.max(axis=0)) / 2
    triangles = triangles * np.array(file.scale, dtype=np.float64)
    outwards = triangles[:, ::-1] if np.prod(file.scale) < 0 else triangles
    return Submesh((), outwards, np.concatenate([part.colours for part in chosen]))


def _read_with_trimesh(path: Path, submesh: str, painted: bool) -> list[Submesh]:
    """Read an STL or OBJ file; a submesh may be an object or group of an OBJ file."""
    import trimesh  # takes a second, which cached meshes avoid

    class Resolver(trimesh.resolvers.FilePathResolver):  # reads material files
        def get(self, name: str) -> bytes:
            content: bytes = super().get(name)
            return _to_utf8(content) if name.endswith(".mtl") else content

    logging.getLogger("trimesh").addHandler(_NOWHERE)
    splits = ("split_objects", "split_groups") if submesh else ("split_objects",)
    kind, content = path.suffix[1:].lower(), read_content(path)
    if kind == "obj" or b"endsolid" in content[-_SHORT:].lower():
        content = _to_utf8(content)
    parts: dict[str, Submesh] = {}
    for split in splits:
        options: dict[str, Any] = {"process": False}
        if kind == "obj":
            options |= {"skip_materials": not painted, split: True, "resolver": Resolver(str(path))}
        try:
            scene = trimesh.load_scene(BytesIO(content), file_type=kind, **options)
        except Exception as error:  # trimesh raises many types of errors
            reason = shorten(str(error).partition("\n")[0])
            problem = f"must be a valid {kind.upper()} mesh ({reason})"
            raise InputError(f"{path}: {problem}; export the mesh again") from error
        for name, mesh in scene.geometry.items():
            if isinstance(mesh, trimesh.Trimesh):
                triangles = np.array(mesh.triangles, dtype=np.float64)
                colours = _find_colours(mesh) if painted else _blank(mesh)
                parts.setdefault(name, Submesh((name,), triangles, colours))
    return list(parts.values())


def _blank(mesh: Any) -> Array:
    return np.full((len(mesh.faces), 3), np.nan)


def _find_colours(mesh: Any) -> Array:
    """Return the face colours (n, 3), 0 to 1, of a trimesh mesh; NaN if it has none."""
    with suppress(Exception):  # trimesh raises many types of errors, and colours are optional
        shown = mesh.visual
        if shown.kind == "texture":
            material = shown.material
            if material.name == _NO_MATERIAL and not material.kwargs:
                return _blank(mesh)
            if shown.uv is None or material.image is None:
                return np.tile(material.main_color[:3] / 255.0, (len(mesh.faces), 1))
            corners = shown.to_color().vertex_colors[mesh.faces]
            return np.asarray(corners[:, :, :3].mean(axis=1) / 255.0)
        if shown.defined:
            return np.asarray(shown.face_colors[:, :3] / 255.0)
    return _blank(mesh)


def _select(path: Path, parts: list[Submesh], submesh: str) -> list[Submesh]:
    chosen = [part for part in parts if not submesh or submesh in part.names]
    if submesh and not chosen:
        names = list_names(dict.fromkeys(name for part in parts for name in part.names))
        raise InputError(f"{path}: there is no submesh {submesh!r}; name one of: {names}")
    return chosen
