"""Reads a robot from a URDF or xacro file."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.drive.protocol import DriveDescription
from evoros.formats.missing import MISSING
from evoros.formats.urdf import expansion
from evoros.formats.urdf.solids import read_visual_solids
from evoros.formats.urdf.tree import Urdf, UrdfDocument
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

    ``description`` is a path, which may be relative to the bundled robots, and ``arguments`` are
    for xacro. ``packages`` are further folders for files that it names; ``ignored_packages`` are
    skipped. ``environment`` has the variables of ``$(env)``. ``mount`` None is chosen for the
    robot. ``missing`` (``error``, ``leave_out`` or ``box``) handles absent meshes. If
    ``wheels_touch``, obstacles can touch wheels and casters that stick out of the body.
    ``self_occlusion`` selects the shapes that block the robot's own sensors, ``collisions`` or
    ``visuals``.

    Raises:
        InputError: the file cannot be used, or ``drive`` or ``mount`` does not fit it.
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
    """Build a robot; ``visuals`` by link, or the collision shapes if None, block its sensors."""
    urdf, drive = adapted.urdf, adapted.drive.fit(adapted.urdf)
    wheels = {urdf.joints[name].child for name in drive.wheel_joints}
    rolling = wheels | set(drive.caster_links)
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
        visuals=tuple(
            SolidShape(link, shape, urdf.poses[link] @ shape.pose, link in rolling)
            for link, shapes in urdf.visuals.items()
            for shape in shapes
        ),
        reserved_names=frozenset(urdf.poses) | frozenset(urdf.joints),
        exposed_links=exposed,
        occluders=find_occluders(urdf, drive, rolling - set(adapted.exposed_casters), visuals),
    )
    if default.link not in places:
        raise robot.link_error(default.link)
    return robot


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
    """Find the shapes of all links outside ``rolling``, and of body parts that slide."""
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
    """Find the upright links fixed to the root: x, y, z [m] and yaw [rad] by name."""
    described = {link.get("name") for link in root.findall("link")}
    sensor_links = {}
    for link, pose in urdf.poses.items():
        fixed = all(joint.type == "fixed" for joint in urdf.joints_above(link))
        if fixed and link in described and pose.rotation[2, 2] > 1.0 - 1e-9:
            sensor_links[link] = (*pose.position, pose.yaw)
    return sensor_links
