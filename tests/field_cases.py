"""Fields for the tests of generated worlds."""

import json
from typing import Any

from hypothesis import strategies as st

from evoros.field.generated import Field
from evoros.field.obstacles import Box, Cylinder, ObstacleKind
from evoros.geometry.footprint import Footprint, project_shape
from evoros.geometry.shapes import Body
from evoros.world.course import Course

SQUARE = [[5.0, 5.0], [5.0, -5.0], [-5.0, -5.0], [-5.0, 5.0]]


CRATES = Box([0.3, 0.8], [0.3, 0.8], [0.3, 0.8])


POSTS = Cylinder([0.1, 0.3], 1.0)


LIGHT = Box([0.2, 0.4], 0.2, 0.2, 0.5, mass_kg=5.0)


BARRELS = Cylinder(0.4, [0.3, 0.9], 0.5, mass_kg=8.0)


KINDS: dict[str, ObstacleKind] = {
    "crates": CRATES,
    "posts": POSTS,
    "light": LIGHT,
    "barrels": BARRELS,
}


def course(waypoints: Any = SQUARE, x: float = 0.0, y: float = 0.0) -> Course:
    return Course(x, y, 0.08, 1.562, waypoints, 1.0, 540.0, "random", True)


def field(**changes: Any) -> Field:
    values: dict[str, Any] = {
        "course": course(),
        "extent_m": [14.0, 14.0],
        "density": 0.25,
        "kinds": KINDS,
        "clearing_m": 1.0,
        "gap_m": 0.3,
        "passage_m": 0.9,
        "enclosed": True,
    }
    return Field(**(values | changes))


@st.composite
def fields(draw: st.DrawFn) -> Field:
    gap = draw(st.sampled_from([0.0, 0.2, 0.5]))
    return field(
        course=course(draw(st.sampled_from([SQUARE, [[3.0, 1.0]]])), 1.0, -2.0),
        extent_m=[draw(st.sampled_from([14.0, 16.5])), 15.3],
        density=draw(st.sampled_from([0.0, 0.1, 0.25])),
        gap_m=gap,
        passage_m=draw(st.sampled_from([0.6, 0.9, 1.2])),
        enclosed=draw(st.booleans()),
        seed=draw(st.integers(0, 10**6)),
        others=draw(st.sampled_from([(), (course([[-4.0, 0.0], [0.0, 3.0]], 2.0, -4.0),)])),
    )


def areas(bodies: tuple[Body, ...]) -> list[Footprint]:
    return [project_shape(s, b.pose @ s.pose) for b in bodies for s in b.shapes if not b.is_ground]


def noted(sdf: str) -> tuple[Field, str]:
    """The field and the key of draws that an SDF file names."""
    comment = sdf[sdf.index("<!--") + 4 : sdf.index("-->")]
    lines = [line.partition(": ") for line in comment.splitlines() if ": " in line]
    values = {key: json.loads(value, object_hook=_rebuild) for key, _, value in lines}
    draws = values.pop("draws")
    return Field(**values), draws


def _rebuild(values: dict[str, Any]) -> Any:
    types = {"box": Box, "cylinder": Cylinder, "course": Course}
    return types[values.pop("type")](**values) if "type" in values else values
