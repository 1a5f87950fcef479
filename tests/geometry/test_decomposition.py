"""Polygons divided into convex ones: the same area, and every piece convex."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.geometry.polyhedron import Ring, decompose


def area(ring: Ring) -> float:
    pairs = zip(ring, [*ring[1:], ring[0]], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2


def is_convex(ring: Ring) -> bool:
    triples = zip(ring, [*ring[1:], ring[0]], [*ring[2:], *ring[:2]], strict=True)
    return all(area([a, b, c]) >= -1e-12 for a, b, c in triples)


@given(st.lists(st.floats(0.2, 5.0), min_size=3, max_size=24), st.booleans())
def test_a_star_keeps_its_area_in_convex_pieces(radii: list[float], backwards: bool) -> None:
    step = 2 * math.pi / len(radii)
    star = [(r * math.cos(i * step), r * math.sin(i * step)) for i, r in enumerate(radii)]
    pieces = decompose([star[::-1] if backwards else star])
    assert all(map(is_convex, pieces))
    assert sum(map(area, pieces)) == pytest.approx(area(star))


def test_a_convex_polygon_stays_whole_and_an_l_has_two_pieces() -> None:
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    assert [sorted(piece) for piece in decompose([square])] == [sorted(square)]
    corner = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
    assert len(decompose([corner])) == 2


def test_a_ring_inside_is_a_hole_and_one_in_that_is_solid() -> None:
    def square(half: float, x: float = 0.0) -> Ring:
        return [(x - half, -half), (x + half, -half), (x + half, half), (x - half, half)]

    pieces = decompose([square(3.0), square(0.5, 1.5), square(0.5, -1.5)])
    assert sum(map(area, pieces)) == pytest.approx(34.0)
    assert all(map(is_convex, pieces))
    pieces = decompose([square(3.0), square(2.0), square(1.0), square(1.0, 9.0)])
    assert sum(map(area, pieces)) == pytest.approx(36 - 16 + 4 + 4)


@pytest.mark.parametrize(
    "ring",
    [
        [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 3.0)],
        [(0.0, 0.0), (1.0, 1.0)],
        [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)],
    ],
)
def test_what_is_no_simple_polygon_is_refused(ring: Ring) -> None:
    with pytest.raises(ValueError, match="it "):
        decompose([ring])
