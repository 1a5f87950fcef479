"""The robot for BARN has the published measures of the Jackal."""

import numpy as np
import pytest
from lxml import etree

from evoros import compose


def test_it_has_the_published_size_mass_and_wheels() -> None:
    robot = compose(["robot=coyote", "world=barn", "design=around"]).build().members[0].robot
    length, width = np.ptp(robot.outline, axis=0)
    assert (length, width) == (pytest.approx(0.508), pytest.approx(0.430))
    assert robot.drive.max_speed_mps == 2.0
    described = etree.fromstring(robot.urdf.encode())
    masses = [float(mass.get("value", "0")) for mass in described.iter("mass")]
    assert sum(masses) == pytest.approx(17.0)
    assert {wheel.get("radius") for wheel in described.iter("cylinder")} == {"0.098"}
