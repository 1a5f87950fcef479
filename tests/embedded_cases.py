"""Random bodies that start in the ground and in each other."""

from dataclasses import replace

import numpy as np

from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.polyhedron import solid_properties
from evoros.geometry.shapes import Body, Pose, Shape, normalize

SUNK = (0.0, 0.0, -0.02, -0.1, -0.3, 0.2, 0.5)
"""Where the lowest point of a body is, in heights of the body above the ground."""


def random_bodies(seed: int) -> list[Body]:
    """Draw up to six bodies near (3, 0), of which one in five is fixed and two in five lean."""
    rng = np.random.default_rng(seed)
    bodies = []
    for index in range(rng.integers(2, 7)):
        shape = _draw_shape(rng)
        turn = normalize(rng.normal(size=4).tolist())
        if rng.random() < 0.6:
            turn = Pose.from_rpy((0.0, 0.0, 0.0), 0.0, 0.0, float(rng.uniform(-3, 3))).quaternion
        mass = None if rng.random() < 0.2 else float(rng.uniform(1.0, 10.0))
        body = Body(f"body_{index}", Pose((0.0, 0.0, 0.0), turn), (shape,), mass)
        low, high = bottom_height(shape, body.pose), top_height(shape, body.pose)
        x, y = rng.uniform(-0.5, 0.5, 2).tolist()
        z = float(rng.choice(SUNK)) * (high - low) - low
        bodies.append(replace(body, pose=Pose((3.0 + x, y, z), turn)))
    return bodies


def _draw_shape(rng: np.random.Generator) -> Shape:
    kind = ("box", "sphere", "cylinder", "convex")[rng.integers(4)]
    if kind == "box":
        return Shape("box", tuple(rng.uniform(0.1, 0.8, 3).tolist()))
    if kind == "sphere":
        return Shape("sphere", (float(rng.uniform(0.1, 0.4)),))
    if kind == "cylinder":
        return Shape("cylinder", tuple(rng.uniform([0.05, 0.1], [0.4, 1.0]).tolist()))
    points = [(x, y, z) for x, y, z in rng.uniform(-0.4, 0.4, (10, 3)).tolist()]
    centre = solid_properties(tuple(points))[1].tolist()  # where the frame of a body is
    corners = tuple((x - centre[0], y - centre[1], z - centre[2]) for x, y, z in points)
    return Shape("convex", (), corners=corners)
