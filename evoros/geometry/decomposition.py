"""Divides polygons into convex ones: ear clipping, then merging along diagonals."""

from collections.abc import Sequence
from itertools import combinations

Point = tuple[float, float]
Ring = list[Point]


def decompose(rings: Sequence[Sequence[Point]]) -> list[Ring]:
    """Return convex polygons, counter-clockwise, that together cover the inside of the rings.

    A ring inside another one is a hole. A ring must not cross itself or another ring.

    Raises:
        ValueError: a ring crosses itself or another, or encloses nothing.
    """
    cleaned = [_clean(ring) for ring in rings]
    edges = [edge for ring in cleaned for edge in _edges(ring)]
    if any(_cross(*edge, *other) for edge, other in combinations(edges, 2)):
        raise ValueError("it crosses itself")
    pieces: list[Ring] = []
    expected = 0.0
    for i, ring in enumerate(cleaned):
        depth = _depth(cleaned, i)
        expected += (-1) ** depth * abs(_area(ring))
        if depth % 2 == 0:
            holes = [
                other
                for j, other in enumerate(cleaned)
                if j != i and _contains(ring, other[0]) and _depth(cleaned, j) == depth + 1
            ]
            pieces += _merge_triangles(_clip_ears(_bridge(ring, holes)))
    covered = sum(_area(piece) for piece in pieces)
    if abs(covered - expected) > 1e-6 * expected:
        raise ValueError("it crosses itself")
    return pieces


def _depth(rings: Sequence[Ring], index: int) -> int:
    point = rings[index][0]
    return sum(_contains(ring, point) for j, ring in enumerate(rings) if j != index)


def _clean(ring: Sequence[Point]) -> Ring:
    """Return the corners without repetitions, counter-clockwise."""
    corners = [p for i, p in enumerate(ring) if p != ring[i - 1]] or list(ring[:1])
    area = _area(corners)
    if len(corners) < 3 or abs(area) < 1e-12:
        raise ValueError("it encloses nothing")
    return corners if area > 0 else corners[::-1]


def _area(ring: Sequence[Point]) -> float:
    return sum(ax * by - bx * ay for (ax, ay), (bx, by) in _edges(ring)) / 2


def _edges(ring: Sequence[Point]) -> list[tuple[Point, Point]]:
    return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def _turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of a triangle, positive if it turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _contains(ring: Sequence[Point], point: Point) -> bool:
    x, y = point
    inside = False
    for (ax, ay), (bx, by) in _edges(ring):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def _bridge(ring: Ring, holes: Sequence[Ring]) -> Ring:
    """Cut a polygon open towards each of its holes, so that one ring surrounds it."""
    merged = list(ring)
    for hole in sorted(holes, key=lambda hole: -max(hole)[0]):
        start = hole.index(max(hole))
        inner = [*hole[start:], *hole[:start]][::-1]  # clockwise
        inner = [inner[-1], *inner[:-1]]
        target = _visible_corner(merged, holes, inner[0])
        merged[target + 1 : target + 1] = [*inner, inner[0], merged[target]]
    return merged


def _visible_corner(ring: Ring, holes: Sequence[Ring], point: Point) -> int:
    edges = [(a, b) for r in (ring, *holes) for a, b in _edges(r)]

    def distance(i: int) -> float:
        dx, dy = ring[i][0] - point[0], ring[i][1] - point[1]
        return dx * dx + dy * dy

    for i in sorted(range(len(ring)), key=distance):
        before, after = ring[i - 1], ring[(i + 1) % len(ring)]
        if _in_corner(before, ring[i], after, point) and not any(
            _cross(point, ring[i], a, b) for a, b in edges
        ):
            return i
    raise ValueError("it crosses itself")


def _in_corner(before: Point, corner: Point, after: Point, point: Point) -> bool:
    """Return whether a point is seen from a corner through the inside of its polygon."""
    left, right = _turn(before, corner, point) > 0, _turn(corner, after, point) > 0
    return (left and right) if _turn(before, corner, after) > 0 else (left or right)


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether two segments cross or touch other than at a common end."""
    if {a, b} & {c, d}:
        return False
    if any(max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]) for k in (0, 1)):
        return False
    return _turn(a, b, c) * _turn(a, b, d) <= 0 and _turn(c, d, a) * _turn(c, d, b) <= 0


def _clip_ears(ring: Ring) -> list[Ring]:
    corners = list(ring)
    triangles: list[Ring] = []
    while len(corners) > 3:
        for i in range(len(corners)):
            a, b, c = corners[i - 1], corners[i], corners[(i + 1) % len(corners)]
            turn = _turn(a, b, c)
            if abs(turn) <= 1e-14:  # a straight or folded corner covers nothing
                del corners[i]
                break
            if turn > 0 and not any(_covers(a, b, c, p) for p in corners if p not in (a, b, c)):
                triangles.append([a, b, c])
                del corners[i]
                break
        else:
            raise ValueError("it crosses itself")
    if abs(_turn(*corners)) > 1e-14:
        triangles.append(corners)
    return triangles


def _covers(a: Point, b: Point, c: Point, p: Point) -> bool:
    return _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0


def _merge_triangles(pieces: list[Ring]) -> list[Ring]:
    """Merge polygons along common edges as long as the result is convex."""
    while (pair := _find_union(pieces)) is not None:
        i, j, union = pair
        pieces[i] = union
        del pieces[j]
    return pieces


def _find_union(pieces: Sequence[Ring]) -> tuple[int, int, Ring] | None:
    for i, j in combinations(range(len(pieces)), 2):
        union = _join(pieces[i], pieces[j])
        if union is not None:
            return i, j, union
    return None


def _join(one: Ring, other: Ring) -> Ring | None:
    """Return the union of two polygons with a common edge, if it is convex."""
    for i in range(len(one)):
        a, b = one[i], one[(i + 1) % len(one)]
        if a in other and b in other:
            j = other.index(b)
            if other[(j + 1) % len(other)] != a:
                continue
            rest = [*other[j:], *other[:j]][2:]  # from after a round to before b
            union = [*one[: i + 1], *rest, *one[i + 1 :]]
            size = len(union)
            turns = (_turn(union[k - 1], union[k], union[(k + 1) % size]) for k in range(size))
            return union if all(turn >= -1e-14 for turn in turns) else None
    return None
