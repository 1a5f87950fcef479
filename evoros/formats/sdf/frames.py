"""Frames of an SDF file: which pose is relative to which, resolved into world poses.

A frame's path is the names of the models around it and its own: ``("shelf", "board")``; the path
of the world is empty.
"""

import math
from dataclasses import dataclass

from lxml.etree import _Element as Element

from evoros.formats.sdf.elements import check_children
from evoros.formats.strict_xml import child, fault, flag_attribute, name_of, numbers, shown
from evoros.geometry.shapes import Pose, normalized

Path = tuple[str, ...]


@dataclass(frozen=True)
class Placement:
    """A pose in the frame called ``base``, or in the one around it if that is empty."""

    pose: Pose
    base: str
    element: Element  # where this stands


@dataclass(frozen=True)
class _Frame:
    place: Placement
    scope: Path  # where the name of its base is looked up


class Frames:
    """World poses of models, links, frames and joints by their path.

    Raises:
        InputError: two with one name, a frame that does not exist, a circle of frames.
    """

    def __init__(self, container: Element) -> None:
        self._frames: dict[Path, _Frame] = {}
        self._poses: dict[Path, Pose] = {(): Pose()}
        self._collect(container, ())

    def _collect(self, container: Element, scope: Path) -> None:
        for element in container.iterchildren("model", "link", "frame", "joint"):
            if element.tag != "link":  # a link is checked when it is read
                check_children(element)
            name = name_of(element)
            path = (*scope, name)
            if path in self._frames:
                cure = "rename one of the two"
                raise fault(element, f"has a name that is taken: {shown(name)}", cure)
            if name == "world" or (name.startswith("__") and name.endswith("__")):
                raise fault(element, f"has a reserved name: {shown(name)}", "rename it")
            place = read_pose(element)
            if not place.base and element.tag == "frame":
                place = Placement(place.pose, element.get("attached_to", ""), element)
            if not place.base and element.tag == "joint":
                base = (element.findtext("child") or "").strip()
                place = Placement(place.pose, "" if base == "world" else base, element)
            self._frames[path] = _Frame(place, scope)
            if element.tag == "model":
                if element.get("placement_frame"):
                    cure = "give the pose of the model itself"
                    raise fault(element, "has an unsupported placement_frame", cure)
                self._collect(element, path)

    def place(self, path: Path, pose: Pose) -> bool:
        """Put a frame at a pose in the world; False where there is no such frame."""
        if path not in self._frames:
            return False
        self._frames[path] = _Frame(Placement(pose, "", self._frames[path].place.element), ())
        return True

    def check(self) -> None:
        """Raise the error of any frame that cannot be resolved, even if nothing needs it."""
        for path in self._frames:
            self.world_pose(path)

    def find(self, scope: Path, name: str, element: Element) -> Path:
        """The path of the frame that ``element`` in ``scope`` calls ``name``."""
        if name == "__model__" and scope:
            return scope
        if name == "world" and not scope:
            return ()
        inner = name.removesuffix("::__model__").split("::")
        for path in ((*scope, name), (*scope, *inner)):
            if path in self._frames:
                return path
        inside = "::".join(scope) or "the world"
        cure = "name a model, link, frame or joint beside it"
        raise fault(element, f"refers to {shown(name)}, which is not in {inside}", cure)

    def world_pose(self, path: Path) -> Pose:
        """The pose in the world of the frame with this path."""
        open_paths: list[Path] = []
        while path not in self._poses:
            if path in open_paths:
                circle = " -> ".join("::".join(p) for p in [*open_paths, path])
                cure = "make one of them relative to its model"
                raise fault(
                    self._frames[path].place.element, f"has a circular pose: {circle}", cure
                )
            open_paths.append(path)
            path = self._base(self._frames[path])
        for path in reversed(open_paths):
            frame = self._frames[path]
            self._poses[path] = self._poses[self._base(frame)] @ frame.place.pose
        return self._poses[path]

    def _base(self, frame: _Frame) -> Path:
        place = frame.place
        return self.find(frame.scope, place.base, place.element) if place.base else frame.scope

    def pose_of(self, element: Element, link: Path) -> Pose:
        """The pose in the world of a collision or inertia of the link with this path."""
        place = read_pose(element)
        base = self.find(link[:-1], place.base, place.element) if place.base else link
        return self.world_pose(base) @ place.pose


def read_pose(element: Element) -> Placement:
    """Where the ``<pose>`` of an element puts it."""
    found = child(element, "pose")
    if found is None:
        return Placement(Pose(), "", element)
    base = (found.get("relative_to") or found.get("frame") or "").strip()
    if not len(found) and not (found.text or "").strip():
        return Placement(Pose(), base, found)
    form = found.get("rotation_format", "euler_rpy")
    degrees = flag_attribute(found, "degrees")
    if form == "quat_xyzw" and not degrees:
        x, y, z, *quaternion = numbers(found, 7)
        if sum(q * q for q in quaternion) < 1e-12:
            raise fault(found, "has a quaternion of length 0", "write 0 0 0 1 for no rotation")
        return Placement(Pose((x, y, z), normalized(quaternion)), base, found)
    if form != "euler_rpy":
        cure = 'use "euler_rpy", or "quat_xyzw" without degrees'
        raise fault(found, f"has rotation_format {shown(form)}, degrees {degrees}", cure)
    x, y, z, *angles = numbers(found, 6)
    roll, pitch, yaw = (math.radians(a) if degrees else a for a in angles)
    return Placement(Pose.from_rpy((x, y, z), roll, pitch, yaw), base, found)
