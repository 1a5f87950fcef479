"""Draws mesh_parts.png, the picture in docs/meshes.md: a mesh and its convex parts.

python docs/img/mesh_parts.py
"""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from evoros.analysis.drawing.style import write_png
from evoros.base.arrays import Array
from evoros.geometry.mesh_parts import divide_mesh

HERE = Path(__file__).resolve().parent
PLAN = ["#########", "#       #", "#       #", "        #", "        #", "#   #####", "#####    "]
CELL, HEIGHT = 0.5, 1.2  # [m]
EXPLODED = 0.15  # distance of the parts in the picture, as a share of that in the mesh


def walls() -> Array:
    """The triangles (n, 3, 3) of the walls of ``PLAN``, whose cells share their corners."""
    filled = {(x, y) for y, row in enumerate(PLAN) for x, sign in enumerate(row) if sign == "#"}
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    squares = []
    for x, y in sorted(filled):
        ring = [(CELL * (x + dx), CELL * (y + dy), z) for z in (0.0, HEIGHT) for dx, dy in corners]
        squares += [[ring[i] for i in (0, 3, 2, 1)], [ring[i] for i in (4, 5, 6, 7)]]
        for i, (dx, dy) in enumerate([(0, -1), (1, 0), (0, 1), (-1, 0)]):
            if (x + dx, y + dy) not in filled:
                j = (i + 1) % 4
                squares.append([ring[i], ring[j], ring[j + 4], ring[i + 4]])
    return np.array([[s[0], s[i], s[i + 1]] for s in squares for i in (1, 2)])


def draw(axes: Any, polyhedra: list[Array], title: str) -> None:
    """Draw polyhedra, each of triangles (n, 3, 3) and in its own colour."""
    for triangles, color in zip(polyhedra, plt.get_cmap("tab10").colors, strict=False):
        axes.add_collection3d(
            Poly3DCollection(triangles, facecolors=color, edgecolors="#00000066", linewidths=0.4)
        )
    points = np.concatenate(polyhedra).reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), title=title)
    axes.set_box_aspect(high - low, zoom=1.05)
    axes.view_init(elev=50, azim=-70)
    axes.set_axis_off()


if __name__ == "__main__":
    mesh = walls()
    hulls = divide_mesh(mesh).hulls
    middle = mesh.reshape(-1, 3).mean(axis=0)
    parts = [
        hull.corners[hull.faces] + EXPLODED * (hull.corners.mean(axis=0) - middle) for hull in hulls
    ]
    figure = plt.figure(figsize=(9, 3.6))
    draw(figure.add_subplot(1, 2, 1, projection="3d"), [mesh], f"a mesh of {len(mesh)} triangles")
    draw(figure.add_subplot(1, 2, 2, projection="3d"), parts, f"its {len(parts)} convex parts")
    figure.tight_layout()
    write_png(figure, HERE / "mesh_parts.png", dpi=90)
