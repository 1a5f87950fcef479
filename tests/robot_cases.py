"""Robots and sensors for the tests of robots."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, cast

import numpy as np
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from lxml import etree
from numpy.typing import NDArray
from omegaconf import OmegaConf

from evoros.base.arrays import Array
from evoros.drive.ackermann import Ackermann
from evoros.files import resources as assets
from evoros.filter.protocol import Filter
from evoros.robot.loading import load_robot
from evoros.robot.model import Robot
from evoros.robot.mounting import MountDefaults
from evoros.sensor.protocol import Channel, Mount, RangeSensor

ROBOTS = ["erle_rover", "erle_rover_as_run", "two_wheeler"]


@dataclass(frozen=True)
class Whisker(RangeSensor):
    """The least sensor: one ray."""

    period_s: float = 0.1
    range_min_m: float = 0.0
    range_max_m: float = 1.0
    size_m: Sequence[float] = (0.01, 0.02, 0.03)
    mass_kg: float = 0.012
    price: float = 1.0
    filters: Mapping[str, Filter] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[Channel]:
        return (Channel("range", "m", self.range_min_m, self.range_max_m),)

    def rays(self) -> Array:
        return np.array([[1.0, 0.0, 0.0]])

    def channel_of(self) -> NDArray[np.int64]:
        return np.zeros(1, dtype=np.int64)

    def gazebo(self, name: str) -> str:
        return f'<sensor name="{name}" type="ray"/>'


SENSORS: Any = {"sonar": Whisker(), "whisker": Whisker()}


def configuration(name: str) -> dict[str, Any]:
    with initialize_config_dir(str(assets.bundled_folder("conf")), version_base=None):
        composed = compose(overrides=[f"+robot={name}"])
    config: dict[str, Any] = cast(Any, OmegaConf.to_container(composed))["robot"]
    return config


def load(name: str = "erle_rover", **changes: Any) -> Robot:
    config = {**configuration(name), **changes}
    mount = {key: value for key, value in config["mount"].items() if key != "_target_"}
    return load_robot(
        description=config["description"],
        arguments=config["arguments"],
        packages=config["packages"],
        missing=config.get("missing", "error"),
        wheels_touch=config.get("wheels_touch", True),
        self_occlusion=config.get("self_occlusion", "collisions"),
        mount=MountDefaults(**mount),
        drive=instantiate(config["drive"], _convert_="all"),
    )


@cache
def rover(name: str = "erle_rover") -> Robot:
    return load(name)


def car(name: str = "erle_rover") -> Ackermann:
    drive = rover(name).drive
    assert isinstance(drive, Ackermann)
    return drive


def independent(urdf: str) -> Any:
    import yourdfpy

    return yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False)


def some_mounts(count: int = 6) -> list[Mount]:
    return [Mount("sonar", "base_link", 0.2, 0.01 * i, 0.166, 10.0 * i, 12.5) for i in range(count)]


Edit = Callable[[etree._Element], object]


def find(root: etree._Element, path: str) -> etree._Element:
    element = root.find(path)
    assert element is not None, path
    return element


def append(xml: str, path: str = ".") -> Edit:
    return lambda root: find(root, path).append(etree.fromstring(xml))


WHEEL = "link[@name='rear_left_wheel']"
