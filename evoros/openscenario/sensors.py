"""Finds the sensors that a scenario names, and their readings."""

import math
from collections.abc import Sequence

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.robot.model import Robot

ALL = "all"


def select_sensors(robot: Robot, text: str) -> list[int]:
    """Return the numbers of the sensors that a text names: all, numbers, names of types.

    Raises:
        InputError: the robot has no such sensor.
    """
    types = [mount.sensor for mount in robot.mounts]
    chosen: set[int] = set()
    for word in text.replace(",", " ").split():
        found = [
            number
            for number, name in enumerate(types)
            if word in (ALL, name) or (word.isdecimal() and int(word) == number)
        ]
        chosen.update(found)
        if not found:
            chosen.clear()
            break
    if not chosen:
        known = ", ".join(dict.fromkeys(types)) or "no sensors"
        raise InputError(
            f"sensors: must be all, numbers from 0 to {len(types) - 1} or names of types "
            f"({known}), not {text!r}; correct them"
        )
    return sorted(chosen)


def smallest_reading(robot: Robot, readings: Array, numbers: Sequence[int], channel: str) -> float:
    """Return the smallest reading of sensors in channels whose names begin so; NaN if silent.

    Raises:
        InputError: the sensors have no such channel.
    """
    sensors = robot.mounted_sensors()
    values = [
        float(value)
        for number in numbers
        for value, each in zip(
            readings[robot.layout[number]], sensors[number].channels, strict=True
        )
        if each.name.startswith(channel)
    ]
    if not values:
        names = [each.name for number in numbers for each in sensors[number].channels]
        raise InputError(
            f"channel: must begin the name of a channel ({', '.join(dict.fromkeys(names))}), not "
            f"{channel!r}; correct it, or leave it out for all"
        )
    return min((value for value in values if not math.isnan(value)), default=math.nan)
