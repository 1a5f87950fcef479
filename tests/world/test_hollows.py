"""Courses keep out of hollow solids, but lead through rooms."""

from dataclasses import replace

import numpy as np
import pytest

from evoros.geometry.footprint import distances
from evoros.geometry.shapes import Body, Pose, Shape, Vector
from evoros.world.hollows import fill_hollow

HEIGHT_M = 0.2


def _wall(x: float, y: float, length: float, width: float) -> Shape:
    return Shape("box", (length, width, 2.0), Pose((x, y, 1.0)))


WALLS = (_wall(0, 2, 6.1, 0.1), _wall(0, -2, 6.1, 0.1), _wall(3, 0, 0.1, 4), _wall(-3, 0, 0.1, 4))
ROOF = Shape("box", (6.2, 4.2, 0.1), Pose((0.0, 0.0, 2.0)))
SHELL = Body("shell", Pose((5.0, 0.0, 0.0)), (*WALLS, ROOF))
FURNITURE = Body("desk", Pose((4.0, 0.5, 0.4)), (Shape("box", (0.5, 0.5, 0.8)),))
DOOR = (_wall(-3, -1.3, 0.1, 1.4), _wall(-3, 1.3, 0.1, 1.4))
CENTRE: Vector = (5.0, 0.0, 0.0)


def test_the_inside_of_a_closed_shell_is_filled() -> None:
    areas = fill_hollow([SHELL], np.array(CENTRE[:2]), HEIGHT_M)
    places = np.array([[5.0, 0.0], [2.3, 1.7], [7.7, -1.7]])
    assert all(min(distances(area, place[None])[0] for area in areas) == 0.0 for place in places)
    outside = np.array([[1.8, 0.0], [5.0, 2.2]])
    assert min(distances(area, outside).min() for area in areas) > 0.0


@pytest.mark.parametrize("y", [-19.2, 18.0, 19.2])
def test_a_point_beside_the_wall_of_a_long_shell_is_inside(y: float) -> None:
    """The grid of a long solid is so coarse that cells beside its walls are blocked."""
    walls = (_wall(0, 20, 300, 1), _wall(0, -20, 300, 1), _wall(150, 0, 1, 41))
    roof = Shape("box", (301.0, 41.0, 0.1), Pose((0.0, 0.0, 2.0)))
    shell = Body("dam", Pose((0.0, 0.0, 0.0)), (*walls, _wall(-150, 0, 1, 41), roof))
    point = np.array([0.0, y])
    areas = fill_hollow([shell], point, HEIGHT_M)
    assert min(distances(area, point[None])[0] for area in areas) < 1.5
    assert not fill_hollow([shell], np.array([0.0, 60.0]), HEIGHT_M)


@pytest.mark.parametrize(
    "bodies",
    [
        pytest.param([replace(SHELL, shapes=WALLS)], id="yard"),
        pytest.param([replace(SHELL, shapes=(*WALLS[:3], *DOOR, ROOF))], id="house"),
        pytest.param([SHELL, FURNITURE], id="furnished"),
        pytest.param([replace(SHELL, shapes=(*WALLS, ROOF, _wall(0, 0, 0.2, 0.2)))], id="pillar"),
        pytest.param([replace(SHELL, shapes=(*WALLS[1:], ROOF)),
                      replace(SHELL, name="gate", shapes=WALLS[:1])], id="two bodies"),
    ],
)  # fmt: skip
def test_rooms_and_yards_stay_free(bodies: list[Body]) -> None:
    assert not fill_hollow(bodies, np.array(CENTRE[:2]), HEIGHT_M)


def test_places_outside_a_shell_stay_free() -> None:
    assert not fill_hollow([SHELL], np.array([0.0, 0.0]), HEIGHT_M)
