"""The enclosed region of a grid is the room that a person would see from above."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.geometry.free_space import Cells, find_enclosed

SIDE = 120
rooms = st.tuples(
    st.integers(10, 60), st.integers(10, 60), st.integers(24, 50), st.integers(24, 50)
)


def field() -> Cells:
    return np.ones((SIDE, SIDE), dtype=np.bool_)


def build(free: Cells, x: int, y: int, width: int, height: int) -> Cells:
    """Build the walls of a room, 3 cells thick; return the cells in it."""
    free[y - 3 : y + height + 3, x - 3 : x + width + 3] = False
    inside = np.zeros_like(free)
    inside[y : y + height, x : x + width] = True
    free |= inside
    return inside


@settings(deadline=None)
@given(rooms, st.integers(0, 3), st.integers(0, 1))
def test_a_closed_room_is_enclosed_wherever_it_stands(
    room: tuple[int, int, int, int], turns: int, mirrored: int
) -> None:
    free = field()
    inside = build(free, *room)
    free, inside = (np.rot90(cells[:, :: 1 - 2 * mirrored], turns) for cells in (free, inside))
    found = find_enclosed(free)
    assert found is not None
    assert (found == inside).all()


@settings(deadline=None)
@given(rooms, st.integers(0, 7))
def test_doors_and_pillars_leave_a_room_enclosed(
    room: tuple[int, int, int, int], door: int
) -> None:
    x, y, width, height = room
    free = field()
    inside = build(free, *room)
    free[y + 4 : y + 4 + door, x + width : x + width + 3] = True
    free[y + height // 2, x + width // 2] = False  # a pillar
    found = find_enclosed(free)
    assert found is not None
    around = field()
    build(around, *room)
    assert not (found & around & ~inside).any()  # it may reach into the door
    assert found.sum() > 0.7 * inside.sum()


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_trees_in_a_field_enclose_nothing(count: int, seed: int) -> None:
    free, rng = field(), np.random.default_rng(seed)
    for row, column in rng.integers(2, SIDE - 2, size=(count, 2)):
        free[row - 2 : row + 3, column - 2 : column + 3] = False
    assert find_enclosed(free) is None


def test_neither_a_shed_nor_the_houses_of_a_town_are_where_a_robot_drives() -> None:
    shed, town = field(), field()
    build(shed, 50, 50, 8, 8)
    for x in (10, 50, 90):
        for y in (10, 50, 90):
            build(town, x, y, 20, 20)
    assert find_enclosed(shed) is None
    assert find_enclosed(town) is None


@pytest.mark.parametrize("sides", [1, 2, 3])
def test_a_corner_between_walls_is_outside(sides: int) -> None:
    free = field()
    walls = ((slice(20, 100), slice(17, 20)), (slice(17, 20), slice(17, 100)))
    for rows, columns in (*walls, (slice(97, 100), slice(17, 23)))[:sides]:
        free[rows, columns] = False
    assert find_enclosed(free) is None


def test_nothing_free_encloses_nothing() -> None:
    assert find_enclosed(~field()) is None
    assert find_enclosed(field()) is None
