"""Areas in which a world's meshes differ from their convex parts, below a robot's height."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evoros.formats.mesh_files import read_faces
from evoros.geometry.polyhedron import placed_corners
from evoros.geometry.shapes import Body, MeshFile, Pose, Vector
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.standing import standing_obstacles

if TYPE_CHECKING:
    from evoros.geometry.mesh_parts import Sections

LOWEST_M, SLICES = 0.05, 4  # sections' lower end [m], or half a low robot's height; their number
TOLD_M2, TOLD_SHARE = 0.05, 0.01  # area [m2] and fraction of a footprint that cause a warning
_COUNTS_M2 = 0.005


class MeshArea(NamedTuple):
    """Areas [m2] in which a mesh differs from its convex parts, at the worst heights."""

    file: MeshFile
    height_m: float  # robot height
    uses: int  # number of collision elements that use the mesh
    false_m2: float  # inside convex parts but outside the mesh, summed over collision elements
    missed_m2: float  # inside the mesh but outside convex parts, summed over collision elements
    footprint_m2: float  # summed over collision elements

    @property
    def is_large(self) -> bool:
        """True if the difference may affect missions."""
        share = max(self.false_m2, self.missed_m2) / self.footprint_m2
        return max(self.false_m2, self.missed_m2) >= TOLD_M2 and share >= TOLD_SHARE

    def __str__(self) -> str:
        name = self.file.path.name + (f" ({self.uses} times)" if self.uses > 1 else "")
        share = 100.0 * self.false_m2 / self.footprint_m2
        text = f"{name}: its convex parts cover {self.false_m2:.2g} m2 ({share:.2g} %) of free area"
        missed = f" and miss {self.missed_m2:.2g} m2" if self.missed_m2 >= TOLD_M2 else ""
        return f"{text}{missed} at heights from {LOWEST_M:g} to {self.height_m:.2g} m"


@lru_cache(maxsize=KEPT_WORLDS)
def measure_meshes(world: World, height_m: float) -> tuple[MeshArea, ...]:
    """Measure the meshes within a robot's height [m] that differ from their convex parts."""
    areas: dict[MeshFile, MeshArea] = {}
    for file, sections in _list_sections(world, height_m):
        known = areas.get(file, MeshArea(file, height_m, 0, 0.0, 0.0, 0.0))
        sums = (a + b for a, b in zip(known[3:], sections, strict=True))
        areas[file] = MeshArea(file, height_m, known.uses + 1, *sums)
    found = sorted(areas.values(), key=lambda area: -area.false_m2)
    return tuple(area for area in found if max(area.false_m2, area.missed_m2) >= _COUNTS_M2)


def _list_sections(world: World, height_m: float) -> Iterator[tuple[MeshFile, "Sections"]]:
    """Yield each collision element's mesh and section areas, computed once for equal elements."""
    groups = [(body, _group_parts(body)) for body in standing_obstacles(world)]
    if not any(parts for _, parts in groups):
        return
    from evoros.geometry.mesh_parts import compare_sections  # slow: imports scipy and manifold3d
    from evoros.geometry.triangles import weld

    lowest = min(LOWEST_M, height_m / 2)
    heights = (lowest + (height_m - lowest) * (np.arange(SLICES) + 0.5) / SLICES).tolist()
    known: dict[tuple[object, ...], Sections] = {}
    for body, group in groups:
        for (file, pose), parts in group.items():
            place = body.pose @ pose
            key = file, *np.round([*place.rotation[2], place.position[2]], 6).tolist()
            if key not in known:
                corners = [placed_corners(part, place.rotation, place.position) for part in parts]
                z = np.concatenate(corners)[:, 2]
                if z.min() > height_m or z.max() < heights[0]:
                    continue
                surface = weld(read_faces(file).triangles)
                points = placed_corners(surface.points, place.rotation, place.position)
                known[key] = compare_sections(replace(surface, points=points), corners, heights)
            yield file, known[key]


def _group_parts(body: Body) -> dict[tuple[MeshFile, Pose], list[tuple[Vector, ...]]]:
    groups: dict[tuple[MeshFile, Pose], list[tuple[Vector, ...]]] = {}
    for shape in body.shapes:
        if shape.mesh is not None:
            groups.setdefault((shape.mesh, shape.pose), []).append(shape.corners)
    return groups
