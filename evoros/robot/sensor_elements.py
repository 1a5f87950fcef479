"""A mounted sensor as the elements of a URDF: a link and a fixed joint."""

import math

from lxml import etree
from lxml.etree import SubElement
from lxml.etree import _Element as Element

from evoros.sensor.protocol import Mount, Sensor


def sensor_elements(name: str, mount: Mount, sensor: Sensor) -> tuple[Element, Element]:
    """Create the link ``name`` of a sensor, and the joint that mounts it."""
    link = etree.Element("link", name=name)
    _add_body(link, sensor)
    joint = etree.Element("joint", name=f"{name}_joint", type="fixed")
    SubElement(joint, "parent", link=mount.link)
    SubElement(joint, "child", link=name)
    # A positive rotation about y lowers the nose.
    xyz = f"{float(mount.x_m)!r} {float(mount.y_m)!r} {float(mount.z_m)!r}"
    rpy = f"0 {-math.radians(mount.pitch_deg)!r} {math.radians(mount.yaw_deg)!r}"
    SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    return link, joint


def _add_body(link: Element, sensor: Sensor) -> None:
    """Add a homogeneous box with a mass and a visual, and without a collision shape."""
    mass, (x, y, z) = float(sensor.mass_kg), map(float, sensor.size_m)
    moments = (y * y + z * z, x * x + z * z, x * x + y * y)
    xx, yy, zz = (f"{mass * moment / 12.0}" for moment in moments)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "mass", value=f"{mass}")
    SubElement(inertial, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(inertial, "inertia", ixx=xx, ixy="0", ixz="0", iyy=yy, iyz="0", izz=zz)
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(SubElement(visual, "geometry"), "box", size=f"{x} {y} {z}")
    SubElement(SubElement(visual, "material", name="sensor"), "color", rgba="0.1 0.3 0.8 1")
