"""Adapts a robot's body: the ground frame, joints outside the drive, and collision shapes."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np
from lxml.etree import SubElement
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.drive.candidates import ALIGNED, CASTER, MAX_LACK, is_called_wheel, measure_link
from evoros.drive.protocol import LEFT, TOLERANCE_M, TOLERATED_M
from evoros.drive.rolling import Wheel, measure_wheel, shape_points
from evoros.formats.notes import list_notes
from evoros.formats.urdf.elements import add_fixed_joint, build_collision, set_collisions
from evoros.formats.urdf.parts import Joint, read_value
from evoros.formats.urdf.solids import SolidsReader, simplify
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.shapes import Pose, Shape

GROUND_LINK = "evoros_ground"  # added root link, on the ground between the wheels
_MIN_CLEARANCE_M = 0.02  # minimum ground clearance of a hull that replaces collision shapes
_MIN_SHARE = 0.4  # minimum fraction of the area between the wheels that the body covers


def hold_joints(elements: Element, urdf: Urdf, driven: Collection[str]) -> list[str]:
    """Fix every joint outside the drive at position zero; return notes for the log."""
    held = [n for n, j in urdf.joints.items() if j.type != "fixed" and n not in driven]
    excluded = []
    for joint in elements.findall("joint"):
        if joint.get("name") in held:
            excluded += _excludes_zero(joint, urdf.joints[str(joint.get("name"))])
            joint.set("type", "fixed")
            for part in [*joint]:
                if part.tag not in ("origin", "parent", "child"):
                    joint.remove(part)
    text = "joints outside the drive are locked at zero"
    return list_notes({text: held, "the limits of these locked joints exclude zero": excluded})


def _excludes_zero(element: Element, joint: Joint) -> list[str]:
    if not joint.lower <= 0.0 <= joint.upper:
        return [f"{joint.name} (from {joint.lower:g} to {joint.upper:g})"]
    mimic = element.find("mimic")
    offset = 0.0 if mimic is None else read_value(mimic, "offset", "0")
    return [f"{joint.name} (offset {offset:g})"] if offset else []


def place_on_ground(elements: Element, urdf: Urdf, wheels: Sequence[Wheel]) -> list[str]:
    """Move the root frame to the ground between the wheels, if necessary with a new root link."""
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
    where = [f"{abs(down):.4g} m {'below' if down < 0.0 else 'above'}"] * bool(down)
    where += [f"{abs(side):.4g} m to the {'left' if side > 0.0 else 'right'} of"] * bool(side)
    place = f"{' and '.join(where)} the root link {urdf.root}"
    return [f"the wheels touch the ground {place}; the robot's frame is moved there"]


def complete_body(
    elements: Element,
    urdf: Urdf,
    rolling: Collection[str],
    reader: SolidsReader,
    wheels: Sequence[Wheel],
) -> list[str]:
    """Use the hull of the visuals if the body's collision shapes are missing or too small."""
    body = _list_body(urdf, rolling)
    solid = collision_points(urdf, body)
    if len(solid) and not _is_small(solid, wheels):
        return []
    links = {str(link.get("name")): link for link in elements.findall("link")}
    faults: list[InputError] = []
    visuals = {name: _read_visuals(reader, links[name], faults) for name in body}
    shown = _points([(s, urdf.poses[name] @ s.pose) for name in body for s in visuals[name]])
    if not len(shown) or float(np.ptp(shown, axis=0).min()) <= 0.0:
        if faults and not len(solid):
            raise faults[0]
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
    return [f"the body has {lack}, so the hull of its visuals is used"]


def replace_lost_body(
    elements: Element,
    urdf: Urdf,
    rolling: Collection[str],
    reader: SolidsReader,
    wheels: Sequence[Wheel],
) -> list[str]:
    """Add a box around the wheels if missing meshes leave too little of the body."""
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
    return [f"the body's meshes are missing; a {size} box around the wheels replaces them"]


def _list_body(urdf: Urdf, rolling: Collection[str]) -> list[str]:
    def is_wheel(name: str) -> bool:
        wheel = measure_link(urdf, name) if "wheel" in name.lower() else None
        return wheel is not None and wheel.roundness < MAX_LACK

    free = [name for name in urdf.poses if name not in rolling and not CASTER.search(name)]
    return [name for name in free if not is_wheel(name)]


def collision_points(urdf: Urdf, links: Iterable[str]) -> Array:
    """Return points (n, 3) [m] of the links' collision shapes, in the root's frame."""
    return _points([(s, urdf.poses[link] @ s.pose) for link in links for s in urdf.shapes[link]])


def _is_small(solid: Array, wheels: Sequence[Wheel]) -> bool:
    centres = np.array([wheel.centre[:2] for wheel in wheels])
    length, width = np.ptp(centres, axis=0)
    length += 2.0 * max(wheel.radius for wheel in wheels)
    x, y = np.ptp(solid[:, :2], axis=0)
    return float(x * y) < _MIN_SHARE * float(length * width)


def _read_visuals(reader: SolidsReader, link: Element, faults: list[InputError]) -> list[Shape]:
    shapes: list[Shape] = []
    for visual in link.findall("visual"):
        try:
            shapes += reader.read(link, visual)
        except InputError as error:
            faults.append(error)
    return shapes


def _points(shapes: Sequence[tuple[Shape, Pose]]) -> Array:
    if not shapes:
        return np.zeros((0, 3))
    return np.concatenate([shape_points(shape, pose) for shape, pose in shapes])


def show_as_collisions(elements: Element, urdf: Urdf, reader: SolidsReader) -> list[str]:
    """Use visual shapes of wheels and casters where collision shapes are missing or not round."""
    changed, squared = [], []
    for link in elements.findall("link"):
        name = str(link.get("name"))
        fixed = [joint for joint in urdf.joints.values() if joint.type == "fixed"]
        if not _looks_round(urdf, name):
            continue
        above = [joint.parent for joint in fixed if joint.child == name]
        near = [name, *(link for link in above if _looks_round(urdf, link))]
        near += [joint.child for joint in fixed if joint.parent == name]
        is_square = _is_wheel(urdf, name) and _lacks_roundness(urdf, name, urdf.shapes[name])
        if any(urdf.shapes[other] for other in near) and not is_square:
            continue
        faults: list[InputError] = []
        shapes = _read_visuals(reader, link, faults)
        if is_square:
            if shapes and not _lacks_roundness(urdf, name, shapes):
                set_collisions(link, shapes)
                squared.append(name)
            continue
        if faults and _rolls(urdf, name):
            raise faults[0]
        link.extend([build_collision(shape) for shape in shapes])
        changed += [name] if shapes else []
    notes = {
        "links without collision shapes use their visuals instead": changed,
        "wheels with angular collision shapes use their round visuals instead": squared,
    }
    return list_notes(notes)


def _is_wheel(urdf: Urdf, name: str) -> bool:
    joints = (joint for joint in urdf.joints.values() if joint.child == name)
    return _rolls(urdf, name) and any(map(is_called_wheel, joints))


def _lacks_roundness(urdf: Urdf, name: str, shapes: Sequence[Shape]) -> bool:
    """Return True if no shape of a link is round about the robot's lateral axis."""
    left = urdf.poses[name].rotation.T[:, LEFT]
    placed = [(shape, shape.pose) for shape in shapes]
    return bool(placed) and measure_wheel(placed, left).roundness >= MAX_LACK


def _looks_round(urdf: Urdf, name: str) -> bool:
    joints = [joint for joint in urdf.joints.values() if joint.child == name]
    words = [name, *(joint.name for joint in joints)]
    named = any("wheel" in word.lower() or CASTER.search(word) for word in words)
    turns = any(joint.type == "continuous" for joint in joints)
    return named or _rolls(urdf, name) or (turns and _shows_roller(urdf, name))


def _shows_roller(urdf: Urdf, name: str) -> bool:
    shown = urdf.visuals[name]
    if len(shown) != 1 or shown[0].kind != "cylinder":
        return False
    return bool(abs((urdf.poses[name] @ shown[0].pose).rotation[LEFT, 2]) > ALIGNED)


def _rolls(urdf: Urdf, name: str) -> bool:
    return any(
        joint.type == "continuous" and abs(float(urdf.axis_of(joint)[LEFT])) > ALIGNED
        for joint in urdf.joints.values()
        if joint.child == name
    )
