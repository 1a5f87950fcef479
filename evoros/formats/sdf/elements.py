"""Which elements of SDF are used, which cannot matter, which are reported, which are errors."""

import logging
import re

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import fault, local_tag, warn

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

# What the engines here do not have: reported once a file, unless it says nothing (see `_matters`).
_REPORTED = {
    "sdf": "plugin",
    "world": "plugin",
    "link": "velocity_decay",
    "surface": "contact bounce soft_contact",
    "friction": "torsional",
    "ode": "mu2 fdir1 slip1 slip2",
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
        InputError: something is not supported.
    """
    kind = kind or str(element.tag)
    used, ignored, reported = (
        table.get(kind, "").split() for table in (_USED, _IGNORED, _REPORTED)
    )
    for part in element:
        if part.tag in used or part.tag in ignored or part.tag in reported:
            continue
        tag = local_tag(part)
        if part.prefix and part.prefix != "xacro":
            warn(LOG, part, "is left out: it is not part of SDF")
        else:
            cure = "expand the file with xacro first" if part.prefix else _CURES.get(tag)
            cure = cure or (_PRIMITIVES if kind == "geometry" else "delete it")
            raise fault(part, f"is not supported inside <{local_tag(element)}>", cure)


def report(root: Element) -> None:
    """Log what is left out of a document that has been read: the first of each name and line."""
    found: dict[str, list[Element]] = {}
    for owner in root.iter(*_REPORTED):
        for element in owner.iterchildren(*_REPORTED[str(owner.tag)].split()):
            if _matters(element):
                found.setdefault(str(element.tag), []).append(element)
    for first, *others in found.values():
        more = f", as are {len(others)} more" if others else ""
        warn(LOG, first, f"is left out{more}: no engine here has it")


def _matters(element: Element) -> bool:
    """Whether an element says more than zeros and false, or than the coefficient beside it."""
    if element.tag == "plugin":
        return True
    words = " ".join(str(text) for text in element.itertext()).split()
    if element.tag == "mu2":
        beside = element.getparent()
        first = None if beside is None else beside.findtext("mu")
        return [float(word) for word in words] != [float(first or 1)]
    return any(word != "false" and not re.fullmatch(r"[+-]?0*\.?0*", word) for word in words)
