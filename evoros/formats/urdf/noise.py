"""Reads the noise of sensors that a robot's description has for Gazebo."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import find_child, read_number, read_text

GAUSSIAN, NONE = "gaussian", "none"
_KEPT = ("mean", "stddev", "bias_mean", "bias_stddev")
_OTHERS = ("precision", "dynamic_bias_stddev", "dynamic_bias_correlation_time")
_NOT_NEGATIVE = ("at least 0", lambda value: value >= 0.0)
_RULES: Mapping[str, tuple[str, Callable[[float], bool]]] = {
    "stddev": _NOT_NEGATIVE,
    "bias_stddev": _NOT_NEGATIVE,
}
_QUANTITIES = {
    "rate": ("angular_velocity", "rate"),
    "acceleration": ("linear_acceleration", "accel"),
}
"""The filters of an IMU begin so; the element of each quantity now, and in old descriptions."""
_AXES = ("x", "y", "z")


class Noise(NamedTuple):
    """Settings of the filters of a type of sensor, by ``filter.field``, and what is lost."""

    settings: Mapping[str, float]
    notes: tuple[str, ...]


def read_ray_noise(*elements: Element) -> Noise:
    """Read the Gaussian noise of ranges, which stands in one of several elements."""
    noises = (find_child(element, "noise") for element in elements)
    noise = next((element for element in noises if element is not None), None)
    if noise is None:
        return Noise({}, ())
    values, lost = _read_values(noise)
    lost += [name for name in _KEPT if name != "stddev" and values.get(name)]
    settings = {"noise.sigma_m": values["stddev"]} if "stddev" in values else {}
    return Noise(settings, _tell(lost, "its noise"))


def read_imu_noise(sensor: Element) -> Noise:
    """Read the noise and the biases of an IMU.

    A quantity has the values of the axis with the most noise. Values that the description does not
    state are 0.
    """
    imu = find_child(sensor, "imu")
    settings: dict[str, float] = {}
    notes: tuple[str, ...] = ()
    if imu is None:
        return Noise(settings, notes)
    for quantity, (now, before) in _QUANTITIES.items():
        axes = list(_find_axes(imu, now, before))
        if not any(axis is not None for axis in axes):
            continue
        read = [_read_values(axis) for axis in axes]
        lost = [name for _, names in read for name in names]
        lost += ["bias_mean"] * any(values.get("bias_mean") for values, _ in read)
        most = {name: max((v.get(name, 0.0) for v, _ in read), key=abs) for name in _KEPT}
        lost += [
            f"the difference of {name} between its axes"
            for name in ("mean", "stddev", "bias_stddev")
            if {v.get(name, 0.0) for v, _ in read} != {most[name]}
        ]
        settings |= {
            f"{quantity}_noise.sigma_m": most["stddev"],
            f"{quantity}_bias.offset_m": most["mean"],
            f"{quantity}_bias.sd_m": math.hypot(most["bias_mean"], most["bias_stddev"]),
        }
        notes += _tell(lost, f"the noise of <{now}>")
    return Noise(settings, notes)


def _find_axes(imu: Element, now: str, before: str) -> Iterator[Element | None]:
    """Yield the noise of each axis of a quantity, or the one that all of them have."""
    quantity, common = find_child(imu, now), find_child(imu, "noise")
    if quantity is not None:
        axes = (find_child(quantity, axis) for axis in _AXES)
        yield from (None if axis is None else find_child(axis, "noise") for axis in axes)
    elif common is not None:
        yield find_child(common, before)


def _read_values(noise: Element | None) -> tuple[dict[str, float], list[str]]:
    """Return the values of a noise that evoros may keep, and the names of others."""
    if noise is None:
        return {}, []
    kind = find_child(noise, "type")
    given = noise.get("type") or (GAUSSIAN if kind is None else read_text(kind).strip())
    if given == NONE:
        return {}, []
    values = {
        name: read_number(element, *_RULES.get(name, ("a number", math.isfinite)))
        for name in (*_KEPT, *_OTHERS)
        if (element := find_child(noise, name)) is not None
    }
    lost = [name for name in _OTHERS if values.pop(name, 0.0)]
    lost += [f"type {given}"] * (given != GAUSSIAN and "precision" not in lost)
    return values, lost


def _tell(lost: Iterable[str], where: str) -> tuple[str, ...]:
    """Return a note that names what evoros cannot keep, or none."""
    names = list(dict.fromkeys(lost))
    return (f"cannot keep all of {where}: {', '.join(names)}",) * bool(names)
