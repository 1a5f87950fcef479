"""Reads a robot from a URDF or xacro file."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.drive.protocol import DriveDescription
from evoros.formats.missing import MISSING
from evoros.formats.urdf import expansion
from evoros.formats.urdf.document import UrdfDocument
from evoros.formats.urdf.solids import read_visual_solids
from evoros.formats.urdf.tree import Urdf
from evoros.formats.urdf.xacro_expansion import ReadOptions
from evoros.geometry.footprint import top_height
from evoros.geometry.shapes import Shape
from evoros.robot.adaptation import AdaptedRobot, adapt
from evoros.robot.model import Robot
from evoros.robot.mounting import MountDefaults, fit_mount
from evoros.robot.occlusion import find_occluders
from evoros.robot.outline import (
    SolidShape,
    compute_outline,
    find_exposed,
    rolling_links,
    rolling_shapes,
)

COLLISIONS, VISUALS = "collisions", "visuals"


def load_robot(
    description: str,
    drive: DriveDescription,
    mount: MountDefaults | None = None,
    arguments: Mapping[str, Any] | None = None,
    packages: Sequence[str] = (),
    ignored_packages: Sequence[str] = (),
    environment: Mapping[str, Any] | None = None,
    missing: str = "error",
    wheels_touch: bool = True,
    self_occlusion: str = COLLISIONS,
) -> Robot:
    """Load the robot that a xacro or URDF file describes.

    ``description`` is a path, which may be relative to the bundled robots; ``arguments`` are for
    the xacro file; ``packages`` are further folders in which it may name files, and packages in
    ``ignored_packages`` are left out. ``environment`` has the variables of ``$(env)``. A missing
    ``mount`` is chosen for the robot. ``missing`` (``error``, ``leave_out`` or ``box``) states what
    to do with absent meshes. If ``wheels_touch``, obstacles can touch the wheels and casters that
    stick out of the body. ``self_occlusion`` is ``collisions`` or ``visuals``, the shapes by which
    the body hides from its own sensors what they would see.

    Raises:
        InputError: the file cannot be used, or ``drive`` or ``mount`` do not fit it.
    """
    mount = MountDefaults() if mount is None else mount
    options = ReadOptions(arguments or {}, packages, ignored_packages, environment or {}, missing)
    _check_types(description, drive, mount, options)
    if missing not in MISSING:
        choices = ", ".join(MISSING)
        raise InputError(f"robot.missing: must be one of {choices}, not {missing!r}; set it")
    if self_occlusion not in (COLLISIONS, VISUALS):
        raise InputError(
            f"robot.self_occlusion: must be {COLLISIONS} or {VISUALS}, not {self_occlusion!r}; "
            f"set it"
        )
    file, root = expansion.read(description, options)
    adapted = adapt(root, str(file), drive, missing)
    visuals = read_visual_solids(root, missing) if self_occlusion == VISUALS else None
    return _build_robot(root, adapted, mount, wheels_touch, visuals)


def _build_robot(
    root: Element,
    adapted: AdaptedRobot,
    mount: MountDefaults,
    wheels_touch: bool,
    visuals: Mapping[str, Sequence[Shape]] | None,
) -> Robot:
    """Build the robot of a ``<robot>`` and of what it was adapted to.

    Its sensors see the ``visuals`` of its links, or the collision shapes if these are None.
    """
    urdf, drive = adapted.urdf, adapted.drive.fit(adapted.urdf)
    rolling = rolling_links(urdf, drive)
    solids = _find_body(urdf, rolling, adapted.exposed_casters)
    touching = [(solid.shape, solid.pose) for solid in solids]
    exposed = frozenset(adapted.exposed_casters)
    if wheels_touch:
        exposed |= find_exposed(urdf, rolling - exposed, compute_outline(touching))
    for link in sorted(exposed.difference(adapted.exposed_casters)):
        touching += rolling_shapes(urdf, link)
    places = _find_sensor_links(urdf, root)
    default = fit_mount(mount, places, solids)
    document = UrdfDocument.from_elements(root)
    changed = UrdfDocument.from_elements(adapted.elements)
    robot = Robot(
        name=urdf.name,
        base_urdf=document,
        engine_urdf=None if changed.text == document.text else changed,
        drive=drive,
        outline=compute_outline(touching),
        height_m=max(top_height(shape, pose) for shape, pose in touching),
        mount_link=default.link,
        mount_z_m=default.z_m,
        mount_pitch_deg=default.pitch_deg,
        chosen_mount=default.chosen,
        sensor_links=places,
        solids=tuple(solids),
        visuals=tuple(_place_visuals(urdf, rolling)),
        reserved_names=frozenset(urdf.poses) | frozenset(urdf.joints),
        exposed_links=exposed,
        occluders=find_occluders(urdf, drive, rolling - set(adapted.exposed_casters), visuals),
    )
    if default.link not in places:
        raise robot.link_error(default.link)
    return robot


def _place_visuals(urdf: Urdf, rolling: Collection[str]) -> Iterator[SolidShape]:
    """Yield what the links show, in the frame of the root."""
    for link, shapes in urdf.visuals.items():
        for shape in shapes:
            yield SolidShape(link, shape, urdf.poses[link] @ shape.pose, link in rolling)


def _check_types(description: object, drive: object, mount: object, options: ReadOptions) -> None:
    lists: Any = list | tuple
    for name, value, expected, what in (
        ("description", description, str, "the path of a file"),
        ("drive", drive, DriveDescription, "the description of a drive"),
        ("mount", mount, MountDefaults, "a default mount (MountDefaults)"),
        ("arguments", options.arguments, Mapping, "a mapping from names to values"),
        ("packages", options.packages, lists, "a list of folders"),
        ("ignored_packages", options.ignored_packages, lists, "a list of names of packages"),
        ("environment", options.environment, Mapping, "a mapping from names to values"),
    ):
        if not isinstance(value, expected):
            raise InputError(f"robot.{name}: must be {what}, not {value!r}; give one")


def _find_body(
    urdf: Urdf, rolling: Collection[str], exposed_casters: Mapping[str, str]
) -> list[SolidShape]:
    """Find the shapes of all links but ``rolling`` ones, and of body parts that slide."""
    solids = [
        SolidShape(exposed_casters.get(link, link), shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling or link in exposed_casters
        for shape in shapes
    ]
    if not solids:
        problem = "a link other than the wheels and casters must have a <collision>"
        raise urdf.error(problem, "give it a box")
    return solids


def _find_sensor_links(urdf: Urdf, root: Element) -> dict[str, tuple[float, float, float, float]]:
    """Find the upright links that are fixed to the root: x, y, z [m] and yaw [rad] of each."""
    described = {link.get("name") for link in root.findall("link")}
    sensor_links = {}
    for link, pose in urdf.poses.items():
        fixed = all(joint.type == "fixed" for joint in urdf.joints_above(link))
        if fixed and link in described and pose.rotation[2, 2] > 1.0 - 1e-9:
            sensor_links[link] = (*pose.position, pose.yaw)
    return sensor_links
