"""Reads a robot from URDF or xacro, and adapts its description to engines and drives."""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import length, principal_axes
from evoros.base.errors import InputError
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.candidates import CASTER, TURNING
from evoros.drive.protocol import DriveDescription
from evoros.drive.rolling import Wheel, shape_points
from evoros.formats.missing import MISSING
from evoros.formats.notes import Notes, list_notes, note_degrees
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf import expansion
from evoros.formats.urdf.elements import correct_inertias, give_mass, require_limit, set_inertial
from evoros.formats.urdf.parts import read_origin, read_tensor
from evoros.formats.urdf.solids import SolidsReader, read_visual_solids
from evoros.formats.urdf.tree import Urdf, UrdfDocument, read_tree
from evoros.formats.urdf.xacro_expansion import ReadOptions
from evoros.geometry.footprint import top_height
from evoros.geometry.shapes import Pose, Shape
from evoros.robot import body_adaptation, outline, wheel_adaptation
from evoros.robot.caster_adaptation import Casters, add_supports, centre_of_mass, find_casters
from evoros.robot.model import Robot
from evoros.robot.mounting import MountDefaults, fit_mount

_LOG = logging.getLogger(__name__)

GRAVITY_MPS2 = 9.81
DENSEST_KG_M3 = 22_600.0  # density of osmium, the densest metal
LARGEST_SHARE = 10.0  # maximum inertia of a wheel, relative to a wheel with all mass on the rim
STEERING_STOP_RAD = 0.8  # limit [rad] of steering joints without a stated limit


@dataclass(frozen=True, eq=False)
class AdaptedRobot:
    """A robot description that engines accept, with its drive."""

    elements: Element
    urdf: Urdf
    drive: DriveDescription
    exposed_casters: Mapping[str, str]  # original links of split-off sliding parts, by new link


def adapt(description: Element, source: str, drive: DriveDescription, missing: str) -> AdaptedRobot:
    """Return a copy of a ``<robot>`` element, adapted to a drive."""
    degrees = Notes(_LOG)
    note_degrees(description, degrees)
    degrees.report()
    elements, reader = deepcopy(description), SolidsReader(missing)
    reader.rewrite_collisions(elements)
    notes = body_adaptation.show_as_collisions(elements, read_tree(elements, source), reader)
    urdf = read_tree(elements, source)
    try:
        chosen, wheels, drive_notes = _adapt_drive(elements, urdf, drive)
    except InputError as error:
        turning = (joint.child for joint in urdf.joints.values() if joint.type in TURNING)
        flat = (reader.empty[link] for link in turning if link in reader.empty)
        raise next(flat, error) from None
    driven = (*chosen.wheel_joints, *chosen.steering_joints)
    urdf = read_tree(elements, source)
    notes += drive_notes + body_adaptation.hold_joints(elements, urdf, driven)
    notes += body_adaptation.place_on_ground(elements, urdf, wheels)
    urdf = read_tree(elements, source)
    rolling = {urdf.joints[name].child for name in chosen.wheel_joints}
    rolling_groups = {link for name in rolling for link in urdf.rigid_group(name)}
    notes += body_adaptation.complete_body(elements, urdf, rolling_groups, reader, wheels)
    notes += correct_inertias(elements, _extent(read_tree(elements, source), wheels))
    notes += _complete_masses(elements, read_tree(elements, source), chosen, wheels)
    notes += _balance_wheels(elements, read_tree(elements, source), chosen)
    notes += _tell_dense(elements, read_tree(elements, source))
    casters, chosen = _adapt_casters(elements, source, chosen, wheels, rolling_groups)
    rolling = rolling_groups | {*chosen.caster_links}
    urdf = read_tree(elements, source)
    lost = body_adaptation.replace_lost_body(elements, urdf, rolling, reader, wheels)
    urdf = read_tree(elements, source)
    notes += lost + (_complete_masses(elements, urdf, chosen, wheels) if lost else [])
    notes += [*casters.notes, *_complete_motors(elements, urdf, chosen, wheels)]
    reader.mesh_notes.report()
    for note in [*reader.finish(), *notes]:
        _LOG.warning("%s: %s", source, note)
    return AdaptedRobot(elements, read_tree(elements, source), chosen, casters.exposed)


def _adapt_drive(
    elements: Element, urdf: Urdf, drive: DriveDescription
) -> tuple[DriveDescription, list[Wheel], list[str]]:
    """Choose the drive, and adapt joints and wheels; return the wheels in the root frame."""
    automatic, notes = isinstance(drive, AutomaticDescription), wheel_adaptation.Assumptions(list)
    chosen = drive.choose(urdf) if isinstance(drive, AutomaticDescription) else drive
    named = isinstance(drive, AutomaticDescription) and bool(drive.left_wheel_joints)
    stop = max(float(getattr(chosen, "steering_limit_rad", 0.0)), STEERING_STOP_RAD)
    for name in chosen.steering_joints:
        wheel_adaptation.adapt_steering(elements, urdf, name, automatic, stop, notes)
    wheels = [
        wheel_adaptation.adapt_wheel(elements, urdf, name, automatic, named, notes)
        for name in chosen.wheel_joints
    ]
    return chosen, wheels, list_notes(notes)


def _extent(urdf: Urdf, wheels: Sequence[Wheel]) -> float:
    """Return the diagonal [m] of the robot's bounding box, the maximum distance between masses."""
    points = [wheel.centre[None] for wheel in wheels]
    points += [np.array([pose.position]) for pose in urdf.poses.values()]
    points.append(body_adaptation.collision_points(urdf, urdf.shapes))
    return length(np.ptp(np.concatenate(points), axis=0))


def _complete_masses(
    elements: Element, urdf: Urdf, drive: DriveDescription, wheels: Sequence[Wheel]
) -> list[str]:
    links = {str(link.get("name")): link for link in elements.findall("link")}
    given = []
    for name in (*drive.wheel_joints, *drive.steering_joints):
        child = urdf.joints[name].child
        if any(links[part].find("inertial") is not None for part in urdf.rigid_group(child)):
            continue
        shapes = [(shape, shape.pose) for shape in urdf.shapes[child]]
        if name in drive.steering_joints:  # small part: a cube with the wheel radius as its edge
            shapes = [(Shape("box", (wheels[0].radius,) * 3), Pose())]
        give_mass(links[child], shapes)
        given.append(child)
    group = urdf.rigid_group(urdf.root)
    body = {name: pose for name, pose in group.items() if not CASTER.search(name)}
    if not any(links[name].find("inertial") is not None for name in body):
        shapes = [(s, pose @ s.pose) for name, pose in body.items() for s in urdf.shapes[name]]
        if shapes:
            give_mass(links[urdf.root], shapes)
            given.append(urdf.root)
    note = f"masses are estimated from the size (500 kg/m3) for {', '.join(given)}"
    return [note] if given else []


def _balance_wheels(elements: Element, urdf: Urdf, drive: DriveDescription) -> list[str]:
    """Correct wheels with a centre of mass outside the rim or with too large an inertia."""
    moved, slow = [], []
    for joint in (urdf.joints[name] for name in drive.wheel_joints):
        link = next(link for link in elements.findall("link") if link.get("name") == joint.child)
        inertial, (shape, *_) = link.find("inertial"), urdf.shapes[joint.child]
        if inertial is None:
            continue
        centre = np.array(read_origin(inertial).position)
        off = length(np.cross(centre, joint.axis))
        mass = float(require_child(inertial, "mass").get("value", "0"))
        rim = mass * shape.size[0] * shape.size[0]
        least = float(principal_axes(read_tensor(require_child(inertial, "inertia")))[0].min())
        if off > shape.size[0]:
            moved.append(f"{joint.child} ({off:.3g} m from its axle)")
        elif least > LARGEST_SHARE * rim:
            slow.append(f"{joint.child} ({least:.3g} kg m2, at most {rim:.2g} on its rim)")
        else:
            continue
        set_inertial(link, mass, np.array(shape.pose.position), 0.5 * rim * np.eye(3))
    return list_notes(
        {
            "centres of mass outside their wheels are moved into the wheels": moved,
            "inertias too large for their wheels are replaced with inertias of cylinders": slow,
        }
    )


def _tell_dense(elements: Element, urdf: Urdf) -> list[str]:
    dense = []
    for link in elements.findall("link"):
        name, mass = str(link.get("name")), link.find("inertial/mass")
        shapes = [(shape, shape.pose) for shape in urdf.shapes[name]]
        if mass is None or not shapes:
            continue
        points = np.concatenate([shape_points(*shape) for shape in shapes])
        volume = float(np.prod(np.ptp(points, axis=0)))
        if float(mass.get("value", "0")) > DENSEST_KG_M3 * volume:
            dense.append(f"{name} ({float(mass.get('value', '0')):g} kg in {1e3 * volume:.3g} l)")
    return list_notes({"links are denser than any metal, but their masses are kept": dense})


def _adapt_casters(
    elements: Element,
    source: str,
    drive: DriveDescription,
    wheels: Sequence[Wheel],
    rolling: set[str],
) -> tuple[Casters, Any]:
    given = tuple(drive.caster_links)
    casters = find_casters(elements, read_tree(elements, source), rolling, given)
    urdf = read_tree(elements, source)
    if drive.on_one_axle:
        points = body_adaptation.collision_points(urdf, urdf.shapes)
        added = add_supports(elements, urdf, wheels, casters.links, points)
        links, notes = (*casters.links, *added.links), (*casters.notes, *added.notes)
        casters = Casters(links, casters.exposed, notes)
    if casters.links == given:
        return casters, drive
    return casters, replace(drive, caster_links=casters.links)  # type: ignore[type-var]


def _complete_motors(
    elements: Element, urdf: Urdf, drive: DriveDescription, wheels: Sequence[Wheel]
) -> list[str]:
    """Give drive joints without an effort limit a limit of weight times wheel radius."""
    mass, _ = centre_of_mass(elements, urdf)
    radii = {name: wheel.radius for name, wheel in zip(drive.wheel_joints, wheels, strict=True)}
    radii |= dict.fromkeys(drive.steering_joints, wheels[0].radius)
    given: dict[str, list[str]] = {}
    for name, radius in radii.items():
        joint, torque = urdf.joints[name], mass * GRAVITY_MPS2 * radius
        if math.isinf(joint.effort):
            limit = require_limit(wheel_adaptation.find_joint(elements, name))
            limit.set("effort", repr(torque))
            limit.set("velocity", repr(min(joint.velocity, wheel_adaptation.MOTOR_VELOCITY)))
            text = f"joints without an effort limit get {torque:.3g} N m (weight times radius)"
            given.setdefault(text, []).append(name)
    return list_notes(given)


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
    """Load a robot from a xacro or URDF file.

    ``description`` is a path, which may be relative to the bundled robots. If ``mount`` is None, a
    default is derived from the robot. If ``wheels_touch``, obstacles can touch wheels and casters
    that stick out of the body. ``self_occlusion`` selects the shapes that block the view of the
    sensors, ``collisions`` or ``visuals``. The other arguments are the fields of ``ReadOptions``.
    """
    mount = MountDefaults() if mount is None else mount
    options = ReadOptions(arguments or {}, packages, ignored_packages, environment or {}, missing)
    _check_types(description, drive, mount, options)
    if missing not in MISSING:
        choices = ", ".join(MISSING)
        raise InputError(f"robot.missing: must be one of {choices}, not {missing!r}")
    if self_occlusion not in (COLLISIONS, VISUALS):
        rule = f"must be {COLLISIONS} or {VISUALS}"
        raise InputError(f"robot.self_occlusion: {rule}, not {self_occlusion!r}")
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
    """Build a robot; ``visuals``, or collision shapes if None, block its sensors' view."""
    urdf, drive = adapted.urdf, adapted.drive.fit(adapted.urdf)
    wheels = {urdf.joints[name].child for name in drive.wheel_joints}
    rolling = wheels | set(drive.caster_links)
    split = adapted.exposed_casters
    solids = _find_body(urdf, rolling, split)
    touching = [(solid.shape, solid.pose) for solid in solids]
    exposed = frozenset(split)
    if wheels_touch:
        exposed |= outline.find_exposed(urdf, rolling - exposed, outline.compute_outline(touching))
    for link in sorted(exposed.difference(split)):
        touching += outline.rolling_shapes(urdf, link)
    places = _find_sensor_links(urdf, root)
    default = fit_mount(mount, places, solids)
    document = UrdfDocument.from_elements(root)
    changed = UrdfDocument.from_elements(adapted.elements)
    robot = Robot(
        name=urdf.name,
        base_urdf=document,
        engine_urdf=None if changed.text == document.text else changed,
        drive=drive,
        outline=outline.compute_outline(touching),
        height_m=max(top_height(shape, pose) for shape, pose in touching),
        mount_link=default.link,
        mount_z_m=default.z_m,
        mount_pitch_deg=default.pitch_deg,
        chosen_mount=default.chosen,
        sensor_links=places,
        solids=tuple(solids),
        visuals=tuple(
            outline.SolidShape(link, shape, urdf.poses[link] @ shape.pose, link in rolling)
            for link, shapes in urdf.visuals.items()
            for shape in shapes
        ),
        reserved_names=frozenset(urdf.poses) | frozenset(urdf.joints),
        exposed_links=exposed,
        occluders=outline.find_occluders(urdf, drive, rolling - {*split}, visuals),
    )
    if default.link not in places:
        raise robot.link_error(default.link)
    return robot


def _check_types(description: object, drive: object, mount: object, options: ReadOptions) -> None:
    lists: Any = list | tuple
    for name, value, expected, what in (
        ("description", description, str, "a file path"),
        ("drive", drive, DriveDescription, "a drive description"),
        ("mount", mount, MountDefaults, "a default mount (MountDefaults)"),
        ("arguments", options.arguments, Mapping, "a mapping from names to values"),
        ("packages", options.packages, lists, "a list of folders"),
        ("ignored_packages", options.ignored_packages, lists, "a list of package names"),
        ("environment", options.environment, Mapping, "a mapping from names to values"),
    ):
        if not isinstance(value, expected):
            raise InputError(f"robot.{name}: must be {what}, not {value!r}")


def _find_body(
    urdf: Urdf, rolling: Collection[str], exposed_casters: Mapping[str, str]
) -> list[outline.SolidShape]:
    solids = [
        outline.SolidShape(exposed_casters.get(link, link), shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling or link in exposed_casters
        for shape in shapes
    ]
    if not solids:
        problem = "a link other than the wheels and casters must have a <collision>"
        raise urdf.error(problem, "add a <collision> with a box to such a link")
    return solids


def _find_sensor_links(urdf: Urdf, root: Element) -> dict[str, tuple[float, float, float, float]]:
    """Return the x, y, z [m] and yaw [rad] of each upright link fixed to the root, by name."""
    described = {link.get("name") for link in root.findall("link")}
    return {
        link: (*pose.position, pose.yaw)
        for link, pose in urdf.poses.items()
        if all(joint.type == "fixed" for joint in urdf.joints_above(link))
        and link in described
        and pose.rotation[2, 2] > 1.0 - 1e-9
    }
