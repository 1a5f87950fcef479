"""Where on a robot a sensor may be, and where it may face."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from evoros.errors import TEXT, InputError, Rule, check
from evoros.genes import INTERVAL, ends

if TYPE_CHECKING:
    from evoros.robot import Robot

OVERHANG_M = 0.05  # how far a sensor may stand out from the robot: a bracket, not a mast


def _within(limit: float, text: str) -> Rule:
    def holds(value: object) -> bool:
        return INTERVAL.holds(value) and all(abs(end) <= limit for end in ends(value))

    return Rule(f"{INTERVAL.text}, {text}", holds)


HEADING = _within(360, "from -360 to 360")
ELEVATION = _within(90, "from -90 to 90")


@dataclass(frozen=True)
class Region:
    """Where a sensor may be and where it may face: each a number, or [low, high]."""

    x_m: float | Sequence[float]  # in the frame of ``link``
    y_m: float | Sequence[float]
    yaw_deg: float | Sequence[float]  # left positive
    z_m: float | Sequence[float] | None = None  # None: as high as the robot's default mount
    pitch_deg: float | Sequence[float] | None = None  # nose up positive; None: the default mount's
    link: str | None = None  # None: the link of the robot's default mount

    def __post_init__(self) -> None:
        check(self, x_m=INTERVAL, y_m=INTERVAL, yaw_deg=HEADING)
        optional = {"z_m": INTERVAL, "pitch_deg": ELEVATION, "link": TEXT}
        check(self, **{k: rule for k, rule in optional.items() if getattr(self, k) is not None})

    def on(self, robot: "Robot", mirrored: bool, where: str) -> "Region":
        """This region with the default mount of ``robot`` wherever it leaves a value to it.

        ``where`` is its place in the configuration, for messages.

        Raises:
            InputError: the region, or its mirror image where ``mirrored``, is off the robot.
        """
        if self.link in (None, robot.mount_link):
            self._check_outline(robot, mirrored, where)
        else:
            self._check_link(robot, where)
        return replace(
            self,
            z_m=robot.mount_z_m if self.z_m is None else self.z_m,
            pitch_deg=robot.mount_pitch_deg if self.pitch_deg is None else self.pitch_deg,
            link=robot.mount_link if self.link is None else self.link,
        )

    def _check_link(self, robot: "Robot", where: str) -> None:
        links = re.findall(r"<link\s[^>]*?name\s*=\s*[\"']([^\"']+)", robot.urdf)
        if self.link not in links:
            raise InputError(
                f"{where}.link: must be a link of {robot.name}, not {self.link!r}; "
                f"choose one of {', '.join(links)}"
            )
        if self.z_m is None or self.pitch_deg is None:
            raise InputError(
                f"{where}: z_m and pitch_deg must be numbers on the link {self.link}, not null; "
                f"give them, for the robot's default mount is on {robot.mount_link}"
            )

    def _check_outline(self, robot: "Robot", mirrored: bool, where: str) -> None:
        (x_low, x_high), (y_low, y_high) = ends(self.x_m), ends(self.y_m)
        if mirrored:
            y_low, y_high = min(y_low, -y_high), max(y_high, -y_low)
        least, most = robot.outline.min(axis=0), robot.outline.max(axis=0)
        for axis, name, low, high in ((0, "x_m", x_low, x_high), (1, "y_m", y_low, y_high)):
            if low < least[axis] - OVERHANG_M or high > most[axis] + OVERHANG_M:
                raise InputError(
                    f"{where}.{name}: must lie within {OVERHANG_M} m of the outline of "
                    f"{robot.name} ({least[axis]:g} to {most[axis]:g} m), not [{low:g}, {high:g}]; "
                    f"move the region onto the robot"
                )
