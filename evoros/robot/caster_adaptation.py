"""Finds the parts on which a robot slides, and adds missing masses and supports."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array, product
from evoros.drive.protocol import CASTER_GAP_M, TOLERANCE_M
from evoros.drive.rolling import Wheel, shape_points
from evoros.formats.notes import list_notes
from evoros.formats.urdf.elements import (
    add_fixed_link,
    box_tensor,
    build_collision,
    set_inertial,
    set_origin,
)
from evoros.formats.urdf.parts import read_origin, read_shape
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import Footprint, bottom_height, contains, convex_hull
from evoros.geometry.shapes import Pose, Shape

CASTER_MASS_KG = 0.01  # mass [kg] of a caster that is split off or added
CLEARANCE_M = 0.02  # height [m] above ground at which a shape is cut to split off a sliding part
_MAX_DEPTH_M = 0.02  # maximum depth [m] below the ground at which a shape is raised instead of cut
_ASSUMED_RADIUS_M = 0.01
_SHORT_M = 1e-3, 0.1  # range of gaps [m] below a caster that is too short; more is no caster


class Casters(NamedTuple):
    """Links that slide on the ground."""

    links: tuple[str, ...]
    exposed: Mapping[str, str]  # original link of each split-off part, keyed by the new link
    notes: tuple[str, ...]


def find_casters(
    elements: Element, urdf: Urdf, rolling: Collection[str], given: Sequence[str]
) -> Casters:
    """Find all parts except wheels that touch the ground, and make them separate links."""
    links = {str(link.get("name")): link for link in elements.findall("link")}
    casters, raised, split = list(given), [], {}
    gaps: dict[str, float] = {}
    cut = [n for n, p in urdf.poses.items() if n not in rolling and _cut_off(links[n], p)]
    for name, pose in urdf.poses.items():
        low = [c for c in links[name].findall("collision") if _gap(c, pose) < CASTER_GAP_M]
        if name in rolling or not low:
            continue
        raised += [name for collision in low if _raise(collision, pose)]
        gaps[name] = min(_gap(collision, pose) for collision in low)
        alone = len(low) == len(links[name].findall("collision")) and name != urdf.root
        if name in given:
            continue
        if alone and not urdf.children_of(name):
            casters.append(name)
        else:
            split[_split_off(elements, name, low)] = name
    for name in casters:
        if name in links:
            _complete(links[name])
    heights = {
        name: f"{name} ({1e3 * gap:.1f} mm above the ground)" if gap > TOLERANCE_M else name
        for name, gap in gaps.items()
    }
    found, low_parts = casters[len(given) :], split.values()
    notes = {
        "links found as casters slide without friction": [heights[name] for name in found],
        "low parts of the body slide without friction": [heights[name] for name in low_parts],
        "parts below the ground are raised to its surface": raised,
        "parts far below the ground are cut off just above it": cut,
    }
    return Casters((*casters, *split), split, tuple(list_notes(notes)))


def _gap(collision: Element, link: Pose) -> float:
    """Return the height [m] of a collision shape above the ground; ``link`` is the link's pose."""
    shape = read_shape(collision)
    return bottom_height(shape, link @ shape.pose)


def _raise(collision: Element, link: Pose) -> bool:
    depth = -_gap(collision, link)
    if depth <= TOLERANCE_M / 2:
        return False
    up = product(link.rotation.T, np.array([0.0, 0.0, depth]))
    origin = read_origin(collision)
    x, y, z = (np.array(origin.position) + up).tolist()
    set_origin(collision, Pose((x, y, z), origin.quaternion))
    return True


def _cut_off(link: Element, pose: Pose) -> bool:
    deep = [c for c in link.findall("collision") if _gap(c, pose) < -_MAX_DEPTH_M]
    for collision in deep:
        shape = read_shape(collision)
        points = shape_points(shape, pose @ shape.pose)
        link.remove(collision)
        if float(points[:, 2].max()) > 2.0 * CLEARANCE_M:
            points[:, 2] = np.maximum(points[:, 2], CLEARANCE_M)
            x, y, z = points.T.tolist()
            corners = tuple(zip(x, y, z, strict=True))
            link.append(build_collision(Shape("convex", (), pose.inverse(), corners=corners)))
    return bool(deep)


def _split_off(elements: Element, name: str, low: Sequence[Element]) -> str:
    new = add_fixed_link(elements, f"{name}_caster", name, Pose())
    new.extend(low)
    _complete(new)
    return f"{name}_caster"


def _complete(link: Element) -> None:
    if link.find("inertial") is None:
        shapes = [read_shape(c) for c in link.findall("collision")]
        centre = np.mean([shape.pose.position for shape in shapes], axis=0)
        set_inertial(link, CASTER_MASS_KG, centre, box_tensor(CASTER_MASS_KG, _SIZE))


_SIZE: Array = np.full(3, 2.0 * _ASSUMED_RADIUS_M)


def add_supports(
    elements: Element, urdf: Urdf, wheels: Sequence[Wheel], casters: Sequence[str], corners: Array
) -> Casters:
    """Add balls on which a two-wheeled robot slides if it would otherwise tip over.

    ``corners`` (n, 3) [m] are points of the body. A robot with casters gets a ball in front of or
    behind the axle only if the weight leans there and no caster is there. If all casters are on the
    left or on the right and do not balance the robot, mirrored balls of equal height are added.
    """
    mass, centre = centre_of_mass(elements, urdf)
    axle: Array = np.mean([wheel.centre for wheel in wheels], axis=0)
    places = [place for name in casters for place in _list_bottoms(urdf, name)]
    lean = float(centre[0] - axle[0]) if mass > 0.0 else 0.0
    balls: dict[str, tuple[float, float, float]] = {}
    for name, side in (("front", 1.0), ("rear", -1.0)):
        is_free = not any((x - axle[0]) * side > 0.0 for x, _, _ in places)
        if is_free and (not places or lean * side > 0.0):
            reach = max(float((side * (corners[:, 0] - axle[0])).max()), 5.0 * _ASSUMED_RADIUS_M)
            balls[name] = float(axle[0] + 0.9 * side * reach), 0.0, 0.0
    track = float(np.ptp([wheel.centre[1] for wheel in wheels]))
    signs = {math.copysign(1.0, y) for _, y, _ in places if abs(y) > 0.1 * track}
    short = ""
    if len(signs) == 1 and not balls and mass > 0.0:
        carried = convex_hull(
            np.array([*(place[:2] for place in places), *(wheel.centre[:2] for wheel in wheels)])
        )
        edges = [(centre[0], centre[1] + share * track) for share in (-0.05, 0.05)]
        if not all(contains(Footprint(carried), edge) for edge in edges):
            name = "right" if signs == {1.0} else "left"
            mirrored = [(x, -y, z) for x, y, z in places if abs(y) > 0.1 * track]
            balls = {f"{name}{i or ''}": place for i, place in enumerate(mirrored)}
            short = _find_short(urdf, mirrored)
    for name, (x, y, z) in balls.items():
        root = urdf.poses[urdf.root].inverse() @ Pose((x, y, z + _ASSUMED_RADIUS_M))
        link = add_fixed_link(elements, f"evoros_support_{name}", urdf.root, root)
        link.append(build_collision(Shape("sphere", (_ASSUMED_RADIUS_M,))))
        _complete(link)
    if not balls:
        return Casters((), {}, ())
    why = (
        "the centre of mass is not between the axle and the casters"
        if places
        else "no caster supports it"
    )
    where = " and ".join(balls)
    note = f"a frictionless support at the {where} of the robot is assumed, because {why}{short}"
    return Casters(tuple(f"evoros_support_{name}" for name in balls), {}, (note,))


def _list_bottoms(urdf: Urdf, link: str) -> list[tuple[float, float, float]]:
    """Return, for each shape of a link, x, y [m] of its middle and the height [m] of its bottom."""
    poses = ((shape, urdf.poses[link] @ shape.pose) for shape in urdf.shapes[link])
    return [(*pose.position[:2], bottom_height(shape, pose)) for shape, pose in poses]


def _find_short(urdf: Urdf, places: Sequence[tuple[float, float, float]]) -> str:
    """Describe links that end above the ground where supports are assumed; "" if there are none."""
    short = {
        f"{link} ends {1e3 * z:.0f} mm above the ground there, its counterpart at {1e3 * low:.0f}"
        for link in urdf.poses
        for x, y, z in _list_bottoms(urdf, link)
        for there, side, low in places
        if math.hypot(x - there, y - side) < _ASSUMED_RADIUS_M and link != urdf.root
        if _SHORT_M[0] < z - low < _SHORT_M[1]
    }
    return "".join(f" ({text} mm; correct the <collision> of either)" for text in sorted(short))


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
