"""Models of a world that have joints or a drive: vehicles, and furniture with hinges."""

import math
import re
from collections.abc import Iterator

from lxml import etree
from lxml.etree import _Element as Element

from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import (
    SOURCE,
    element_error,
    quote,
    read_flag,
    read_text,
    require_child,
    source_of,
)

_DRIVES = re.compile(
    r"diff_?-?drive|skid|steer|mecanum|omni|ackermann|planar_?move|velocity[-_]?control|"
    r"multicopter|rotor|motor|thruster|hydrodynamics|lift[-_]?drag|track|trajectory[-_]?follow|"
    r"kobuki|turtlebot|rover|vehicle|drive|model_?push|(?<![a-z])actor|quadrotor|waypoint",
    re.IGNORECASE,
)
_KINDS = ("revolute", "continuous", "prismatic", "screw", "universal", "ball", "gearbox",
          "revolute2", "hinge", "hinge2", "slider", "piston")  # fmt: skip
_FREE_RAD = 100.0  # a joint that may turn so far turns without end, as wheels do


def settle_vehicles(container: Element, reading: Reading) -> set[str]:
    """Leave out or hold still every model that would drive, and fix the joints of all others.

    Returns:
        The names of the models that are left out.
    """
    left_out: set[str] = set()
    if container.tag == "world":
        _fix_to_world(container, reading)
    for model in container.findall("model"):
        if is_static(model):
            continue
        joints = list(_movable_joints(model))
        reason = _why_it_drives(model, joints)
        if reason:
            _settle_vehicle(model, reason, reading)
            if model.getparent() is None:
                left_out.add(model.get("name", "").strip())
        elif joints:
            names = ", ".join(quote(joint.get("name", "")) for joint in joints[:3])
            more = f" and {len(joints) - 3} more" if len(joints) > 3 else ""
            problem = f"is held still at its joints {names}{more}: its parts cannot move here"
            reading.notes.add(model, problem, "joints")
            for joint in joints:
                joint.set("type", "fixed")
    return left_out


def _fix_to_world(world: Element, reading: Reading) -> None:
    """Fix the models that joints of the world itself connect: none of them moves any more."""
    models = {model.get("name", "").strip(): model for model in world.findall("model")}
    for joint in world.findall("joint"):
        names = [read_text(require_child(joint, tag)) for tag in ("parent", "child")]
        ends = [models.get(name.split("::")[0]) for name in names]
        for name, model in zip(names, ends, strict=True):
            if model is None and name != "world":
                problem = f"refers to {quote(name)}, which is not in the world"
                raise element_error(joint, problem, "name a link of a model")
        reading.notes.add(joint, "is held still: the models that it connects are fixed")
        for model in ends:
            if model is not None:
                etree.SubElement(model, "static", {SOURCE: source_of(model)}).text = "true"


def _settle_vehicle(model: Element, reason: str, reading: Reading) -> None:
    if reading.options.vehicles == "leave_out":
        problem = f"is left out: it drives ({reason}); vehicles=hold_still keeps it as an obstacle"
        reading.notes.add(model, problem, "vehicle")
        parent = model.getparent()
        assert parent is not None
        parent.remove(model)
        return
    reading.notes.add(model, f"is held still: it drives ({reason})", "vehicle")
    etree.SubElement(model, "static", {SOURCE: source_of(model)}).text = "true"


def is_static(model: Element) -> bool:
    """Whether a model is static; Gazebo adds a second ``<static>``, so the last one counts."""
    flags = [read_flag(element) for element in model.findall("static")]
    return bool(flags) and flags[-1]


def _why_it_drives(model: Element, joints: list[Element]) -> str:
    """Return what makes a model a vehicle: its plugin or its wheels; empty if nothing does."""
    for plugin in model.iter("plugin"):
        parent = plugin.getparent()
        name = f"{plugin.get('filename', '')} {plugin.get('name', '')}"
        if parent is not None and parent.tag == "model" and _DRIVES.search(name):
            return f"plugin {plugin.get('filename') or plugin.get('name')}"
    wheels = [joint for joint in joints if _turns_freely(joint)]
    if len(wheels) >= 2:
        return f"joints {quote(wheels[0].get('name', ''))} and {len(wheels) - 1} more turn freely"
    return ""


def _movable_joints(model: Element) -> Iterator[Element]:
    """Yield the joints of a model and of the models in it that let their parts move."""
    for child in model:
        if child.tag == "model" and not is_static(child):
            yield from _movable_joints(child)
        if child.tag == "joint" and child.get("type") != "fixed":
            if child.get("type") not in _KINDS:
                kind = quote(child.get("type", ""))
                problem = f"has type {kind}, which SDF does not know"
                raise element_error(child, problem, 'write type="fixed", or the type that is meant')
            yield child


def _turns_freely(joint: Element) -> bool:
    if joint.get("type") == "continuous":
        return True
    if joint.get("type") not in ("revolute", "revolute2", "hinge", "hinge2"):
        return False
    ends = [joint.findtext(tag) for tag in ("parent", "child")]
    if any((end or "").strip() == "world" for end in ends):
        return False
    limits = joint.findall("axis/limit") + joint.findall("axis2/limit")
    return not limits or any(_range(limit) > _FREE_RAD for limit in limits)


def _range(limit: Element) -> float:
    try:
        low, high = (float(limit.findtext(tag) or math.inf) for tag in ("lower", "upper"))
    except ValueError:
        return math.inf
    return high if math.isinf(high) else high - low
