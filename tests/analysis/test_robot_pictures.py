"""Pictures of robots for `evoros inspect`."""

import pytest
from matplotlib.figure import Figure

from evoros.analysis.drawing import inspection
from evoros.config.compose import compose


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
