"""Which elements of SDF are used, which cannot matter, which are reported, which are errors."""

import logging
import re

from lxml.etree import _Element as Element

from evoros.xmlfile import fault, local_tag, warn

LOG = logging.getLogger("evoros.sdf")

# Of physics, only gravity is looked at: the rest is how Gazebo computes.
_USED = {
    "sdf": "world model",
    "world": "model frame state gravity physics",
    "model": "static pose frame link joint model",
    "frame": "pose",
    "joint": "pose parent child",
    "link": "pose inertial collision gravity kinematic",
    "collision": "pose geometry surface",
    "inertial": "pose mass inertia",
    "inertia": "ixx iyy izz ixy ixz iyz",
    "geometry": "box cylinder sphere plane empty",
    "box": "size",
    "cylinder": "radius length",
    "sphere": "radius",
    "plane": "normal size",
    "surface": "friction",
    "friction": "ode bullet",
    "ode": "mu mu2",
    "bullet": "friction",
    "state": "model",
    "state/model": "pose scale link model",
    "state/link": "pose",
}

# What neither stands in the way of a robot nor moves anything.
_IGNORED = {
    "sdf": "light",
    "world": "light scene gui audio wind atmosphere magnetic_field spherical_coordinates",
    "model": "self_collide allow_auto_disable enable_wind",
    "link": "visual light sensor projector audio_sink audio_source battery particle_emitter "
    "self_collide enable_wind must_be_base_link",
    "joint": "axis axis2 physics sensor gearbox_ratio gearbox_reference_body thread_pitch "
    "screw_thread_pitch",
    "collision": "laser_retro max_contacts density auto_inertia_params",
    "inertial": "density auto_inertia_params",
    "state": "sim_time wall_time real_time iterations light",
    "state/model": "joint frame",
    "state/link": "velocity acceleration wrench collision",
}

# What the engines here do not have: reported, unless it says no more than 0 or false.
_REPORTED = {
    "sdf": "plugin",
    "world": "plugin",
    "link": "velocity_decay",
    "surface": "contact bounce soft_contact",
    "friction": "torsional",
    "ode": "fdir1 slip1 slip2",
    "bullet": "friction2 fdir1 rolling_friction",
}

_CURES = {
    "include": "write the included model itself into this file; a sun and level ground need none",
    "mesh": "approximate it by boxes, cylinders and spheres",
    "capsule": "approximate it by a cylinder and two spheres",
    "plugin": "delete it: only worlds may have plugins, models must not move by themselves",
}
_PRIMITIVES = "use boxes, cylinders, spheres and planes"


def check_children(element: Element, kind: str = "") -> None:
    """Go through what stands in an element; ``kind`` is its key in the tables, if not its tag.

    Raises:
        InputError: something is not supported; what has little effect is reported instead.
    """
    kind = kind or str(element.tag)
    used, ignored, reported = (
        table.get(kind, "").split() for table in (_USED, _IGNORED, _REPORTED)
    )
    for part in element:
        if part.tag in used or part.tag in ignored:
            continue
        tag = local_tag(part)
        if part.tag in reported:
            if _says_something(part):
                warn(LOG, part, "is left out: no engine here has it")
        elif part.prefix and part.prefix != "xacro":
            warn(LOG, part, "is left out: it is not part of SDF")
        else:
            cure = "expand the file with xacro first" if part.prefix else _CURES.get(tag)
            cure = cure or (_PRIMITIVES if kind == "geometry" else "delete it")
            raise fault(part, f"is not supported inside <{local_tag(element)}>", cure)


def _says_something(element: Element) -> bool:
    """Whether an element holds anything but zeros and false; a plugin always does."""
    words = " ".join(str(text) for text in element.itertext()).split()
    return element.tag == "plugin" or any(
        word != "false" and not re.fullmatch(r"[+-]?0*\.?0*", word) for word in words
    )
