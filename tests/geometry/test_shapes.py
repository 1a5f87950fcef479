"""Poses, shapes and bodies that are refused."""

import math
from typing import Any

import pytest
from world_cases import GROUND

from evoros.base.errors import InputError
from evoros.geometry.shapes import Body, Pose, Shape


@pytest.mark.parametrize(
    "build",
    [
        lambda: Pose((0.0, 0.0, math.nan)),
        lambda: Pose(quaternion=(0.0, 0.0, 0.0, 2.0)),
        lambda: Shape("cone", (1.0, 1.0)),
        lambda: Shape("box", (1.0, 1.0)),
        lambda: Shape("box", (1.0, 0.0, 1.0)),
        lambda: Shape("sphere", (math.inf,)),
        lambda: Shape("plane", (0.0, 0.0, 0.0)),
        lambda: Body("", Pose(), GROUND.shapes),
        lambda: Body("b", Pose(), ()),
        lambda: Body("b", Pose(), GROUND.shapes, mass=1.0),
        lambda: Body("b", Pose(), (Shape("sphere", (1.0,)),), mass=0.0),
        lambda: Body("b", Pose(), (Shape("sphere", (1.0,)),), friction=-1.0),
        lambda: Body("b", Pose(), (Shape("sphere", (1.0,)),), 1.0, 1.0, (1.0, 1.0, 0.0)),
    ],
)
def test_a_bad_description_is_refused(build: Any) -> None:
    with pytest.raises(InputError, match=r"^(Pose|Shape|Body)\.\w+: [^\n]*, not [^\n]+$"):
        build()
