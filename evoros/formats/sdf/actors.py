"""Reads the actors of SDF files, and removes or immobilizes vehicles."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import product
from evoros.base.errors import InputError
from evoros.formats import strict_xml as xml
from evoros.formats.sdf.frames import read_pose
from evoros.formats.sdf.reading import Reading
from evoros.geometry.shapes import Pose, Vector

_DRIVES = re.compile(
    r"diff_?-?drive|skid|steer|mecanum|omni|ackermann|planar_?move|velocity[-_]?control|"
    r"multicopter|rotor|motor|thruster|hydrodynamics|lift[-_]?drag|track|trajectory[-_]?follow|"
    r"kobuki|turtlebot|rover|vehicle|drive|model_?push|(?<![a-z])actor|quadrotor|waypoint",
    re.IGNORECASE,
)
_KINDS = ("revolute", "continuous", "prismatic", "screw", "universal", "ball", "gearbox",
          "revolute2", "hinge", "hinge2", "slider", "piston")  # fmt: skip
_FREE_RAD = 100.0  # minimum range [rad] of a joint that turns endlessly, such as a wheel's
_WHEEL = re.compile(r"wheel|tire|tyre|roue|rad_|caster", re.IGNORECASE)
_DOOR = re.compile(r"door|gate|hatch|window|drawer|elevator", re.IGNORECASE)
_UPRIGHT = 0.8  # minimum |cosine| of the angle between a door or steering axis and the vertical
_THIN = 0.25  # maximum ratio of a panel's thickness to its second-smallest side


def settle_vehicles(container: Element, reading: Reading) -> set[str]:
    """Remove or immobilize models that could drive, and fix other joints; return removed names."""
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
            names = ", ".join(xml.quote(joint.get("name", "")) for joint in joints[:3])
            more = f" and {len(joints) - 3} more" if len(joints) > 3 else ""
            problem = (
                f"has joints that are simulated as fixed ({names}{more}), because the parts of a "
                "model cannot move"
            )
            reading.notes.add(model, problem, "joints")
            for joint in joints:
                joint.set("type", "fixed")
    return left_out


def _fix_to_world(world: Element, reading: Reading) -> None:
    models = {model.get("name", "").strip(): model for model in world.findall("model")}
    for joint in world.findall("joint"):
        names = [xml.read_text(xml.require_child(joint, tag)) for tag in ("parent", "child")]
        ends = [models.get(name.split("::")[0]) for name in names]
        for name, model in zip(names, ends, strict=True):
            if model is None and name != "world":
                problem = f"refers to {xml.quote(name)}, which is not in the world"
                raise xml.element_error(joint, problem, "name a link of a model")
        reading.notes.add(joint, "is ignored, because the connected models are fixed")
        for model in ends:
            if model is not None:
                etree.SubElement(model, "static", {xml.SOURCE: xml.source_of(model)}).text = "true"


def _settle_vehicle(model: Element, reason: str, reading: Reading) -> None:
    if reading.options.vehicles == "leave_out":
        keep = "world.NAME.vehicles=hold_still keeps the vehicle as an obstacle"
        problem = f"is left out, because it is a vehicle ({reason}); {keep}"
        reading.notes.add(model, problem, "vehicle")
        parent = model.getparent()
        assert parent is not None
        parent.remove(model)
        return
    reading.notes.add(model, f"is fixed in place, because it is a vehicle ({reason})", "vehicle")
    etree.SubElement(model, "static", {xml.SOURCE: xml.source_of(model)}).text = "true"


def is_static(model: Element) -> bool:
    """Return True if a model is static; Gazebo appends a second ``<static>``, so use the last."""
    flags = [xml.read_flag(element) for element in model.findall("static")]
    return bool(flags) and flags[-1]


def _why_it_drives(model: Element, joints: list[Element]) -> str:
    for plugin in model.iter("plugin"):
        parent = plugin.getparent()
        name = f"{plugin.get('filename', '')} {plugin.get('name', '')}"
        drives = _DRIVES.search(name) and not _DOOR.search(name)
        if parent is not None and parent.tag == "model" and drives:
            return f"plugin {plugin.get('filename') or plugin.get('name')}"
    wheels = [joint for joint in joints if _turns_freely(joint) and _rolls(joint)]
    if len(wheels) >= 2:
        return (
            f"joints {xml.quote(wheels[0].get('name', ''))} and {len(wheels) - 1} more turn freely"
        )
    return ""


def _movable_joints(model: Element) -> Iterator[Element]:
    for child in model:
        if child.tag == "model" and not is_static(child):
            yield from _movable_joints(child)
        if child.tag == "joint" and child.get("type") != "fixed":
            if child.get("type") not in _KINDS:
                kind = xml.quote(child.get("type", ""))
                problem = f"has the unknown type {kind}"
                raise xml.element_error(child, problem, 'write type="fixed", or the intended type')
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


def _rolls(joint: Element) -> bool:
    """Return True if a joint turns a wheel: its axis is horizontal, and it carries no panel.

    Doors turn about a vertical axis; a horizontal hinge carries a thin box next to its axis.
    """
    owner, child = joint.getparent(), (joint.findtext("child") or "").strip()
    links = [] if owner is None else owner.findall("link")
    named = {link.get("name", "").strip(): link for link in links}
    link, words = named.get(child), f"{child} {joint.get('name', '')}"
    if not _WHEEL.search(words) and (_DOOR.search(words) or _is_panel(link)):
        return False
    xyz = joint.find("axis/xyz")
    axis = (
        (0.0, 0.0, 1.0) if xyz is None or not (xyz.text or "").strip() else xml.read_numbers(xyz, 3)
    )
    frame = "" if xyz is None else xyz.get("expressed_in", "")
    of_model = joint.find("axis/use_parent_model_frame")
    if frame == "__model__" or (of_model is not None and xml.read_flag(of_model)):
        heights = [axis[2]]
    elif frame:
        heights = [_height_of(axis, named.get(frame))]
    else:  # axes are in the model frame up to SDF 1.4, and in the joint frame since
        heights = [axis[2], _height_of(axis, link, joint)]
    return min(map(abs, heights)) <= _UPRIGHT * math.hypot(*axis)


def _height_of(axis: tuple[float, ...], *frames: Element | None) -> float:
    """Return the vertical component of an axis given in the last of nested frames."""
    pose = Pose()
    for element in frames:
        placed = None if element is None else element.find("pose")
        pose = pose if placed is None else pose @ xml.parse_pose(placed)
    return float(product(pose.rotation, np.array(axis))[2])


def _is_panel(link: Element | None) -> bool:
    """Return True if any collision of a link is a thin box; further collisions may be handles."""
    sizes = [] if link is None else link.iterfind("collision/geometry/box/size")
    lengths = (sorted(xml.read_positive(size, 3)) for size in sizes)
    return any(thin < _THIN * middle for thin, middle, _ in lengths)


def _range(limit: Element) -> float:
    """Return the range [rad] of a joint; infinite if a bound is missing."""
    low, high = (limit.find(tag) for tag in ("lower", "upper"))
    try:
        lower = -math.inf if low is None else xml.read_meaning(low, "limit/lower")
        upper = math.inf if high is None else xml.read_meaning(high, "limit/upper")
    except InputError:
        return math.inf
    return upper - lower


RADIUS_M, HEIGHT_M = 0.25, 1.7  # size assumed for every actor, because skins are not read
Point = tuple[float, float, float]  # x, y [m] and time [s]


@dataclass(frozen=True)
class Actor:
    """An upright cylinder that walks between waypoints at the times of a script."""

    name: str
    points: tuple[Point, ...]
    delay_s: float = 0.0  # pause [s] before each round
    loops: bool = True
    radius_m: float = RADIUS_M
    height_m: float = HEIGHT_M


def read_actors(container: Element, reading: Reading) -> tuple[Actor, ...]:
    """Read the actors of a world, or leave them out if the options require it."""
    actors: list[Actor] = []
    for element in container.findall("actor"):
        if reading.options.actors == "leave_out":
            reading.notes.add(
                element, "is left out; world.NAME.actors=walk keeps the actor", "actor"
            )
        else:
            actors.append(_read_actor(element, {actor.name for actor in actors}, reading))
    return tuple(actors)


def _read_actor(element: Element, taken: set[str], reading: Reading) -> Actor:
    name = unique = re.sub(r"[^A-Za-z0-9_-]", "_", xml.read_name(element))
    number = 1
    while unique in taken:
        unique, number = f"{name}_{number}", number + 1
    script = xml.find_child(element, "script")
    points = [] if script is None else list(_read_points(script))
    starts = script is None or _read_flag(script, "auto_start")
    if len(points) < 2 or not starts:
        x, y, _ = points[0] if points else read_pose(element).pose.position
        problem = (
            "stands still, because the actor has fewer than two waypoints, or <auto_start> is false"
        )
        reading.notes.add(element, problem, "actor that stands")
        return Actor(unique, ((x, y, 0.0),))
    assert script is not None
    (delay,) = xml.read_child_numbers(script, "delay_start", (0.0,))
    size = f"{2 * RADIUS_M:g} m wide and {HEIGHT_M:g} m high"
    problem = f"walks as a cylinder {size}, straight from waypoint to waypoint"
    reading.notes.add(element, problem, "actor that walks")
    return Actor(unique, tuple(points), max(delay, 0.0), _read_flag(script, "loop"))


def _read_flag(script: Element, tag: str) -> bool:
    child = xml.find_child(script, tag)
    return True if child is None else xml.read_flag(child)


def _read_points(script: Element) -> Iterator[Point]:
    """Yield waypoints in order of time; of several at the same time, only the last.

    Gazebo also keys them by time (gazebo/physics/Actor.cc, rendering/SceneManager.cc).
    """
    last = -1.0
    for trajectory in script.findall("trajectory"):
        places: dict[float, Vector] = {}
        for waypoint in trajectory.findall("waypoint"):
            element = xml.require_child(waypoint, "time")
            time = xml.read_number(element, "a non-negative time [s]", lambda value: value >= 0.0)
            places[time] = xml.parse_pose(xml.require_child(waypoint, "pose")).position
        # times of a later trajectory may start again
        shift = last if min(places, default=math.inf) <= last else 0.0
        for time in sorted(places):
            if time + shift > last:
                last = time + shift
                yield *places[time][:2], last
