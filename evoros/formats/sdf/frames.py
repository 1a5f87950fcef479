"""Resolves relative poses in an SDF file to world poses.

The path of a frame consists of the names of the enclosing models and of the frame, such as
``("shelf", "board")``; the path of the world is empty.
"""

from dataclasses import dataclass

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import element_error, find_child, parse_pose, quote, read_name
from evoros.geometry.shapes import Pose

Path = tuple[str, ...]


@dataclass(frozen=True)
class RelativePose:
    """A pose in the frame ``base`` or, if that is empty, in the enclosing frame."""

    pose: Pose
    base: str
    element: Element  # origin of the pose, for errors


@dataclass(frozen=True)
class _Frame:
    relative: RelativePose
    scope: Path  # path in which the name of the base is looked up
    placement: str = ""  # frame of the model placed at the pose; empty for the model's origin


class Frames:
    """World poses of models, links, frames and joints, by path."""

    def __init__(self, container: Element) -> None:
        self._frames: dict[Path, _Frame] = {}
        self._poses: dict[Path, Pose] = {(): Pose()}
        self._collect(container, ())

    def _collect(self, container: Element, scope: Path) -> None:
        for element in container.iterchildren("model", "link", "frame", "joint"):
            name = read_name(element)
            path = (*scope, name)
            if path in self._frames:
                problem = f"has a name that is already in use: {quote(name)}"
                raise element_error(element, problem, "rename one of the two")
            if name == "world" or (name.startswith("__") and name.endswith("__")):
                raise element_error(element, f"has a reserved name: {quote(name)}", "rename it")
            placement = element.get("placement_frame", "").strip()
            self._frames[path] = _Frame(_read_frame_pose(element), scope, placement)
            if element.tag == "model":
                self._collect(element, path)

    def move(self, path: Path, pose: Pose) -> bool:
        """Set the world pose of a frame; return False if the frame does not exist."""
        if path not in self._frames:
            return False
        frame = self._frames[path]
        self._frames[path] = _Frame(RelativePose(pose, "", frame.relative.element), ())
        return True

    def check(self) -> None:
        """Check that all frames can be resolved, including unused frames."""
        for path in self._frames:
            self.world_pose(path)

    def find(self, scope: Path, name: str, element: Element) -> Path:
        """Return the path of the frame that ``element`` calls ``name``, looked up in ``scope``."""
        if name == "__model__" and scope:
            return scope
        if name == "world" and not scope:
            return ()
        inner = name.removesuffix("::__model__").split("::")
        for path in ((*scope, name), (*scope, *inner)):
            if path in self._frames:
                return path
        owner = "::".join(scope) or "the world"
        fix = f"name a model, link, frame or joint in {owner}"
        raise element_error(element, f"refers to {quote(name)}, which is not in {owner}", fix)

    def world_pose(self, path: Path) -> Pose:
        """Return the world pose of the frame at a path."""
        open_paths: list[Path] = []
        while path not in self._poses:
            if path in open_paths:
                circle = " -> ".join("::".join(p) for p in [*open_paths, path])
                raise element_error(
                    self._frames[path].relative.element,
                    f"has a circular pose: {circle}",
                    "make one of these poses relative to the model",
                )
            open_paths.append(path)
            path = self._base(self._frames[path])
        for path in reversed(open_paths):
            frame = self._frames[path]
            self._poses[path] = self._poses[self._base(frame)] @ self._relative_pose(path)
        return self._poses[path]

    def _relative_pose(self, path: Path) -> Pose:
        frame = self._frames[path]
        if not frame.placement:
            return frame.relative.pose
        element = frame.relative.element
        # A placement frame is a child of an included model, but a sibling of a merged one.
        inside = any(other[:-1] == path for other in self._frames)
        within = self.find(path if inside else path[:-1], frame.placement, element)
        pose, visited = Pose(), {path}
        while within != path:
            if within in visited or not within:
                problem = f"names a placement_frame outside the model: {quote(frame.placement)}"
                raise element_error(element, problem, "name a link or frame of the model")
            visited.add(within)
            pose = self._relative_pose(within) @ pose
            within = self._base(self._frames[within])
        return frame.relative.pose @ pose.inverse()

    def _base(self, frame: _Frame) -> Path:
        relative = frame.relative
        if not relative.base:
            return frame.scope
        return self.find(frame.scope, relative.base, relative.element)

    def resolve(self, element: Element, link: Path) -> Pose:
        """Return the world pose of a collision or inertia that belongs to the link at a path."""
        relative = read_pose(element)
        if not relative.base:
            return self.world_pose(link) @ relative.pose
        base = self.find(link[:-1], relative.base, relative.element)
        return self.world_pose(base) @ relative.pose


def _read_frame_pose(element: Element) -> RelativePose:
    relative = read_pose(element)
    if relative.base or element.tag not in ("frame", "joint"):
        return relative
    if element.tag == "frame":
        base = element.get("attached_to", "")
    else:
        child = (element.findtext("child") or "").strip()
        base = "" if child == "world" else child
    return RelativePose(relative.pose, base, element)


def read_pose(element: Element) -> RelativePose:
    """Read the ``<pose>`` of an element, by default the identity in the enclosing frame."""
    pose = find_child(element, "pose")
    if pose is None:
        return RelativePose(Pose(), "", element)
    base = (pose.get("relative_to") or pose.get("frame") or "").strip()
    return RelativePose(parse_pose(pose), base, pose)
