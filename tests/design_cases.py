"""A robot, regions and design spaces for the tests of designs."""

import math
from dataclasses import dataclass

import numpy as np
from bundled_parts import ByName
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from evoros.design.genes import Gene
from evoros.design.region import Region
from evoros.design.space import DesignSpace, SensorDesign
from evoros.files.resources import bundled_folder
from evoros.formats.urdf.tree import UrdfDocument
from evoros.robot.model import Robot
from evoros.sensor.sonar import Sonar


@dataclass(frozen=True)
class Cart:
    """The values of a drive that can evolve."""

    max_speed_mps: float = 0.4


ROBOT = Robot(
    name="cart",
    base_urdf=UrdfDocument("<robot name='cart'><link name='base'/></robot>"),
    drive=Cart(),  # type: ignore[arg-type]
    outline=np.array([[-0.2, -0.15], [0.25, -0.15], [0.25, 0.15], [-0.2, 0.15]]),
    height_m=0.2,
    mount_link="base",
    mount_z_m=0.166,
    mount_pitch_deg=12.5,
    sensor_links={
        "base": (0, 0, 0, 0),
        "mast": (-0.1, 0, 0.3, 0),
        "door": (0, 0.15, 0.1, math.pi / 2),
    },
)


FRONT = Region(x_m=[0.2, 0.25], y_m=[-0.1, 0.1], yaw_deg=[-30, 30])
SIDE = Region(x_m=[0, 0.2], y_m=0.15, yaw_deg=[40, 90], z_m=[0.1, 0.25], pitch_deg=[-5, 15])
MAST = Region(x_m=0, y_m=[-0.02, 0.02], yaw_deg=[-180, 180], z_m=0.05, pitch_deg=0, link="mast")
AVOID = Gene("controller.avoidance.range_m", 1, 4)
VOTES = Gene("controller.votes", 2, 5, whole=True)
MIXED = SensorDesign(
    sensors={"near": Sonar(range_max_m=2), "far": Sonar()},
    regions={"front": FRONT, "side": SIDE, "mast": MAST},
    number=[0, 3],
    mirrored=True,
    genes={"avoid": AVOID, "votes": VOTES},
)
ONE = SensorDesign({"sonar": Sonar()}, {"front": FRONT}, 1, False)


def configured(name: str) -> SensorDesign:
    with initialize_config_dir(str(bundled_folder("conf")), version_base="1.3"):
        design = instantiate(compose(overrides=[f"+design={name}"]).design, _convert_="all")
    assert isinstance(design, SensorDesign)
    return design


NAMES = sorted(path.stem for path in bundled_folder("conf").glob("design/*.yaml"))


SPACES: ByName[DesignSpace] = ByName(
    [*NAMES, "mixed"], lambda name: (MIXED if name == "mixed" else configured(name)).bind(ROBOT)
)
