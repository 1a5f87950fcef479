"""Which elements of SDF are used, which are ignored, which are reported, and which are errors."""

import logging
import re

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import element_error, local_tag, warn

LOG = logging.getLogger("evoros.sdf")

# Of <physics>, only gravity is checked: the rest configures Gazebo's solver.
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

# Elements that neither block a robot nor move anything.
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

# Elements that no simulator here supports: each is reported once a file, unless it has no effect.
_REPORTED = {
    "sdf": "plugin",
    "world": "plugin",
    "link": "velocity_decay",
    "surface": "contact bounce soft_contact",
    "friction": "torsional",
    "ode": "mu2 fdir1 slip1 slip2",
    "bullet": "friction2 fdir1 rolling_friction",
}

_FIXES = {
    "include": "write the included model itself into this file; a sun and level ground need none",
    "mesh": "approximate it by boxes, cylinders and spheres",
    "capsule": "approximate it by a cylinder and two spheres",
    "plugin": "delete it: only worlds may have plugins, models must not move by themselves",
}
_PRIMITIVES = "use boxes, cylinders, spheres and planes"


def check_children(element: Element, kind: str = "") -> None:
    """Check that every child of an element is supported, and warn about those of other namespaces.

    ``kind`` is the key of the element in the tables, if it is not its tag.

    Raises:
        InputError: a child is not supported.
    """
    kind = kind or str(element.tag)
    known = {tag for table in (_USED, _IGNORED, _REPORTED) for tag in table.get(kind, "").split()}
    for child in element:
        if child.tag in known:
            continue
        if child.prefix and child.prefix != "xacro":
            warn(LOG, child, "is ignored: it is not part of SDF")
        else:
            problem = f"is not supported inside <{local_tag(element)}>"
            raise element_error(child, problem, _fix(child, kind))


def _fix(element: Element, kind: str) -> str:
    if element.prefix:
        return "expand the file with xacro first"
    default = _PRIMITIVES if kind == "geometry" else "delete it"
    return _FIXES.get(local_tag(element), default)


def report_ignored(root: Element) -> None:
    """Warn about elements without support in a document: the first of each name, and how many."""
    by_tag: dict[str, list[Element]] = {}
    for parent in root.iter(*_REPORTED):
        for element in parent.iterchildren(*_REPORTED[str(parent.tag)].split()):
            if _has_effect(element):
                by_tag.setdefault(str(element.tag), []).append(element)
    for first, *others in by_tag.values():
        more = f", as are {len(others)} more" if others else ""
        warn(LOG, first, f"is ignored{more}: no simulator here supports it")


def _has_effect(element: Element) -> bool:
    """Return whether an element holds more than zeros and false, or a mu2 that differs from mu."""
    if element.tag == "plugin":
        return True
    words = " ".join(str(text) for text in element.itertext()).split()
    if element.tag == "mu2":
        parent = element.getparent()
        mu = None if parent is None else parent.findtext("mu")
        return [float(word) for word in words] != [float(mu or 1)]
    return any(word != "false" and not re.fullmatch(r"[+-]?0*\.?0*", word) for word in words)
