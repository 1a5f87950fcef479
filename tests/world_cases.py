"""A course and bodies for the tests of worlds."""

from typing import Any

from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import Course
from evoros.world.model import World

CORNERS = [[5.0, 5.0], [5.0, -5.0], [-5.0, -5.0], [-5.0, 5.0]]


GROUND = Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),))


def square(**changes: Any) -> Course:
    fields: dict[str, Any] = {
        "home_x_m": 0.0,
        "home_y_m": 0.0,
        "home_z_m": 0.08,
        "home_yaw_rad": 1.562,
        "waypoints": CORNERS,
        "acceptance_m": 1.0,
        "time_limit_s": 540.0,
        "direction": "random",
        "end_on_collision": True,
    }
    return Course(**(fields | changes))


def world_of(*bodies: Body, course: Course | None = None) -> World:
    return World("test", bodies, course or square(), "test.sdf", "0" * 64)


def box(name: str, x: float, y: float, z: float, size: float = 1.0) -> Body:
    return Body(name, Pose((x, y, z)), (Shape("box", (size, size, size)),))
