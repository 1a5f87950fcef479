"""The elements of SDF that are used, ignored, reported or rejected."""

import re

from lxml.etree import _Element as Element

from evoros.formats.notes import Notes, note_degrees
from evoros.formats.strict_xml import element_error, local_tag, parse_number

# Only <gravity> of <physics> is used; other children configure Gazebo's solver.
_USED = {
    "sdf": "world model",
    "world": "model frame state gravity physics include joint actor",
    "physics": "gravity",
    "model": "static pose frame link joint model include",
    "frame": "pose",
    "joint": "pose parent child axis",
    "link": "pose inertial collision gravity kinematic",
    "collision": "pose geometry surface density",
    "inertial": "pose mass inertia density",
    "inertia": "ixx iyy izz ixy ixz iyz",
    "geometry": "box cylinder sphere plane empty capsule ellipsoid cone polyline mesh heightmap "
    "image",
    "box": "size",
    "cylinder": "radius length",
    "sphere": "radius",
    "plane": "normal size",
    "capsule": "radius length",
    "ellipsoid": "radii",
    "cone": "radius length",
    "polyline": "point height",
    "mesh": "uri filename scale submesh",
    "heightmap": "uri filename size pos",
    "surface": "friction",
    "friction": "ode bullet",
    "ode": "mu mu2",
    "bullet": "friction",
    "state": "model",
    "state/model": "pose scale link model",
    "state/link": "pose",
}

# Elements that neither block robots nor move anything; children of <physics> are skipped.
_IGNORED = {
    "sdf": "light",
    "world": "light scene gui audio wind atmosphere magnetic_field spherical_coordinates",
    "model": "self_collide allow_auto_disable enable_wind plugin gripper allow_auto_disable origin",
    "link": "visual light sensor projector audio_sink audio_source battery particle_emitter "
    "self_collide enable_wind must_be_base_link",
    "joint": "physics sensor axis2 gearbox_ratio gearbox_reference_body thread_pitch "
    "screw_thread_pitch",
    "collision": "laser_retro max_contacts auto_inertia_params",
    "inertial": "auto_inertia_params",
    "heightmap": "texture blend use_terrain_paging sampling",
    "state": "sim_time wall_time real_time iterations light",
    "state/model": "joint frame",
    "state/link": "velocity acceleration wrench collision",
}

# Unsupported elements, reported if they have an effect.
_REPORTED = {
    "link": "velocity_decay",
    "surface": "contact bounce soft_contact",
    "friction": "torsional",
    "ode": "mu2 fdir1 slip1 slip2",
    "bullet": "friction2 fdir1 rolling_friction",
}

_LEFT_OUT = {
    "population": "is left out: to keep the models, write them into the file",
    "road": "is left out: robots neither touch nor see paint",
}

# Plugins that move nothing: they configure Gazebo, publish, or feed sensors.
_HARMLESS = re.compile(
    r"sensor|camera|imu|laser|lidar|ray|gps|navsat|magnet|altimeter|physics|user[-_]?commands|"
    r"scene|broadcast|contact|ros_(init|factory|state|clock|api|link_attacher|p3d)|gui|"
    r"publish|logical|air[-_]?(pressure|speed)|particle|lights?|label|thermal|environment|"
    r"performance|model_?state|spherical|sky|shadow|visual|material|markers?|video|log|"
    r"breadcrumb|"
    r"entity|export|world_?control|stats|ground_?truth|battery|collision",
    re.IGNORECASE,
)


def check_elements(root: Element, notes: Notes) -> None:
    """Note each ignored element or plugin of a document that may matter."""
    _check(root, "sdf", notes)
    note_degrees(root, notes)
    _note_plugins(root, notes)


def _check(element: Element, kind: str, notes: Notes) -> None:
    used, ignored, reported = (
        table.get(kind, "").split() for table in (_USED, _IGNORED, _REPORTED)
    )
    for child in element:
        tag = str(child.tag)
        if child.prefix == "xacro":
            problem = f"is not supported inside <{local_tag(element)}>"
            raise element_error(child, problem, "expand the file with xacro first")
        inner = f"{kind.split('/')[0]}/{tag}" if kind.startswith("state") else tag
        if tag in used and inner in _USED:
            _check(child, inner, notes)
        if tag in reported and _has_effect(child):
            notes.add(child, "is ignored: evoros does not support it", f"reported {tag}")
        elif kind == "world" and tag in _LEFT_OUT:
            notes.add(child, _LEFT_OUT[tag], f"left out {tag}")
        elif tag not in (*used, *ignored, *reported, "plugin") and kind != "physics":
            problem = f"is ignored: it is not part of <{local_tag(element)}> in SDF"
            notes.add(child, problem, f"unknown {kind} {tag}")


def _note_plugins(root: Element, notes: Notes) -> None:
    harmless: dict[str, Element] = {}
    for plugin in root.iter("plugin"):
        parent = plugin.getparent()
        if parent is None or parent.tag not in ("world", "model", "sdf"):
            continue  # plugins of sensors, visuals and the window
        name = plugin.get("filename", "").strip() or plugin.get("name", "").strip() or "(no name)"
        if _HARMLESS.search(f"{name} {plugin.get('name', '')}"):
            harmless.setdefault(name, plugin)
        else:
            problem = f"{name} is ignored: evoros runs no plugins, so the model does not move"
            notes.add(plugin, problem, "plugin that moves", name)
    if harmless:
        names = ", ".join(harmless)
        first = next(iter(harmless.values()))
        notes.add(first, f"is ignored, like all plugins that move nothing: {names}")


def _has_effect(element: Element) -> bool:
    """Return False if an element holds only zeros and false, or is a mu2 equal to mu."""
    words = " ".join(str(text) for text in element.itertext()).split()
    if element.tag == "mu2":
        parent = element.getparent()
        mu = ((None if parent is None else parent.findtext("mu")) or "1").split()
        return words != mu and [*map(parse_number, words)] != [*map(parse_number, mu)]
    return any(word != "false" and not re.fullmatch(r"[+-]?(0x)?0*\.?0*", word) for word in words)
