"""The tree of a URDF's links and joints, placed at zero joint positions."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.strict_xml import fault, local_tag, name_of
from evoros.formats.urdf.parts import Joint, check_inertia, read_joint, read_shapes
from evoros.geometry.shapes import Pose, Shape


@dataclass(frozen=True, eq=False)
class Urdf:
    """A tree of links, from ``root`` over ``joints``."""

    source: str
    name: str
    root: str
    joints: Mapping[str, Joint]  # by name
    poses: Mapping[str, Pose]  # of each link, in the root's frame
    shapes: Mapping[str, tuple[Shape, ...]]  # of each link, in its own frame

    def fault(self, problem: str, cure: str) -> InputError:
        """The error for something in this description, to be raised by the caller."""
        return InputError(f"{self.source}: {problem}; {cure}")

    def joint(self, name: str, *types: str) -> Joint:
        """The joint of this name.

        Raises:
            InputError: there is none, or it is of none of ``types``.
        """
        joint = self.joints.get(name)
        if joint is None:
            known = ", ".join(sorted(self.joints)) or "none"
            raise self.fault(f"joint {name!r} must exist", f"name one of: {known}")
        if joint.type not in types:
            rule = f"joint {name!r} must be {' or '.join(types)}, not {joint.type}"
            raise self.fault(rule, "change its type or name another joint")
        return joint

    def axis(self, joint: Joint) -> Array:
        """(3,) the joint's axis in the root's frame."""
        turned: Array = self.poses[joint.child].rotation @ joint.axis
        return turned

    def above(self, link: str) -> Iterator[Joint]:
        """The joints on the way from a link up to the root."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        while link != self.root:
            yield by_child[link]
            link = by_child[link].parent


def read_tree(robot: Element, source: str) -> Urdf:
    """The links and joints of a ``<robot>``.

    Raises:
        InputError: an element is not as it must be, or the links form no tree.
    """
    if robot.tag != "robot":
        raise fault(robot, f"must be <robot>, not <{local_tag(robot)}>", "name the file of a robot")
    links = _named(robot, "link")
    for link in links.values():
        check_inertia(link)
    joints = {name: read_joint(element, links) for name, element in _named(robot, "joint").items()}
    root = _root(robot, links, joints)
    return Urdf(
        source=source,
        name=name_of(robot),
        root=root,
        joints=joints,
        poses=_placed(robot, root, links, joints),
        shapes={name: read_shapes(link) for name, link in links.items()},
    )


def _named(robot: Element, tag: str) -> dict[str, Element]:
    elements: dict[str, Element] = {}
    for element in robot.findall(tag):
        name = name_of(element)
        if name in elements:
            raise fault(element, "must have a name of its own", "rename one of the two")
        elements[name] = element
    return elements


def _root(robot: Element, links: Mapping[str, Element], joints: Mapping[str, Joint]) -> str:
    above: dict[str, str] = {}
    for joint in joints.values():
        if joint.child in above:
            rule = f"must have one joint above {joint.child!r}"
            both = f"{above[joint.child]!r} and {joint.name!r}"
            raise fault(robot, f"{rule}, not {both}", "delete one of them")
        above[joint.child] = joint.name
    roots = [name for name in links if name not in above]
    if len(roots) != 1:
        found = ", ".join(roots[:5]) or "none"
        cure = "connect all links to one by joints, without a circle"
        raise fault(robot, f"must have one link that is no joint's child, not {found}", cure)
    return roots[0]


def _placed(
    robot: Element, root: str, links: Mapping[str, Element], joints: Mapping[str, Joint]
) -> dict[str, Pose]:
    """Forward kinematics at zero joint positions, from the root down."""
    below: dict[str, list[Joint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    poses = {root: Pose()}
    frontier = [root]
    while frontier:
        link = frontier.pop()
        for joint in below.get(link, []):
            poses[joint.child] = poses[link] @ joint.origin
            frontier.append(joint.child)
    loose = [name for name in links if name not in poses]
    if loose:
        rule = f"must have every link connected to {root!r}, unlike {', '.join(loose[:5])}"
        raise fault(robot, rule, "break the circle of joints")
    return poses
