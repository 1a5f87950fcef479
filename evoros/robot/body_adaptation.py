"""Rewrites a robot's body: the ground under it, joints beside the drive, what it collides with."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np
from lxml.etree import SubElement
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.drive.candidates import ALIGNED, CASTER
from evoros.drive.rolling import Wheel, shape_points
from evoros.drive.wheels import LEFT, TOLERANCE_M, TOLERATED_M
from evoros.formats.urdf.elements import add_fixed_joint, build_collision, fix_joint
from evoros.formats.urdf.parts import Joint, read_value
from evoros.formats.urdf.solids import SolidsReader, simplify
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.shapes import Pose, Shape

GROUND_LINK = "evoros_ground"
"""The root link of a robot whose own root is not on the ground between its wheels."""

_MIN_CLEARANCE_M = 0.02  # of a hull that stands in for collision shapes
_MIN_SHARE = 0.4  # of the space between the wheels, that the body's shapes cover


def hold_joints(elements: Element, urdf: Urdf, driven: Collection[str]) -> list[str]:
    """Make every joint fixed that is not part of the drive."""
    held = [n for n, j in urdf.joints.items() if j.type != "fixed" and n not in driven]
    excluded = []
    for joint in elements.findall("joint"):
        if joint.get("name") in held:
            excluded += _exclude_zero(joint, urdf.joints[str(joint.get("name"))])
            fix_joint(joint)
    notes = [f"{len(held)} joints beside the drive are held at zero: {', '.join(held)}"]
    if excluded:
        notes.append(f"joints held at zero are never there: {', '.join(excluded)}")
    return notes if held else []


def _exclude_zero(element: Element, joint: Joint) -> list[str]:
    """Return the name of a joint with the reason why its position is not 0; empty if it may be."""
    if not joint.lower <= 0.0 <= joint.upper:
        return [f"{joint.name} (from {joint.lower:g} to {joint.upper:g})"]
    mimic = element.find("mimic")
    offset = 0.0 if mimic is None else read_value(mimic, "offset", "0")
    return [f"{joint.name} (offset {offset:g})"] if offset else []


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


def complete_body(
    elements: Element,
    urdf: Urdf,
    rolling: Collection[str],
    reader: SolidsReader,
    wheels: Sequence[Wheel],
) -> list[str]:
    """Give a body without collision shapes the hull of what it shows.

    The same holds if its shapes cover a small part only of the space between the wheels.
    """
    body = _list_body(urdf, rolling)
    solid = collision_points(urdf, body)
    if len(solid) and not _is_small(solid, wheels):
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
    lack = "only small collision shapes" if len(solid) else "no collision shapes"
    return [f"the body has {lack}, so the hull of its visuals collides"]


def replace_lost_body(
    elements: Element,
    urdf: Urdf,
    rolling: Collection[str],
    reader: SolidsReader,
    wheels: Sequence[Wheel],
) -> list[str]:
    """Give a body whose meshes are missing a box around the wheels, if too little of it is left.

    ``rolling`` are all wheels and casters.
    """
    solid = collision_points(urdf, _list_body(urdf, rolling))
    if not reader.lacks_meshes or (len(solid) and not _is_small(solid, wheels)):
        return []
    points = collision_points(urdf, urdf.poses)
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = max(_MIN_CLEARANCE_M, min(wheel.radius for wheel in wheels) / 2)
    high[2] = max(high[2], low[2] + _MIN_CLEARANCE_M)
    x, y, z = ((low + high) / 2).tolist()
    length, width, height = (high - low).tolist()
    base = next(name for name in urdf.poses if name != GROUND_LINK)
    pose = urdf.poses[base].inverse() @ Pose((x, y, z))
    link = next(link for link in elements.findall("link") if link.get("name") == base)
    link.append(build_collision(Shape("box", (length, width, height), pose)))
    size = f"{length:.2f} x {width:.2f} x {height:.2f} m"
    return [f"meshes of the body are missing, so a box around its wheels stands for it, {size}"]


def _list_body(urdf: Urdf, rolling: Collection[str]) -> list[str]:
    return [name for name in urdf.poses if name not in rolling and not CASTER.search(name)]


def collision_points(urdf: Urdf, links: Iterable[str]) -> Array:
    """Return points (n, 3) [m] of the collision shapes of links, in the root's frame."""
    return _points([(s, urdf.poses[link] @ s.pose) for link in links for s in urdf.shapes[link]])


def _is_small(solid: Array, wheels: Sequence[Wheel]) -> bool:
    """Return whether points (n, 3) cover little of the space between the wheels."""
    centres = np.array([wheel.centre[:2] for wheel in wheels])
    length, width = np.ptp(centres, axis=0)
    length += 2.0 * max(wheel.radius for wheel in wheels)
    x, y = np.ptp(solid[:, :2], axis=0)
    return float(x * y) < _MIN_SHARE * float(length * width)


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
        fixed = [joint for joint in urdf.joints.values() if joint.type == "fixed"]
        near = [name, *(joint.parent for joint in fixed if joint.child == name)]
        near += [joint.child for joint in fixed if joint.parent == name]
        if any(urdf.shapes[other] for other in near) or not _looks_round(urdf, name):
            continue
        shapes = [s for visual in link.findall("visual") for s in reader.read(link, visual)]
        link.extend([build_collision(shape) for shape in shapes])
        changed += [name] if shapes else []
    note = f"links without collision shapes collide with what they show: {', '.join(changed)}"
    return [note] if changed else []


def _looks_round(urdf: Urdf, name: str) -> bool:
    """Return whether a link may be a wheel or a caster: by its name, or turns about the left."""
    above = [joint for joint in urdf.joints.values() if joint.child == name]
    turns = any(
        joint.type == "continuous" and abs(float(urdf.axis_of(joint)[LEFT])) > ALIGNED
        for joint in above
    )
    words = [name, *(joint.name for joint in above)]
    return turns or any("wheel" in word.lower() or CASTER.search(word) for word in words)
