"""The names and units of the parameters of ArduPilot's range finders."""

import math

OCTANTS = 8
"""The level directions that a range finder can have, from forward on, clockwise from above."""
AXES = ("POS_X", "POS_Y", "POS_Z")
"""The place in the body frame: forward, right, down [m]."""
ORIENTATION = "ORIENT"
LIMITS = ("MIN", "MAX")


def name_parameter(instance: str, quantity: str) -> str:
    """Return the name of a parameter of a range finder, which is numbered 1 to 9 and then A."""
    return f"RNGFND{instance}_{quantity}"


def name_limit(limit: str, metres: bool) -> str:
    """Return the name of one of ``LIMITS``, which versions until 4.6 have in centimetres."""
    return limit if metres else f"{limit}_CM"


def to_body(position_m: tuple[float, float, float]) -> tuple[float, float, float]:
    """Turn a place forward, left and up into one in the body frame."""
    x, y, z = position_m
    return x, -y, -z


def count_octants(yaw_rad: float) -> int:
    """Return by how many eighths of a turn a direction is clockwise, to the nearest."""
    return round(-yaw_rad / (2.0 * math.pi) * OCTANTS)
