"""A course for a user's world lies inside the building, on whichever floor it stands."""

from pathlib import Path

import numpy as np
import pytest
from fixture_types import Log, Patch
from robot_cases import rover

from evoros.session import course_planning
from evoros.session.course_planning import plan_course
from evoros.world.course import Course
from evoros.world.loading import load_world

WALL_M = 0.15
DOOR_M = 1.2

Boxes = list[tuple[float, float, float, float, float, float]]
"""x, y, z, length, width, height [m] of each."""


def list_office(length: float, width: float, door: float) -> Boxes:
    """Outside walls with a door to the outside in each long side, and a desk."""
    walls: Boxes = [(x, 0, 1, WALL_M, width, 2) for x in (-length / 2, length / 2)]
    part = (length - door) / 2
    for y in (-width / 2, width / 2):
        walls += [(side * (length - part) / 2, y, 1, part, WALL_M, 2) for side in (-1, 1)]
    return [*walls, (length / 4, width / 4, 0.35, 0.8, 0.4, 0.7)]


def write(folder: Path, boxes: Boxes, at: tuple[float, float]) -> Path:
    solids = "".join(
        f"<collision name='c{i}'><pose>{x} {y} {z} 0 0 0</pose><geometry><box><size>{a} {b} {c}"
        f"</size></box></geometry></collision>"
        for i, (x, y, z, a, b, c) in enumerate(boxes)
    )
    path = folder / "office.world"
    path.write_text(
        "<sdf version='1.6'><world name='w'><model name='ground'><static>1</static><link name='l'>"
        "<collision name='c'><geometry><plane/></geometry></collision></link></model>"
        f"<model name='office'><static>1</static><pose>{at[0]} {at[1]} 0 0 0 0</pose>"
        f"<link name='l'>{solids}</link></model></world></sdf>"
    )
    return path


def write_without_ground(folder: Path, boxes: Boxes) -> Path:
    path = write(folder, boxes, (0.0, 0.0))
    path.write_text(path.read_text().replace("<plane/>", "<empty/>"))
    return path


@pytest.mark.parametrize("at", [(0.4, -1.5), (40.0, 9.0)])
@pytest.mark.parametrize(
    ("slab", "margin"), [(0.0, 0.0), (0.02, 0.1), (0.02, 6.0), (0.3, 0.1), (0.3, 6.0)]
)
def test_a_course_lies_inside_an_office_whatever_its_floor(
    slab: float, margin: float, at: tuple[float, float], tmp_path: Path
) -> None:
    """The floor ends at the outside walls or goes on around them, at the ground's height or above.

    Corners of a wide square around the middle lie outside the office.
    """
    length, width = 5.0, 9.0
    boxes = [(x, y, z + slab, *size) for x, y, z, *size in list_office(length, width, DOOR_M)]
    if slab:
        boxes.append((0, 0, slab / 2, length + 2 * margin, width + 2 * margin, slab))
    planned = plan_course({"sdf": str(write(tmp_path, boxes, at))}, rover())  # type: ignore[arg-type]
    assert "largest enclosed free region" in planned.reason
    course = planned.course
    stops = np.array([(course["home_x_m"], course["home_y_m"]), *course["waypoints"]]) - at
    assert (np.abs(stops) < np.array([length, width]) / 2).all()


def test_seams_between_floors_do_not_end_a_course(tmp_path: Path) -> None:
    slabs: Boxes = [(x, 0, -0.05, 2.91, 6, 0.1) for x in (-3, 0, 3)]
    walls: Boxes = [(x, 0, 1, WALL_M, 6, 2) for x in (-4.5, 4.5)]
    walls += [(0, y, 1, 9, WALL_M, 2) for y in (-3, 3)]
    planned = plan_course({"sdf": str(write_without_ground(tmp_path, [*slabs, *walls]))}, rover())
    x = [planned.course["home_x_m"], *(x for x, _ in planned.course["waypoints"])]
    assert max(x) - min(x) > 4.0


def test_a_mat_is_no_floor_of_a_wide_world_without_ground(tmp_path: Path) -> None:
    posts: Boxes = [(x, y, 0.5, 0.5, 0.5, 1) for x in (-12, 0, 12) for y in (-12, 12)]
    path = write_without_ground(tmp_path, [(5, 3, 0.005, 3, 3, 0.01), *posts])
    planned = plan_course({"sdf": str(path)}, rover())
    assert (planned.course["home_x_m"], planned.course["home_y_m"]) == (0.0, 0.0)


def test_planes_that_are_walls_such_as_posters_are_left_out(tmp_path: Path, caplog: Log) -> None:
    path = write(tmp_path, [], (0.0, 0.0))
    poster = (
        "<model name='poster'><static>1</static><pose>0 4 1 1.57 0 0</pose><link name='l'>"
        "<collision name='c'><geometry><plane/></geometry></collision></link></model>"
    )
    path.write_text(
        path.read_text().replace("<model name='office'", f"{poster}<model name='office'")
    )
    planned = plan_course({"sdf": str(path)}, rover())
    values = {key: value for key, value in planned.course.items() if key != "_target_"}
    world = load_world(str(path), Course(**values))
    assert "poster" not in [body.name for body in world.bodies]
    assert "planes that do not face up are left out (poster); for a wall, use a box" in caplog.text


def test_what_is_not_searched_in_a_huge_world_is_told(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(course_planning, "MANY", 2)
    path = write(tmp_path, [(3, y, 0.5, 1, 1, 1) for y in (-3, 0, 3)], (0.0, 0.0))
    assert "because there are 4 shapes" in plan_course({"sdf": str(path)}, rover()).reason
