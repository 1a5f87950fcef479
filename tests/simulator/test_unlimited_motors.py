"""Robots whose files state no limits of their motors drive at the commanded speed."""

from pathlib import Path

import numpy as np
import pytest
from drive_cases import FRONT, PAIR, REAR, Y, steered
from pybullet_cases import level, short_experiment
from rigid_cases import ENGINES

from evoros.base.arrays import SPEED, STATE_SIZE
from evoros.drive.automatic import AutomaticDescription
from evoros.robot.loading import load_robot
from evoros.simulator.protocol import Simulator, open_alone

pytestmark = pytest.mark.usefixtures("closed_engines")

DRIVES = {"differential": PAIR, "skid_steer": FRONT + REAR, "ackermann": None}
UNLIMITED = {"none": "", "-1": 'effort="-1" velocity="-1"', "0": 'effort="0" velocity="0"'}
BODY = """<link name="base"><inertial><origin xyz="0 0 0.05"/><mass value="4"/><inertia ixx="0.05"
iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.06"/>
<geometry><box size="0.5 0.15 0.06"/></geometry></collision></link>"""


@pytest.mark.parametrize("simulator", ENGINES)
@pytest.mark.parametrize(
    ("limit", "kind"),
    [*(("none", kind) for kind in DRIVES), ("-1", "ackermann"), ("0", "differential")],
)
def test_wheels_without_limits_turn_as_commanded(
    simulator: type[Simulator], limit: str, kind: str, tmp_path: Path
) -> None:
    """PyBullet's wheels that skid are prisms in a margin of 1 mm, of 2 % of the radius."""
    stated = UNLIMITED[limit]
    steering = steered("revolute", f'<limit lower="-0.6" upper="0.6" {stated}/>')
    parts = (DRIVES[kind] or steering + REAR).replace(Y, f"{Y}<limit {stated}/>" if stated else Y)
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{BODY}{parts}</robot>')
    robot = load_robot(str(tmp_path / "r.urdf"), AutomaticDescription())
    speed, state = 0.9 * robot.drive.max_speed_mps, np.zeros(STATE_SIZE)
    with open_alone(simulator().open, robot, level(short_experiment())) as simulation:
        simulation.advance(np.array([speed, 0.0]), 2.0)
        simulation.observe(state)
    assert state[SPEED] == pytest.approx(speed, rel=0.03)
