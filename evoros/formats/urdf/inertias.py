"""Completes and corrects the masses and inertias of a URDF."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.linear import length, principal_axes
from evoros.formats.strict_xml import element_error, find_child
from evoros.formats.urdf.elements import set_inertial
from evoros.formats.urdf.parts import read_origin, read_shapes, read_tensor, read_value
from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.shapes import Pose, Shape

DENSITY_KG_M3 = 500.0
"""Assumed of parts without a mass: between foam and plastic, as parts with hollows have."""

_MIN_GYRATION_M = 1e-4
_DEFAULT_GYRATION_M = 0.02  # of a link without shapes
_NAMED = 6  # links that a message names


def correct_inertias(robot: Element, extent_m: float) -> list[str]:
    """Replace impossible inertias; return a line for each kind of them.

    A link without a mass becomes a frame. A tensor is impossible if no body of positive density
    has it, or if its mass would lie farther out than the robot's extent [m]. A centre of mass out
    there stays, and is told.
    """
    massless, replaced, beyond = [], [], []
    for link in robot.findall("link"):
        inertial = find_child(link, "inertial")
        if inertial is None:
            continue
        mass = _read_mass(inertial)
        if mass == 0.0:
            link.remove(inertial)
            massless.append(str(link.get("name")))
            continue
        centre = np.array(read_origin(inertial).position)
        if length(centre) > extent_m:
            beyond.append(str(link.get("name")))
        if not _is_possible(inertial, mass, extent_m):
            set_inertial(link, mass, centre, _assume_tensor(link, mass))
            replaced.append(str(link.get("name")))
    notes = {
        "links with a mass of 0 are taken as frames": massless,
        "impossible inertias are replaced by inertias of the shapes": replaced,
        f"centres of mass lie beyond the size of the robot ({extent_m:.3g} m), as if they were "
        f"not in metres; correct the <origin> of <inertial>": beyond,
    }
    return [f"{text}: {_list(names)}" for text, names in notes.items() if names]


def _list(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def _read_mass(inertial: Element) -> float:
    mass = find_child(inertial, "mass")
    value = 0.0 if mass is None else read_value(mass, "value", "0")
    if mass is not None and value < 0.0:
        problem = f"must be greater than 0 kg, not {mass.get('value')}"
        raise element_error(mass, problem, "write a positive value")
    return value


def _is_possible(inertial: Element, mass: float, extent_m: float) -> bool:
    inertia = find_child(inertial, "inertia")
    if inertia is None or any(inertia.get(name) is None for name in ("ixx", "iyy", "izz")):
        return False
    low, middle, high = principal_axes(read_tensor(inertia))[0].tolist()
    return bool(
        low > mass * _MIN_GYRATION_M * _MIN_GYRATION_M
        and low + middle >= high * (1.0 - 1e-9)
        and high <= mass * extent_m * extent_m
    )


def _assume_tensor(link: Element, mass: float) -> Array:
    """Return the tensor (3, 3) [kg m2] of a homogeneous box around the link's shapes."""
    shapes = read_shapes(link)
    if not shapes:
        return mass * _DEFAULT_GYRATION_M * _DEFAULT_GYRATION_M * np.eye(3)
    low, high = bounds_of((shape, shape.pose) for shape in shapes)
    return box_tensor(mass, high - low)


def box_tensor(mass: float, size: Array) -> Array:
    """Return the tensor (3, 3) [kg m2] of a homogeneous box of a size (3,) [m]."""
    squares = np.maximum(size, 1e-3) ** 2
    tensor: Array = mass / 12.0 * np.diag(squares.sum() - squares)
    return tensor


def bounds_of(shapes: Iterable[tuple[Shape, Pose]]) -> tuple[Array, Array]:
    """Return the lower and upper corner (3,) [m] of the box around placed shapes."""
    turns = (  # that bring x, y and z upwards
        Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -math.pi / 2, 0.0),
        Pose.from_rpy((0.0, 0.0, 0.0), math.pi / 2, 0.0, 0.0),
        Pose(),
    )
    placed = list(shapes)
    low = [min(bottom_height(shape, turn @ pose) for shape, pose in placed) for turn in turns]
    high = [max(top_height(shape, turn @ pose) for shape, pose in placed) for turn in turns]
    return np.array(low), np.array(high)


def give_mass(link: Element, shapes: Sequence[tuple[Shape, Pose]]) -> float:
    """Give a link the mass of a box around shapes, in its frame; return the mass [kg]."""
    low, high = bounds_of(shapes)
    mass = DENSITY_KG_M3 * float(np.prod(np.maximum(high - low, 1e-3)))
    set_inertial(link, mass, (low + high) / 2, box_tensor(mass, high - low))
    return mass
