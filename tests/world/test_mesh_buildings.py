"""Buildings drawn as one mesh keep their rooms and doors, and what is coarse is told as area."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from fault_cases import configured, first_mission
from mesh_cases import grid_mesh
from proposal_sites import is_of, list_alternatives
from world_cases import square

from evoros.base.arrays import Array
from evoros.formats import mesh
from evoros.formats.sdf.geometry import _MOST_WORK
from evoros.geometry.footprint import distances, project_bodies
from evoros.geometry.mesh_parts import divide_mesh
from evoros.mission.mission import COMPLETED
from evoros.mission.rollout import run_mission
from evoros.terminal.activity import listen
from evoros.world.loading import load_world
from evoros.world.mesh_areas import measure_meshes
from evoros.world.model import World

HEIGHT_M = 0.4
THIN, WIDE = 0.1, 1.9  # [m], of the columns and rows of a plan in turn
PLANS = {
    "an L with a door": [
        "#####....",
        "#...#....",
        "#...#....",
        "#...#....",
        "#...#####",
        "#.......#",
        "#.......#",
        "#.......D",
        "#########",
    ],
    "a U": ["#######", "#.....#", "#.###.#", "#.#.#.#", "#.#.#.#", "#.#.#.#", "###.###"],
    "a hall": [
        "#################",
        *(["#...............#", "#.#.#.#.#.#.#.#.#"] * 7),
        "D...............#",
        "#################",
    ],
}


def draw(plan: list[str], roof: bool, sheets: bool) -> tuple[Array, list[list[float]]]:
    """The mesh of a plan, whose doors are 2.1 m high, and the lines of its grid."""
    cells = np.array([list(row) for row in plan[::-1]]).T
    walls = cells == "#"
    lintel = walls | (cells == "D")
    top = np.ones_like(walls) if roof else lintel
    lines = [np.cumsum([0.0, *([THIN, WIDE] * 20)])[: n + 1].tolist() for n in walls.shape]
    triangles = grid_mesh(np.stack([walls, lintel, top], axis=2), [*lines, [0, 2.1, 2.5, 2.6]])
    if sheets:  # without the undersides of the walls, so that nothing is closed
        triangles = triangles[triangles[:, :, 2].max(axis=1) > 0.0]
    return triangles, lines


def load(folder: Path, triangles: Array, effort: float = 1.0, **course: Any) -> World:
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    trimesh.Trimesh(triangles.reshape(-1, 3), faces).export(folder / "house.stl")
    (folder / "w.sdf").write_text(
        "<sdf version='1.6'><world name='w'><model name='ground'><static>1</static><link name='l'>"
        "<collision name='c'><geometry><plane/></geometry></collision></link></model>"
        "<model name='house'><static>1</static><pose>-2.9 -1 0 0 0 0</pose>"
        "<link name='l'><collision name='c'><geometry><mesh><uri>house.stl</uri></mesh>"
        "</geometry></collision></link></model></world></sdf>"
    )
    course = {"waypoints": [[0.5, 0.0]], **course}
    return load_world(str(folder / "w.sdf"), square(**course), mesh_effort=effort)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    mesh._read.cache_clear()


@pytest.mark.parametrize("sheets", [False, True], ids=["solid", "sheets"])
@pytest.mark.parametrize("roof", [False, True], ids=["open", "roof"])
@pytest.mark.parametrize("name", PLANS)
def test_a_building_is_where_its_walls_are(
    tmp_path: Path, name: str, roof: bool, sheets: bool
) -> None:
    triangles, lines = draw(PLANS[name], roof, sheets)
    world = load(tmp_path, triangles)
    axes = [np.arange(0.013, line[-1], 0.05) for line in lines]
    x, y = (values.ravel() for values in np.meshgrid(*axes, indexing="ij"))
    columns, rows = (np.searchsorted(line, at) - 1 for line, at in zip(lines, (x, y), strict=True))
    plan = np.array([list(row) for row in PLANS[name][::-1]]).T
    is_wall = plan[columns, rows] == "#"
    points = np.column_stack([x - 2.9, y - 1.0])
    taken = np.zeros(len(points), dtype=bool)
    for footprint in project_bodies(world.obstacles, HEIGHT_M):
        taken |= distances(footprint, points) == 0.0
    assert not (taken & ~is_wall).any()
    if not sheets:  # whose walls are hollow
        assert (taken >= is_wall).all()
    assert measure_meshes(world, HEIGHT_M) == ()


def test_a_robot_drives_through_the_door_of_a_building(tmp_path: Path) -> None:
    triangles, _ = draw(PLANS["an L with a door"], roof=True, sheets=False)
    way = [[3.5, 0.0], [7.5, 0.0]]
    world = load(tmp_path, triangles, waypoints=way, home_yaw_rad=0.0, direction="one_way")
    experiment = configured()  # without avoidance
    scenario = replace(experiment.scenario, world={"house": world})
    mission = replace(first_mission(experiment), world="house")
    (outcome, *_), _ = run_mission(scenario, mission)
    assert outcome.ended == COMPLETED


@pytest.mark.parametrize(("effort", "home_x"), [(1e-3, 20.0), (1e-2, 120.0), (1.0, 120.0)])
def test_the_effort_that_is_proposed_divides_a_mesh(
    effort: float, home_x: float, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The work was cut short, or the mesh is too far from the course."""
    triangles, _ = draw(PLANS["a U"], roof=False, sheets=False)
    course = {"home_x_m": home_x, "waypoints": [[home_x + 1.0, 0.0]]}
    load(tmp_path, triangles, effort, **course)
    (note,) = caplog.messages
    assert is_of(note, "evoros/formats/sdf/geometry.py world.NAME.mesh_effort={wanted}")
    caplog.clear()
    ((typed,),) = list_alternatives(note, {})
    world = load(tmp_path, triangles, float(typed.partition("=")[2]), **course)
    assert caplog.messages == []
    assert measure_meshes(world, HEIGHT_M) == ()


def test_a_building_without_effort_is_its_hull_which_is_told_as_area(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    triangles, lines = draw(PLANS["a U"], roof=False, sheets=False)
    world = load(tmp_path, triangles, 1e-9, home_x_m=20.0, waypoints=[[21.0, 0.0]])
    assert "world.NAME.mesh_effort=1e-08 makes finer parts, but takes longer" in caplog.text
    (area,) = measure_meshes(world, HEIGHT_M)
    whole = lines[0][-1] * lines[1][-1]
    assert area.footprint_m2 == pytest.approx(whole, rel=1e-4)
    walls = sum(
        (lines[0][i + 1] - lines[0][i]) * (lines[1][j + 1] - lines[1][j])
        for j, row in enumerate(PLANS["a U"][::-1])
        for i, cell in enumerate(row)
        if cell == "#"
    )
    assert area.false_m2 == pytest.approx(whole - walls, rel=0.05)  # but for 2 cm at the walls
    assert area.is_large


HOUSE = (
    "<model name='{name}'><static>1</static><pose>{x} -1 0 0 0 0</pose><link name='l'>"
    "<collision name='c'><geometry><mesh><uri>{name}.stl</uri></mesh></geometry></collision></link>"
    "</model>"
)


def test_meshes_at_robot_height_come_before_meshes_above_it(tmp_path: Path) -> None:
    triangles, _ = draw(PLANS["a U"], roof=True, sheets=False)
    for name, factor in (("high", 1.0), ("low", 0.9)):
        corners = triangles.reshape(-1, 3) * factor
        faces = np.arange(len(corners)).reshape(-1, 3)
        trimesh.Trimesh(corners, faces).export(tmp_path / f"{name}.stl")
    bodies = HOUSE.format(name="high", x="2").replace("-1 0 0", "-1 2 0") + HOUSE.format(
        name="low", x="6"
    )
    file = tmp_path / "w.sdf"
    file.write_text(f"<sdf version='1.6'><world name='w'>{bodies}</world></sdf>")
    effort = divide_mesh(triangles).work / _MOST_WORK
    announced: list[str] = []
    with listen(announced.append):
        load_world(str(file), square(waypoints=[[0.5, 0.0]]), mesh_effort=1.1 * effort)
    divided = [text for text in announced if text.startswith("dividing")]
    assert divided == [
        f"dividing {name}.stl into convex parts, mesh {i} of 2"
        for i, name in enumerate(("low", "high"), 1)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("step", [1, -1])
def test_houses_next_to_the_course_come_first_whatever_the_order_in_the_file(
    tmp_path: Path, step: int, caplog: pytest.LogCaptureFixture
) -> None:
    triangles, _ = draw(PLANS["a U"], roof=True, sheets=False)
    places = {f"house{i}": 2.0 + 1.3 * i for i in range(20)} | {"remote": 60.0}
    for i, name in enumerate(places):  # files that differ
        corners = triangles.reshape(-1, 3) * (1.0 - 0.001 * i)
        faces = np.arange(len(corners)).reshape(-1, 3)
        trimesh.Trimesh(corners, faces).export(tmp_path / f"{name}.stl")
    houses = [HOUSE.format(name=name, x=x) for name, x in places.items()]
    file = tmp_path / "w.sdf"
    file.write_text(f"<sdf version='1.6'><world name='w'>{''.join(houses[::step])}</world></sdf>")

    def count_parts(effort: float) -> list[int]:
        world = load_world(str(file), square(waypoints=[[0.5, 0.0]]), mesh_effort=effort)
        counts = {body.name: len(body.shapes) for body in world.obstacles}
        return [counts[name] for name in places]

    whole = count_parts(1.0)
    assert min(whole[:-1]) > 1
    assert whole[-1] == 1
    assert "remote.stl: the mesh is divided coarsely, because it is more than 30 m" in caplog.text
    # A house may take a seventh of the work, which is 17 times what it needs.
    limited = count_parts(2.5 * divide_mesh(triangles).work / _MOST_WORK)
    assert limited[:14] == whole[:14]
    assert limited[-2:] == [1, 1]


def test_a_limited_effort_gives_the_same_parts_whatever_the_machine_does(tmp_path: Path) -> None:
    triangles, _ = draw(PLANS["a hall"], roof=True, sheets=False)
    shapes: list[list[object]] = []
    for effort in (0.01, 0.01, 1.0):
        mesh._read.cache_clear()
        (tmp_path / f"{len(shapes)}").mkdir()
        body = load(tmp_path / f"{len(shapes)}", triangles, effort, home_x_m=30.0).obstacles[0]
        shapes.append([shape.corners for shape in body.shapes])
    assert shapes[0] == shapes[1]
    assert shapes[0] != shapes[2]
