"""The obstacles and the walkers of a world as markers of ``visualization_msgs``."""

from collections.abc import Iterator, Mapping
from typing import Any

from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Shape
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

from ..tables.walkers import WalkerTrack

CUBE, SPHERE, CYLINDER, TRIANGLE_LIST = 1, 2, 3, 11
FIXED, MOVABLE, WALKER = (0.56, 0.61, 0.68), (0.82, 0.65, 0.42), (0.85, 0.45, 0.15)


def list_markers(world: World) -> Iterator[Mapping[str, Any]]:
    """Yield a marker for each shape of the obstacles, in their namespaces, without its header."""
    for body in standing_obstacles(world):
        colour = FIXED if body.mass is None else MOVABLE
        rgba = {**dict(zip("rgb", colour, strict=True)), "a": 1.0}
        solids = [shape for shape in body.shapes if shape.kind != "plane"]
        for index, shape in enumerate(solids):
            pose = body.pose @ shape.pose
            yield {
                "ns": body.name,
                "id": index,
                **_geometry(shape),
                "pose": {
                    "position": _vector(pose.position),
                    "orientation": dict(zip("xyzw", pose.quaternion, strict=True)),
                },
                "color": rgba,
            }


def mark_walker(walker: WalkerTrack, record: int) -> Mapping[str, Any]:
    """Return the marker of a walker at a record, without its header."""
    x, y = walker.places[record].tolist()
    place = {"position": _vector((x, y, walker.height_m / 2)), "orientation": {"w": 1.0}}
    cylinder = _geometry(Shape("cylinder", (walker.radius_m, walker.height_m)))
    rgba = {**dict(zip("rgb", WALKER, strict=True)), "a": 1.0}
    return {"ns": walker.name, "id": 0, **cylinder, "pose": place, "color": rgba}


def _geometry(shape: Shape) -> Mapping[str, Any]:
    """Return type, size and points of a marker, in the frame of the shape."""
    if shape.kind == "convex":
        solid = convex_polyhedron(shape.corners)
        points = solid.corners[solid.triangles.ravel()].tolist()
        scale = _vector((1.0, 1.0, 1.0))
        return {"type": TRIANGLE_LIST, "scale": scale, "points": [_vector(p) for p in points]}
    if shape.kind == "box":
        return {"type": CUBE, "scale": _vector(shape.size)}
    across = 2 * shape.size[0]
    height = shape.size[1] if shape.kind == "cylinder" else across
    kind = CYLINDER if shape.kind == "cylinder" else SPHERE
    return {"type": kind, "scale": _vector((across, across, height))}


def _vector(values: Any) -> Mapping[str, float]:
    return dict(zip("xyz", values, strict=True))
