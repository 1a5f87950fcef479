"""Which sensors of a champion cannot be mounted as they are, or see the robot itself."""

from collections.abc import Iterator, Sequence

import numpy as np

from evoros.geometry.shapes import Pose
from evoros.robot.housings import Housing, find_overlaps

from .champion import Champion, MountedSensor


def list_clashes(sensors: Sequence[MountedSensor]) -> Iterator[str]:
    """Yield a line for each pair of sensors whose housings overlap."""
    for depth, first, second in find_overlaps([_describe(sensor) for sensor in sensors]):
        yield (
            f"the bodies of {first} and {second} overlap; move one of them by "
            f"{1000 * depth:.1f} mm or more"
        )


def list_hidden(champion: Champion) -> Iterator[str]:
    """Yield a line for each sensor that sees the robot itself."""
    for row in champion.self_sights.to_dict("records"):
        yield (
            f"the robot hides {100 * row['hidden_share']:.0f} % of the cone of {row['sensor']}, "
            f"which sees {row['seen_link']} {row['distance_m']:.3g} m away at some steering angle; "
            f"move or turn it"
        )


def _describe(sensor: MountedSensor) -> Housing:
    pitch, yaw = np.radians(-sensor.pitch_deg), np.radians(sensor.yaw_deg)
    axes = Pose.from_rpy((0.0, 0.0, 0.0), 0.0, pitch, yaw).rotation.T
    return Housing(sensor.link, sensor.position_m, axes, sensor.size_m)
