"""The links and joints of a URDF as a tree, in the zero position of all joints."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import NamedTuple

from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import Array, product
from evoros.base.errors import InputError
from evoros.formats.strict_xml import element_error, list_names, read_meaning, read_name
from evoros.formats.urdf.parts import Joint, parse_numbers, read_joint, read_shapes, read_visuals
from evoros.geometry.shapes import Pose, Shape

_COEFFICIENTS = ("mu", "mu1", "mu2")
_NO_SURFACES = ("plugin", "sensor")  # children of ``<gazebo>`` with arbitrary keys


@dataclass(frozen=True)
class Plugin:
    """A Gazebo plugin: its file and class, and the content of its child elements by tag."""

    name: str
    texts: Mapping[str, tuple[str, ...]]


class FrictionAxis(NamedTuple):
    """The direction in which a link's first friction coefficient acts."""

    direction: tuple[float, ...]  # x, y, z
    frame: str  # link that defines the frame; empty for this link


def read_plugins(robot: Element) -> tuple[Plugin, ...]:
    """Read all plugins of a ``<robot>``."""
    plugins = []
    for plugin in robot.iterfind("gazebo//plugin"):
        texts: dict[str, tuple[str, ...]] = {}
        for child in plugin:
            if isinstance(child.tag, str) and child.text and child.text.strip():
                texts[child.tag] = (*texts.get(child.tag, ()), child.text.strip())
        name = f"{plugin.get('filename', '')} {plugin.get('name', '')}"
        plugins.append(Plugin(name, texts))
    return tuple(plugins)


def read_friction(robot: Element) -> tuple[dict[str, FrictionAxis], frozenset[str]]:
    """Return the ``<fdir1>`` of each link that has one, and the frictionless links."""
    axes = {}
    coefficients: dict[str, list[float]] = {}
    for gazebo in robot.iterfind("gazebo[@reference]"):
        surface = [
            element
            for child in gazebo
            if child.tag not in _NO_SURFACES
            for element in child.iter(*_COEFFICIENTS, "fdir1")
        ]
        for element in surface:
            if element.tag != "fdir1":
                value = read_meaning(element, "friction/mu", _read_text(element))
                coefficients.setdefault(str(gazebo.get("reference")), []).append(value)
                continue
            frames = [v for name, v in element.attrib.items() if str(name).endswith("expressed_in")]
            numbers = parse_numbers(element, _read_text(element), 3)
            frame = str((*frames, "")[0])
            axes[str(gazebo.get("reference"))] = FrictionAxis(tuple(numbers), frame)
    return axes, frozenset(link for link, values in coefficients.items() if not any(values))


def _read_text(element: Element) -> str:
    """Return the attribute ``value`` or the content of an element, as Gazebo does."""
    return str(element.get("value") or element.text or "").strip()


@dataclass(frozen=True, eq=False)
class Urdf:
    """A parsed URDF: links with poses and shapes, connected to ``root`` by ``joints``."""

    source: str
    name: str
    root: str
    joints: Mapping[str, Joint]  # keyed by joint name
    poses: Mapping[str, Pose]  # link poses in the root frame
    shapes: Mapping[str, tuple[Shape, ...]]  # collision shapes of each link in its frame
    visuals: Mapping[str, tuple[Shape, ...]]  # visual shapes of each link in its frame
    plugins: tuple[Plugin, ...] = ()  # Gazebo plugins
    actuated: frozenset[str] = frozenset()  # joints of transmissions and ros2_control
    meshes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # file names of each link
    friction_axes: Mapping[str, FrictionAxis] = field(default_factory=dict)  # one per link
    slippery: frozenset[str] = frozenset()  # links without friction

    def error(self, problem: str, fix: str) -> InputError:
        """Return the error for a part of this description."""
        return InputError(f"{self.source}: {problem}; {fix}")

    def find_joint(self, name: str, *types: str) -> Joint:
        """Return the joint ``name``, which must have one of the ``types``."""
        joint = self.joints.get(name)
        if joint is None:
            known = list_names(sorted(self.joints))
            raise self.error(f"there is no joint {name!r}", f"name one of: {known}")
        if joint.type not in types:
            problem = f"joint {name!r} must be {' or '.join(types)}, not {joint.type}"
            raise self.error(problem, "change its type or name another joint")
        return joint

    def axis_of(self, joint: Joint) -> Array:
        """Return the axis (3,) of a joint in the root frame."""
        axis: Array = product(self.poses[joint.child].rotation, joint.axis)
        return axis

    def children_of(self, link: str) -> list[Joint]:
        """Return the joints that have a link as their parent."""
        return [joint for joint in self.joints.values() if joint.parent == link]

    def rigid_group(self, link: str) -> dict[str, Pose]:
        """Return a link and all descendants fixed to it, with poses in its frame."""
        group, frontier = {link: Pose()}, [link]
        while frontier:
            here = frontier.pop()
            for joint in self.children_of(here):
                if joint.type == "fixed":
                    group[joint.child] = group[here] @ joint.origin
                    frontier.append(joint.child)
        return group

    def joints_above(self, link: str) -> Iterator[Joint]:
        """Yield the joints from a link up to the root."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        while link != self.root:
            yield by_child[link]
            link = by_child[link].parent


def read_tree(robot: Element, source: str) -> Urdf:
    """Read the links and joints of a ``<robot>``; errors begin with ``source``."""
    links = _find_by_name(robot, "link")
    elements = _find_by_name(robot, "joint")
    joints = {name: read_joint(element, links) for name, element in elements.items()}
    root = _find_root(robot, links, joints)
    friction_axes, slippery = read_friction(robot)
    return Urdf(
        source=source,
        name=read_name(robot),
        root=root,
        joints=joints,
        poses=_compute_poses(robot, root, links, joints),
        shapes={name: read_shapes(link) for name, link in links.items()},
        visuals={name: read_visuals(link) for name, link in links.items()},
        plugins=read_plugins(robot),
        actuated=frozenset(
            str(joint.get("name"))
            for path in ("transmission/joint", "ros2_control/joint[command_interface]")
            for joint in robot.iterfind(path)
        ),
        meshes={
            name: tuple(
                str(mesh.get("filename", "")).rpartition("/")[2]
                for mesh in link.iterfind("*/geometry/mesh")
            )
            for name, link in links.items()
        },
        friction_axes=friction_axes,
        slippery=slippery,
    )


def read_frames(robot: Element, source: str) -> Urdf:
    """Read the links and joints of a ``<robot>``, and ignore the shapes."""
    bare = deepcopy(robot)
    for link in bare.findall("link"):
        for shape in [*link.findall("collision"), *link.findall("visual")]:
            link.remove(shape)
    return read_tree(bare, source)


def _find_by_name(robot: Element, tag: str) -> dict[str, Element]:
    elements: dict[str, Element] = {}
    for element in robot.findall(tag):
        name = read_name(element)
        if name in elements:
            raise element_error(element, "must have a unique name", "rename one of the two")
        elements[name] = element
    return elements


def _find_root(robot: Element, links: Mapping[str, Element], joints: Mapping[str, Joint]) -> str:
    joint_above: dict[str, str] = {}
    for joint in joints.values():
        if joint.child in joint_above:
            both = f"{joint_above[joint.child]!r} and {joint.name!r}"
            problem = f"has more than one parent joint of {joint.child!r}: {both}"
            raise element_error(robot, problem, "delete one of them")
        joint_above[joint.child] = joint.name
    roots = [name for name in links if name not in joint_above]
    if len(roots) != 1:
        names = ", ".join(roots[:5]) or "none"
        problem = f"must have exactly one root link (a link that is no joint's child), not {names}"
        raise element_error(robot, problem, "connect all links to one root with joints")
    return roots[0]


def _compute_poses(
    robot: Element, root: str, links: Mapping[str, Element], joints: Mapping[str, Joint]
) -> dict[str, Pose]:
    joints_below: dict[str, list[Joint]] = {}
    for joint in joints.values():
        joints_below.setdefault(joint.parent, []).append(joint)
    poses = {root: Pose()}
    frontier = [root]
    while frontier:
        link = frontier.pop()
        for joint in joints_below.get(link, []):
            poses[joint.child] = poses[link] @ joint.origin
            frontier.append(joint.child)
    loose = [name for name in links if name not in poses]
    if loose:
        problem = f"has links that are not connected to {root!r}: {', '.join(loose[:5])}"
        raise element_error(robot, problem, "remove a joint from the cycle")
    return poses


class UrdfDocument:
    """The immutable XML of a ``<robot>`` and its elements; can be pickled."""

    def __init__(self, text: str, root: Element | None = None) -> None:
        self.text = text
        self._root = root

    @classmethod
    def from_elements(cls, root: Element) -> "UrdfDocument":
        """Create the document of a ``<robot>``, which must not be modified afterwards."""
        return cls(etree.tostring(root, encoding="unicode", pretty_print=True), root)

    def __reduce__(self) -> tuple[type["UrdfDocument"], tuple[str]]:
        return type(self), (self.text,)

    def copy_elements(self) -> Element:
        """Return a copy of the elements, which the caller may modify."""
        if self._root is None:
            self._root = etree.fromstring(self.text.encode())
        return deepcopy(self._root)
