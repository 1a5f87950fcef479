"""Cross-checks a robot description with yourdfpy, which shares no code with this package.

Only ``evoros inspect`` uses this module. Runs do not, because yourdfpy
- takes 2.1 s of processor time to import (trimesh, networkx, scipy), while a command needs the
  robot within 0.8 s for its first line;
- uses the platform's sine and cosine: 80 of 359 origins of 27 public robots differ in the last bits
  (up to 6e-16), so missions would differ between processors;
- drops line numbers, ``<gazebo>``, ``<transmission>`` and ``<ros2_control>``, and assumes an
  inertia of 1 kg m2 if there is none.
"""

import io
import logging

import numpy as np
from lxml import etree

from evoros.formats.urdf.tree import read_tree
from evoros.robot.model import Robot

TOLERANCE_M = 1e-6


def read_again(robot: Robot) -> str:
    """Compare all link positions and the mass with yourdfpy; return the result as a sentence.

    Joints are at zero, as in missions, and shapes are ignored.
    """
    import yourdfpy  # the import takes two seconds

    elements = robot.base_urdf.copy_elements()
    etree.strip_elements(elements, "visual", "collision", "mimic")
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    urdf = yourdfpy.URDF.load(io.BytesIO(etree.tostring(elements)), load_meshes=False)
    poses = read_tree(robot.urdf_elements(), robot.name).poses
    base = poses[urdf.base_link].inverse()
    gaps = {
        name: float(np.linalg.norm(urdf.get_transform(name)[:3, 3] - (base @ poses[name]).position))
        for name in urdf.link_map
    }
    farthest = max(gaps, key=lambda name: gaps[name])
    inertials = (link.inertial for link in urdf.robot.links)
    mass = sum(inertial.mass or 0.0 for inertial in inertials if inertial is not None)
    if gaps[farthest] > TOLERANCE_M:
        return f"yourdfpy disagrees on the position of {farthest} by {1e3 * gaps[farthest]:.3g} mm"
    return f"yourdfpy agrees on the positions of all {len(gaps)} links, and reads {mass:.3g} kg"
