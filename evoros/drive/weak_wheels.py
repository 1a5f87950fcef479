"""The targets of a drive whose wheels are weak on one side."""

from evoros.drive.protocol import Drive


def has_side_motors(drive: Drive) -> bool:
    """Whether each side has a motor, so that the limit of the speed is a wheel's."""
    return drive.speed_limit_offset_m > 0.0


def find_targets(
    drive: Drive, speed: float, steering: float, left: float = 1.0, right: float = 1.0
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the angles and rates of a drive's joints; each side has a strength from 0 to 1.

    With a motor on each side, the strength is the share of its rate at which it turns. Otherwise
    one motor drives all wheels through open differentials, which have equal torques on both sides:
    the robot keeps its curve, and has the share of its speed that the weaker side leaves.
    """
    angles, rates = drive.targets(speed, steering)
    if left == right == 1.0:
        return angles, rates
    if not has_side_motors(drive):
        left = right = min(left, right)
    middle = len(rates) // 2
    return angles, (
        *(left * rate for rate in rates[:middle]),
        *(right * rate for rate in rates[middle:]),
    )
