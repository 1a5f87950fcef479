"""SDF ``<sensor>`` elements for simulating the sensors in Gazebo."""

import math
from collections.abc import Iterable
from html import escape
from typing import NamedTuple

from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.protocol import Filter
from evoros.sensor.protocol import RangeSensor

_SENSOR = """\
<sensor name={name} type="{kind}">
  <topic>{topic}</topic>
  <update_rate>{rate}</update_rate>
  <always_on>true</always_on>
{content}</sensor>
"""

_LIDAR = """\
  <lidar>
    <scan>
{fans}    </scan>
    <range>
      <min>{range_min}</min>
      <max>{range_max}</max>
    </range>
{noise}  </lidar>
"""

_FAN = """\
      <{axis}>
        <samples>{samples}</samples>
        <resolution>1</resolution>
        <min_angle>{min_angle}</min_angle>
        <max_angle>{max_angle}</max_angle>
      </{axis}>
"""

_NOISE = """\
    <noise>
      <type>gaussian</type>
      <mean>0</mean>
      <stddev>{sigma}</stddev>
    </noise>
"""


class Fan(NamedTuple):
    """Rays that Gazebo spaces evenly between two angles, both included."""

    samples: int
    min_angle: float  # [rad]
    max_angle: float  # [rad]


def gazebo_rays(
    name: str,
    sensor: RangeSensor,
    horizontal: Fan,
    vertical: Fan | None = None,
    noise: Iterable[Filter] = (),
) -> str:
    """Return the SDF ``<sensor>``, including Gaussian noise; ``name`` is its name and topic."""
    fans = [("horizontal", horizontal), *([("vertical", vertical)] if vertical else [])]
    sigmas = [part.sigma_m for part in noise if isinstance(part, GaussianNoise)]
    sigma = math.sqrt(sum(sigma * sigma for sigma in sigmas))  # the noise terms are independent
    content = _LIDAR.format(
        fans="".join(_FAN.format(axis=axis, **fan._asdict()) for axis, fan in fans),
        range_min=sensor.range_min_m,
        range_max=sensor.range_max_m,
        noise=_NOISE.format(sigma=sigma) if sigmas else "",
    )
    return gazebo_sensor(name, "gpu_lidar", sensor.period_s, content)


def gazebo_sensor(name: str, kind: str, period_s: float, content: str = "") -> str:
    """Return the SDF ``<sensor>`` of a Gazebo type; ``name`` is its name and topic."""
    names = {"name": f'"{escape(name)}"', "topic": escape(name)}
    return _SENSOR.format(**names, kind=kind, rate=1 / period_s, content=content)
