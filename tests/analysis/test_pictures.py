"""Pictures of worlds and robots."""

from dataclasses import replace

import numpy as np
import pytest
from field_cases import areas, field
from matplotlib.figure import Figure

from evoros.analysis.drawing import inspection
from evoros.analysis.drawing.worlds import draw_worlds
from evoros.config.compose import compose
from evoros.field.drawn import FIXED
from evoros.geometry.shapes import Body, Pose, Shape


def test_a_picture_has_every_obstacle_where_it_stands() -> None:
    open_, closed = field(enclosed=False).draw_world(FIXED), field().draw_world(FIXED)
    track = np.array([[0.0, 0.0], [1.0, 2.0]])
    drawn = draw_worlds({"open": open_, "closed": closed}, {"closed": [track]}, width=5.0)
    assert drawn.get_figwidth() == 5.0
    for axes, world in zip(drawn.axes[:2], (open_, closed), strict=True):
        (solids,) = axes.collections
        result = [path.get_extents() for path in solids.get_paths()]
        for box, area in zip(result, areas(world.bodies), strict=True):
            low = area.vertices.min(axis=0) - area.radius
            high = area.vertices.max(axis=0) + area.radius
            np.testing.assert_allclose([box.p0, box.p1], [low, high], atol=1e-3)
        tops = np.asarray(solids.get_array())
        heights = [b.shapes[0].size[-1] for b in world.obstacles]
        np.testing.assert_allclose(tops, heights, atol=1e-9)
    lines = [np.asarray(line.get_xydata()) for line in drawn.axes[1].get_lines()]
    assert any(np.array_equal(line, track) for line in lines)
    assert drawn.axes[0].get_title() == "open"


def test_a_picture_has_what_leans_and_what_is_raised() -> None:
    world = field().draw_world(FIXED)
    ground = [body for body in world.bodies if body.is_ground]
    lean = Pose.from_rpy((6.0, 0.0, 0.5), 1e-6, 0.0, 0.0)  # as a file with rounded angles has it
    post = Body("post", lean, (Shape("cylinder", (0.3, 1.0)),))
    shelf = Body("shelf", Pose((0.0, 6.0, 1.05)), (Shape("box", (1.0, 1.0, 0.1)),))
    drawn = draw_worlds({"two": replace(world, bodies=(*ground, post, shelf))})
    (solids,) = drawn.axes[0].collections
    boxes = [path.get_extents().bounds for path in solids.get_paths()]
    np.testing.assert_allclose(boxes[0], (5.7, -0.3, 0.6, 0.6), atol=1e-5)
    np.testing.assert_allclose(boxes[1], (-0.5, 5.5, 1.0, 1.0), atol=1e-9)
    np.testing.assert_allclose(np.asarray(solids.get_array()), (1.0, 1.1), atol=1e-5)


def test_a_picture_has_parts_of_meshes_and_leaves_out_floors() -> None:
    """A floor is no obstacle; a crate in the air is drawn where it lands."""
    world = field().draw_world(FIXED)
    ground = [body for body in world.bodies if body.is_ground]
    corners = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0))
    part = Body("part", Pose((2.0, 5.0, 0.0)), (Shape("convex", (), corners=corners),))
    slab = Body("slab", Pose((0.0, 0.0, -0.5)), (Shape("box", (30.0, 30.0, 1.0)),), floor=True)
    crate = Body("crate", Pose((-2.0, 5.0, 3.0)), (Shape("box", (1.0, 1.0, 1.0)),), mass=2.0)
    drawn = draw_worlds({"mesh": replace(world, bodies=(*ground, slab, part, crate))})
    (solids,) = drawn.axes[0].collections
    boxes = [path.get_extents().bounds for path in solids.get_paths()]
    np.testing.assert_allclose(boxes, [(2.0, 5.0, 1.0, 1.0), (-2.5, 4.5, 1.0, 1.0)], atol=1e-9)
    np.testing.assert_allclose(np.asarray(solids.get_array()), (2.0, 1.0), atol=1e-9)


@pytest.mark.parametrize(("name", "has_caster"), [("coyote", False), ("two_wheeler", True)])
def test_the_legend_names_the_parts_that_the_robot_has(
    name: str, has_caster: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr(inspection, "render", lambda figure, _: figures.append(figure))
    robot = compose([f"robot={name}"]).build().robot
    inspection.draw_robot_picture(robot, {})
    (legend,) = figures[0].legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["body", "driven wheel", *["caster"] * has_caster, "outline"]
