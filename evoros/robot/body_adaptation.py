"""Rewrites a robot's body: the ground under it, its casters and what it collides with."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from lxml.etree import SubElement
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.drive.candidates import CASTER
from evoros.drive.rolling import Wheel, shape_points
from evoros.drive.wheels import CASTER_GAP_M, TOLERANCE_M, TOLERATED_M
from evoros.formats.urdf.elements import (
    add_fixed_joint,
    add_fixed_link,
    build_collision,
    fix_joint,
    set_inertial,
    set_origin,
)
from evoros.formats.urdf.inertias import box_tensor
from evoros.formats.urdf.parts import read_origin, read_shape
from evoros.formats.urdf.solids import SolidsReader, simplify
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import bottom_height
from evoros.geometry.shapes import Pose, Shape

GROUND_LINK = "evoros_ground"
"""The root link of a robot whose own root is not on the ground between its wheels."""

CASTER_MASS_KG = 0.01  # of a caster that is split off, and of an assumed one
_MAX_DEPTH_M = 0.02  # below the wheels, of a shape that is raised
_MIN_CLEARANCE_M = 0.02  # of a hull that stands in for collision shapes
_MIN_EXTENT = 0.25  # of the body's shapes, as a share of the wheels' distance
_ASSUMED_RADIUS_M = 0.01


class Casters(NamedTuple):
    """Links that slide on the ground."""

    links: tuple[str, ...]
    exposed: Mapping[str, str]  # those that are parts of the body, and the links they are from
    notes: tuple[str, ...]


def hold_joints(elements: Element, urdf: Urdf, driven: Collection[str]) -> list[str]:
    """Make every joint fixed that is not part of the drive."""
    held = [n for n, j in urdf.joints.items() if j.type != "fixed" and n not in driven]
    for joint in elements.findall("joint"):
        if joint.get("name") in held:
            fix_joint(joint)
    if not held:
        return []
    return [f"{len(held)} joints beside the drive are held at zero: {', '.join(held)}"]


def place_on_ground(elements: Element, urdf: Urdf, wheels: Sequence[Wheel]) -> list[str]:
    """Put the root on the ground between the wheels, by a new frame unless it is there."""
    ground = min(wheel.bottom for wheel in wheels)
    middle = (max(w.centre[1] for w in wheels) + min(w.centre[1] for w in wheels)) / 2
    down = ground if abs(ground) > TOLERANCE_M else 0.0
    lateral = [wheel.centre[1] - middle for wheel in wheels]
    mirrored = all(min(abs(a + b) for b in lateral) < TOLERATED_M for a in lateral)
    side = float(middle) if abs(float(middle)) > TOLERANCE_M and mirrored else 0.0
    if not down and not side:
        return []
    SubElement(elements, "link", name=GROUND_LINK)
    pose = Pose((0.0, -side, -down))
    add_fixed_joint(elements, f"{GROUND_LINK}_joint", GROUND_LINK, urdf.root, pose)
    where = f"{abs(down):.4g} m {'below' if down < 0.0 else 'above'}"
    hand = "left" if side > 0.0 else "right"
    sideways = f", and {abs(side):.4g} m to the {hand} of it" if side else ""
    return [f"the wheels stand {where} the root link {urdf.root}{sideways}; the ground is there"]


def find_casters(
    elements: Element, urdf: Urdf, rolling: Collection[str], given: Sequence[str]
) -> Casters:
    """Find the parts other than wheels that reach the ground, and make them links of their own.

    Raises:
        InputError: a part reaches far below the ground.
    """
    links = {str(link.get("name")): link for link in elements.findall("link")}
    found, raised, split = list(given), [], {}
    gaps: dict[str, float] = {}
    for name, pose in urdf.poses.items():
        low = [c for c in links[name].findall("collision") if _gap(c, pose) < CASTER_GAP_M]
        if name in rolling or not low:
            continue
        raised += [name for collision in low if _raise(urdf, name, collision, pose)]
        gaps[name] = min(_gap(collision, pose) for collision in low)
        alone = len(low) == len(links[name].findall("collision")) and name != urdf.root
        if name in given:
            continue
        if alone and not urdf.children_of(name):
            found.append(name)
        else:
            split[_split_off(elements, links[name], name, low)] = name
    notes = []
    if len(found) > len(given):
        names = ", ".join(_with_gap(name, gaps[name]) for name in found[len(given) :])
        notes.append(f"casters found, which slide without friction: {names}")
    if split:
        names = ", ".join(_with_gap(name, gaps[name]) for name in split.values())
        notes.append(f"low parts of the body slide without friction: {names}")
    if raised:
        notes.append(f"parts below the ground are raised onto it: {', '.join(raised)}")
    _complete(links, [name for name in found if name in links])
    return Casters((*found, *split), split, tuple(notes))


def _with_gap(name: str, gap: float) -> str:
    return f"{name} ({1e3 * gap:.1f} mm above the ground)" if gap > TOLERANCE_M else name


def _gap(collision: Element, link: Pose) -> float:
    """Return the height [m] of a shape above the ground; ``link`` is the pose of its link."""
    shape = read_shape(collision)
    return bottom_height(shape, link @ shape.pose)


def _raise(urdf: Urdf, name: str, collision: Element, link: Pose) -> bool:
    """Raise a shape that is below the ground; return whether it was."""
    shape = read_shape(collision)
    depth = -bottom_height(shape, link @ shape.pose)
    if depth > _MAX_DEPTH_M:
        problem = f"link {name!r} must not reach {depth:g} m below the lowest point of the wheels"
        raise urdf.error(problem, "correct the <origin> of its <collision> or of its joint")
    if depth <= TOLERANCE_M / 2:
        return False
    up = link.rotation.T @ np.array([0.0, 0.0, depth])
    origin = read_origin(collision)
    x, y, z = (np.array(origin.position) + up).tolist()
    set_origin(collision, Pose((x, y, z), origin.quaternion))
    return True


def _split_off(elements: Element, link: Element, name: str, low: Sequence[Element]) -> str:
    """Move shapes of a link into a new link, which is fixed to it."""
    new = add_fixed_link(elements, f"{name}_caster", name, Pose())
    for collision in low:
        new.append(collision)
    _complete({f"{name}_caster": new}, [f"{name}_caster"])
    return f"{name}_caster"


def _complete(links: dict[str, Element], names: Sequence[str]) -> None:
    """Give casters without a mass a small one."""
    for name in names:
        if links[name].find("inertial") is None:
            shapes = [read_shape(c) for c in links[name].findall("collision")]
            centre = np.mean([shape.pose.position for shape in shapes], axis=0)
            set_inertial(links[name], CASTER_MASS_KG, centre, box_tensor(CASTER_MASS_KG, _SIZE))


_SIZE: Array = np.full(3, 2.0 * _ASSUMED_RADIUS_M)


def complete_body(
    elements: Element, urdf: Urdf, rolling: Collection[str], reader: SolidsReader, span: float
) -> list[str]:
    """Give a body without collision shapes the hull of what it shows.

    The same holds for shapes that are much smaller than ``span`` [m], the distance of the wheels.
    """
    body = [name for name in urdf.poses if name not in rolling]
    solid = _points([(s, urdf.poses[n] @ s.pose) for n in body for s in urdf.shapes[n]])
    if len(solid) and float(np.ptp(solid, axis=0)[:2].max()) > _MIN_EXTENT * span:
        return []
    links = {str(link.get("name")): link for link in elements.findall("link")}
    shown = _points(
        [
            (shape, urdf.poses[name] @ shape.pose)
            for name in body
            for visual in links[name].findall("visual")
            for shape in _read_visual(reader, links[name], visual)
        ]
    )
    if not len(shown) or float(np.ptp(shown, axis=0).min()) <= 0.0:
        return []
    shown[:, 2] = np.maximum(shown[:, 2], _MIN_CLEARANCE_M)
    x, y, z = shown.T.tolist()
    hull = simplify(Shape("convex", (), corners=tuple(zip(x, y, z, strict=True))))
    for name in body if len(solid) else ():
        for collision in links[name].findall("collision"):
            links[name].remove(collision)
    base = next(name for name in urdf.poses if name != GROUND_LINK)
    inverse = urdf.poses[base].inverse()
    links[base].append(build_collision(replace(hull, pose=inverse)))
    lack = "only tiny collision shapes" if len(solid) else "no collision shapes"
    return [f"the body has {lack}, so the hull of its visuals collides"]


def _read_visual(reader: SolidsReader, link: Element, visual: Element) -> tuple[Shape, ...]:
    try:
        return reader.read(link, visual)
    except InputError:  # no robot is refused for its looks
        return ()


def _points(shapes: Sequence[tuple[Shape, Pose]]) -> Array:
    if not shapes:
        return np.zeros((0, 3))
    return np.concatenate([shape_points(shape, pose) for shape, pose in shapes])


def show_as_collisions(elements: Element, urdf: Urdf, reader: SolidsReader) -> list[str]:
    """Let wheels and casters without collision shapes collide with what they show."""
    changed = []
    for link in elements.findall("link"):
        name = str(link.get("name"))
        near = [name, *(j.parent for j in urdf.joints.values() if _fixes(j.type, j.child, name))]
        near += [j.child for j in urdf.children_of(name) if j.type == "fixed"]
        if any(urdf.shapes[other] for other in near) or not _looks_round(urdf, name):
            continue
        shapes = [s for visual in link.findall("visual") for s in reader.read(link, visual)]
        link.extend([build_collision(shape) for shape in shapes])
        changed += [name] if shapes else []
    if not changed:
        return []
    return [f"links without collision shapes collide with what they show: {', '.join(changed)}"]


def _fixes(kind: str, child: str, name: str) -> bool:
    return kind == "fixed" and child == name


def _looks_round(urdf: Urdf, name: str) -> bool:
    """Return whether a link may be a wheel or a caster: it is called so, or turns without end."""
    words = [name, *(j.name for j in urdf.joints.values() if j.child == name)]
    turns = any(j.child == name and j.type == "continuous" for j in urdf.joints.values())
    return turns or any("wheel" in w.lower() or CASTER.search(w) for w in words)


def add_supports(
    elements: Element, urdf: Urdf, axle_x_m: float, casters: Sequence[str], corners: Array
) -> Casters:
    """Hold up a robot on two wheels on each side of the axle on which no caster does.

    ``corners`` (n, 3) [m] are those of its body. Only the side that its weight is on needs one.
    """
    mass, centre = centre_of_mass(elements, urdf)
    places = [
        float(urdf.poses[name].transform(shape.pose.position)[0]) - axle_x_m
        for name in casters
        for shape in urdf.shapes[name]
    ]
    lean = float(centre[0]) - axle_x_m if mass > 0.0 else 0.0
    sides = [
        side
        for side in (1.0, -1.0)
        if not any(place * side > 0.0 for place in places) and (not places or lean * side > 0.0)
    ]
    names = []
    for side in sides:
        reach = max(float((side * (corners[:, 0] - axle_x_m)).max()), 5.0 * _ASSUMED_RADIUS_M)
        name = f"evoros_support_{'front' if side > 0 else 'rear'}"
        x = axle_x_m + 0.9 * side * reach
        root = urdf.poses[urdf.root].inverse() @ Pose((x, 0.0, _ASSUMED_RADIUS_M))
        link = add_fixed_link(elements, name, urdf.root, root)
        link.append(build_collision(Shape("sphere", (_ASSUMED_RADIUS_M,))))
        _complete({name: link}, [name])
        names.append(name)
    if not names:
        return Casters((), {}, ())
    why = "no caster holds it up" if not places else "its weight is not between axle and casters"
    where = " and ".join(name.rpartition("_")[2] for name in names)
    return Casters(tuple(names), {}, (f"{why}, so it slides on an assumed ball at the {where}",))


def centre_of_mass(elements: Element, urdf: Urdf) -> tuple[float, Array]:
    """Return the mass [kg] and the centre of mass (3,) [m] in the robot's frame."""
    total, moment = 0.0, np.zeros(3)
    for link in elements.findall("link"):
        inertial = link.find("inertial")
        mass = None if inertial is None else inertial.find("mass")
        if inertial is not None and mass is not None:
            value = float(mass.get("value", "0"))
            place = urdf.poses[str(link.get("name"))].transform(read_origin(inertial).position)
            total, moment = total + value, moment + value * np.array(place)
    return total, moment / total if total > 0.0 and math.isfinite(total) else moment
