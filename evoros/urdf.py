"""The links and joints of a URDF: checked for consistency, placed at zero joint positions."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from evoros.errors import InputError
from evoros.types import Array

JOINT_TYPES = ("fixed", "continuous", "revolute", "prismatic")


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint; its axis in the base frame, its limits [rad or m]."""

    name: str
    type: str
    parent: str
    child: str
    origin: Array  # (4, 4) from the parent's frame to the joint's
    axis: Array  # (3,) unit vector in the joint's frame
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class Collision:
    """One collision shape: its pose in the base frame, its full lengths or radius and length."""

    kind: str  # box, cylinder or sphere
    size: tuple[float, ...]  # box: x, y, z; cylinder: radius, length; sphere: radius [m]
    pose: Array  # (4, 4)


@dataclass(frozen=True, eq=False)
class Urdf:
    """A robot whose every link is placed: a tree from ``root`` over ``joints``."""

    source: str
    name: str
    root: str
    joints: Mapping[str, Joint]
    poses: Mapping[str, Array]  # link -> (4, 4) in the root's frame
    collisions: Mapping[str, tuple[Collision, ...]]  # link -> its shapes

    def fault(self, what: str, rule: str, cure: str) -> InputError:
        """The error for something in this description, to be raised by the caller."""
        return InputError(f"{self.source}: {what}: {rule}; {cure}")

    def joint(self, name: str, *types: str) -> Joint:
        """The named joint.

        Raises:
            InputError: there is none, or it is of none of ``types``.
        """
        joint = self.joints.get(name)
        if joint is None:
            raise self.fault(
                f"joint {name}", "must exist", f"name one of {', '.join(sorted(self.joints))}"
            )
        if joint.type not in types:
            raise self.fault(
                f"joint {name}",
                f"must be {' or '.join(types)}, not {joint.type}",
                "change its type or name another joint",
            )
        return joint

    def axis(self, joint: Joint) -> Array:
        """(3,) the joint's axis in the root's frame."""
        turned: Array = self.poses[joint.child][:3, :3] @ joint.axis
        return turned

    def above(self, link: str) -> Iterator[Joint]:
        """The joints from ``link`` up to the root."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        while link != self.root:
            yield by_child[link]
            link = by_child[link].parent


def read_tree(root: etree._Element, file: Path, with_lines: bool) -> Urdf:
    """The links and joints below the root element of a URDF.

    Raises:
        InputError: names the file, the link or joint, the rule and the cure.
    """
    return _Reader(root, str(file), with_lines).read()


class _Reader:
    """Reads one document; keeps what every message needs."""

    def __init__(self, root: etree._Element, source: str, with_lines: bool) -> None:
        self.root = root
        self.source = source
        self.with_lines = with_lines

    def fault(self, element: etree._Element, rule: str, cure: str) -> InputError:
        line = f":{element.sourceline}" if self.with_lines else ""
        named = next((e for e in (element, *element.iterancestors()) if e.get("name")), element)
        what = f"{named.tag!s} {named.get('name', '')}".strip()
        if named is not element:
            what += f", {element.tag!s}"
        return InputError(f"{self.source}{line}: {what}: {rule}; {cure}")

    def read(self) -> Urdf:
        if self.root.tag != "robot":
            raise self.fault(self.root, "the root element must be <robot>", "name a robot's file")
        links = self.named("link")
        for link in links.values():
            self.check_inertia(link)
        joints = {name: self.read_joint(e, links) for name, e in self.named("joint").items()}
        base = self.find_root(links, joints)
        poses = self.place(base, links, joints)
        return Urdf(
            source=self.source,
            name=self.attribute(self.root, "name"),
            root=base,
            joints=joints,
            poses=poses,
            collisions={n: self.read_collisions(e, poses[n]) for n, e in links.items()},
        )

    def named(self, tag: str) -> dict[str, etree._Element]:
        elements: dict[str, etree._Element] = {}
        for element in self.root.findall(tag):
            name = self.attribute(element, "name")
            if name in elements:
                raise self.fault(element, "names must be unique", "rename one of them")
            elements[name] = element
        return elements

    def attribute(self, element: etree._Element, name: str) -> str:
        value = element.get(name, "").strip()
        if not value:
            raise self.fault(element, f"must have the attribute {name!r}", "add it")
        return value

    def child(self, element: etree._Element, tag: str, cure: str) -> etree._Element:
        children = element.findall(tag)
        if len(children) != 1:
            raise self.fault(element, f"must have one <{tag}>, not {len(children)}", cure)
        return children[0]

    def numbers(self, element: etree._Element, name: str, count: int, default: str = "") -> Array:
        text = element.get(name, default)
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.full(1, np.nan)
        if len(values) != count or not np.isfinite(values).all():
            raise self.fault(
                element, f"{name} must be {count} finite number(s), not {text!r}", "write them"
            )
        return values

    def number(self, element: etree._Element, name: str, default: str = "") -> float:
        return float(self.numbers(element, name, 1, default)[0])

    def check_inertia(self, link: etree._Element) -> None:
        """A mass, and a tensor that some body of this mass can have."""
        inertial = self.child(link, "inertial", "add its mass and inertia")
        mass = self.child(inertial, "mass", "add it")
        if self.number(mass, "value") <= 0:
            raise self.fault(mass, "must be greater than 0", "set value [kg]")
        tensor = self.child(inertial, "inertia", "add it")
        xx, xy, xz, yy, yz, zz = (
            self.number(tensor, name, "0" if name in ("ixy", "ixz", "iyz") else "")
            for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if least <= 0 or least + middle < most * (1 - 1e-9):
            raise self.fault(
                tensor,
                "the principal moments must be greater than 0 and none greater than the sum of "
                f"the others, not {least:g}, {middle:g}, {most:g}",
                "compute them from the body's shape",
            )
        self.origin(inertial)

    def origin(self, element: etree._Element) -> Array:
        origin = element.find("origin")
        if origin is None:
            return np.eye(4)
        rpy = self.numbers(origin, "rpy", 3, "0 0 0")
        return transform(self.numbers(origin, "xyz", 3, "0 0 0"), *rpy.tolist())

    def read_joint(self, element: etree._Element, links: Mapping[str, object]) -> Joint:
        kind = self.attribute(element, "type")
        if kind not in JOINT_TYPES:
            raise self.fault(
                element, f"type must be one of {', '.join(JOINT_TYPES)}, not {kind}", "change it"
            )
        ends = []
        for tag in ("parent", "child"):
            end = self.attribute(self.child(element, tag, "add it"), "link")
            if end not in links:
                raise self.fault(element, f"its {tag} link {end} must exist", "add or rename it")
            ends.append(end)
        axis_element = element.find("axis")
        axis = np.array([1.0, 0.0, 0.0])
        if axis_element is not None:
            axis = self.numbers(axis_element, "xyz", 3)
            if not axis.any():
                raise self.fault(axis_element, "must not be zero", "set xyz")
            axis = axis / np.linalg.norm(axis)
        lower, upper = self.limits(element, kind)
        return Joint(
            self.attribute(element, "name"), kind, ends[0], ends[1],
            self.origin(element), axis, lower, upper,
        )  # fmt: skip

    def limits(self, element: etree._Element, kind: str) -> tuple[float, float]:
        if kind not in ("revolute", "prismatic"):
            return -math.inf, math.inf
        limit = self.child(element, "limit", "add it")
        lower, upper = self.number(limit, "lower", "0"), self.number(limit, "upper", "0")
        for name in ("effort", "velocity"):
            if self.number(limit, name) <= 0:
                raise self.fault(limit, f"{name} must be greater than 0", "set it")
        if lower >= upper:
            raise self.fault(limit, f"lower must be less than upper, not {lower}, {upper}", "set")
        return lower, upper

    def find_root(self, links: Mapping[str, object], joints: Mapping[str, Joint]) -> str:
        parents: dict[str, str] = {}
        for joint in joints.values():
            if joint.child in parents:
                raise self.fault(
                    self.root,
                    f"link {joint.child} must be the child of one joint, not of "
                    f"{parents[joint.child]} and {joint.name}",
                    "remove one of them",
                )
            parents[joint.child] = joint.name
        roots = [name for name in links if name not in parents]
        if len(roots) != 1:
            raise self.fault(
                self.root,
                f"one link must be no joint's child, not {len(roots)} ({', '.join(roots[:5])})",
                "connect all links to one root",
            )
        return roots[0]

    def place(
        self, base: str, links: Mapping[str, object], joints: Mapping[str, Joint]
    ) -> dict[str, Array]:
        """Forward kinematics at zero joint positions."""
        poses = {base: np.eye(4)}
        frontier = [base]
        while frontier:
            parent = frontier.pop()
            for joint in joints.values():
                if joint.parent == parent:
                    poses[joint.child] = poses[parent] @ joint.origin
                    frontier.append(joint.child)
        loose = sorted(set(links) - set(poses))
        if loose:
            raise self.fault(
                self.root,
                f"every link must hang on the root {base}, unlike {', '.join(loose[:5])}",
                "break the loop of joints",
            )
        return poses

    def read_collisions(self, link: etree._Element, pose: Array) -> tuple[Collision, ...]:
        return tuple(self.read_collision(e, pose) for e in link.findall("collision"))

    def read_collision(self, element: etree._Element, pose: Array) -> Collision:
        geometry = self.child(element, "geometry", "add it")
        if len(geometry) != 1 or geometry[0].tag not in ("box", "cylinder", "sphere"):
            raise self.fault(
                geometry,
                "a collision shape must be one box, cylinder or sphere",
                "approximate the part by such shapes",
            )
        shape = geometry[0]
        if shape.tag == "box":
            size = tuple(self.numbers(shape, "size", 3).tolist())
        else:
            names = ("radius", "length") if shape.tag == "cylinder" else ("radius",)
            size = tuple(self.number(shape, name) for name in names)
        if min(size) <= 0:
            raise self.fault(shape, "lengths must be greater than 0", "set them")
        return Collision(str(shape.tag), size, pose @ self.origin(element))


def transform(xyz: Array, roll: float, pitch: float, yaw: float) -> Array:
    """(4, 4) the frame at ``xyz`` [m], turned by roll, pitch, yaw [rad] about fixed axes (URDF)."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    pose = np.eye(4)
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = xyz
    return pose
