"""Read the faces of a mesh file, and the colours in which it shows them."""

import logging
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.files.resources import read_file
from evoros.formats.mesh_dae import Submesh, read_dae
from evoros.formats.strict_xml import list_names, shorten
from evoros.geometry.shapes import Vector

FORMATS = (".stl", ".obj", ".dae")
_NOWHERE = logging.NullHandler()  # for tracebacks of attempts, where nobody has asked for logs

_NO_MATERIAL = "material_0"  # what trimesh gives a mesh with coordinates of textures but none


def read_content(path: Path) -> bytes:
    """Return the bytes of a mesh file of a known format."""
    if path.suffix.lower() not in FORMATS:
        known = ", ".join(FORMATS)
        raise InputError(f"{path}: must be a mesh of a known format ({known}); convert it to one")
    return read_file(path)


def read_faces(
    path: Path,
    scale: Vector = (1.0, 1.0, 1.0),
    submesh: str = "",
    center: bool = False,
    up_axis: bool = False,
    painted: bool = False,
) -> Submesh:
    """Read the faces [m] of a mesh file; a mirroring scale keeps their outsides.

    They have colours if ``painted``. See ``read_mesh`` for the others.

    Raises:
        InputError: the file cannot be read, is empty, or has no such submesh.
    """
    is_dae = path.suffix.lower() == ".dae"
    parts = read_dae(path, up_axis) if is_dae else _read_with_trimesh(path, submesh, painted)
    chosen = _select(path, parts, submesh)
    if any(part.triangles.shape[1:] != (3, 3) for part in chosen):
        raise InputError(f"{path}: must have three coordinates a corner; export the mesh again")
    triangles = np.concatenate([part.triangles for part in chosen]) if chosen else np.empty(0)
    if not len(triangles):
        raise InputError(f"{path}: must have a face; export the mesh again")
    if not np.isfinite(triangles).all():
        raise InputError(f"{path}: must have finite coordinates only; export the mesh again")
    if center:
        points = triangles.reshape(-1, 3)
        triangles = triangles - (points.min(axis=0) + points.max(axis=0)) / 2
    triangles = triangles * np.array(scale, dtype=np.float64)
    outwards = triangles[:, ::-1] if np.prod(scale) < 0 else triangles
    return Submesh((), outwards, np.concatenate([part.colours for part in chosen]))


def _read_with_trimesh(path: Path, submesh: str, painted: bool) -> list[Submesh]:
    """Read an STL or OBJ file; a submesh of an OBJ file may be an object or a group."""
    import trimesh  # takes a second, which meshes from the cache save

    logging.getLogger("trimesh").addHandler(_NOWHERE)
    splits = ("split_objects", "split_groups") if submesh else ("split_objects",)
    parts: dict[str, Submesh] = {}
    for split in splits:
        options: dict[str, Any] = {"process": False}
        if path.suffix.lower() == ".obj":
            options |= {"skip_materials": not painted, split: True}
        try:
            scene = trimesh.load_scene(path, **options)
        except Exception as error:  # trimesh raises errors of many types
            kind = path.suffix[1:].upper()
            reason = shorten(str(error).partition("\n")[0])
            problem = f"must be a mesh in the format {kind} ({reason})"
            raise InputError(f"{path}: {problem}; export the mesh again") from error
        for name, mesh in scene.geometry.items():
            if isinstance(mesh, trimesh.Trimesh):
                triangles = np.array(mesh.triangles, dtype=np.float64)
                colours = _find_colours(mesh) if painted else None
                parts.setdefault(name, Submesh.painted((name,), triangles, colours))
    return list(parts.values())


def _find_colours(mesh: Any) -> Array | None:
    """Return the colours (n, 3), from 0 to 1, of the faces of a mesh of trimesh; None: none."""
    with suppress(Exception):  # trimesh raises errors of many types, and looks are no need
        shown = mesh.visual
        if shown.kind == "texture":
            material = shown.material
            if material.name == _NO_MATERIAL and not material.kwargs:
                return None
            if shown.uv is None or material.image is None:
                return np.tile(material.main_color[:3] / 255.0, (len(mesh.faces), 1))
            corners = shown.to_color().vertex_colors[mesh.faces]
            return np.asarray(corners[:, :, :3].mean(axis=1) / 255.0)
        if shown.defined:
            return np.asarray(shown.face_colors[:, :3] / 255.0)
    return None


def _select(path: Path, parts: list[Submesh], submesh: str) -> list[Submesh]:
    chosen = [part for part in parts if not submesh or submesh in part.names]
    if submesh and not chosen:
        names = list_names(dict.fromkeys(name for part in parts for name in part.names))
        raise InputError(f"{path}: submesh {submesh!r} must exist; name one of: {names}")
    return chosen
