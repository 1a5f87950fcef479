"""Writes bodies as an SDF file, which the reader of this package and Gazebo can read.

Lengths and angles are rounded to nine decimals, so that a file that was read is written unchanged.
"""

import math
from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

from evoros.geometry.shapes import Body, Pose, Shape

_FRAME = """<?xml version="1.0"?>
{comment}<sdf version="1.9">
  <world name={name}>
{models}
  </world>
</sdf>
"""
_MODEL = """    <model name={name}>
{static}      <pose>{pose}</pose>
      <link name="link">
{content}
      </link>
    </model>"""
_INERTIAL = """        <inertial>
          <mass>{mass}</mass>
{moments}        </inertial>"""
_MOMENTS = """          <inertia>
            <ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz>
            <ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>
          </inertia>
"""
_SOLID = """        <collision name="collision{number}">
{pose}          <geometry>{geometry}</geometry>
          <surface>
            <friction><ode><mu>{mu}</mu><mu2>{mu}</mu2></ode></friction>
          </surface>
        </collision>
        <visual name="visual{number}">
{pose}          <geometry>{geometry}</geometry>
        </visual>"""
_GEOMETRY = {
    "box": "<box><size>{} {} {}</size></box>",
    "cylinder": "<cylinder><radius>{}</radius><length>{}</length></cylinder>",
    "sphere": "<sphere><radius>{}</radius></sphere>",
    "plane": "<plane><normal>{} {} {}</normal><size>100 100</size></plane>",
}


def write_sdf(name: str, bodies: Iterable[Body], comment: str = "") -> str:
    """Return the text of an SDF file with a world of these bodies, each of which is a model.

    The file begins with ``comment``, in which XML does not allow ``--``.
    """
    note = f"<!-- {comment} -->\n" if comment else ""
    models = "\n".join(map(_format_model, bodies))
    return _FRAME.format(comment=note, name=quoteattr(name), models=models)


def _format_model(body: Body) -> str:
    solids = (_format_solid(i + 1, shape, body.friction) for i, shape in enumerate(body.shapes))
    content = [*solids] if body.mass is None else [_format_inertial(body), *solids]
    return _MODEL.format(
        name=quoteattr(body.name.replace("::", "-")),  # `::` separates the names in a path
        static="      <static>true</static>\n" if body.mass is None else "",
        pose=_format_pose(body.pose),
        content="\n".join(content),
    )


def _format_inertial(body: Body) -> str:
    moments = "" if body.inertia is None else _MOMENTS.format(*map(_format_exact, body.inertia))
    return _INERTIAL.format(mass=_format_exact(body.mass or 0.0), moments=moments)


def _format_solid(number: int, shape: Shape, friction: float) -> str:
    geometry = _GEOMETRY[shape.kind].format(*map(_format_rounded, shape.size))
    pose = "" if shape.pose == Pose() else f"          <pose>{_format_pose(shape.pose)}</pose>\n"
    return _SOLID.format(number=number, pose=pose, geometry=geometry, mu=_format_exact(friction))


def _format_pose(pose: Pose) -> str:
    return " ".join(map(_format_rounded, (*pose.position, *_compute_angles(pose))))


def _compute_angles(pose: Pose) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of the rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    m = pose.rotation.tolist()
    flat = math.hypot(m[0][0], m[1][0])
    pitch = math.atan2(-m[2][0], flat)
    if flat < 1e-6:  # nose straight up or down: roll and yaw turn about the same axis
        return 0.0, pitch, math.atan2(-m[0][1], m[1][1])
    return math.atan2(m[2][1], m[2][2]), pitch, math.atan2(m[1][0], m[0][0])


def _format_rounded(length: float) -> str:
    """Format a length [m] or an angle [rad]."""
    return f"{round(length, 9) + 0.0:.9f}".rstrip("0").rstrip(".")  # + 0.0 avoids -0


def _format_exact(value: float) -> str:
    return f"{value:.9g}"
