"""A sensor that every design has, at a place that does not evolve."""

from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import NUMBER, TEXT, checked
from evoros.design.protocol import check_link
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount


@dataclass(frozen=True)
@checked
class FixedSensor:
    """A sensor that belongs to the robot, such as a built-in lidar."""

    sensor: Annotated[str, TEXT]  # name of its type, a key of the design's ``sensors``
    link: Annotated[str | None, TEXT] = None  # None: the link of the robot's mount
    x_m: Annotated[float, NUMBER] = 0.0  # in the frame of ``link``
    y_m: Annotated[float, NUMBER] = 0.0
    z_m: Annotated[float, NUMBER] = 0.0
    yaw_deg: Annotated[float, NUMBER] = 0.0  # left positive
    pitch_deg: Annotated[float, NUMBER] = 0.0  # nose up positive

    def bind(self, robot: Robot, key: str) -> Mount:
        """Return its mount on ``robot``; messages name it by its configuration ``key``."""
        link = self.link or robot.mount_link
        check_link(link, robot, False, key)
        place = (float(self.x_m), float(self.y_m), float(self.z_m))
        return Mount(self.sensor, link, *place, float(self.yaw_deg), float(self.pitch_deg))
