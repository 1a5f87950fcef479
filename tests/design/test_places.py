"""Places of sensors: on an outline, facing outwards, and where the robot does not block a view."""

import itertools
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from design_cases import ROBOT
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from robot_cases import ROBOTS, rover

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.design.outline_region import SIDES as OUTER_SIDES
from evoros.design.outline_region import OutlineRegion, trace_side
from evoros.design.protocol import BoundRegion
from evoros.design.region import Region
from evoros.design.space import SensorDesign
from evoros.evolution.experiment import Experiment
from evoros.geometry.footprint import Footprint, convex_hull, distances
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.robot.outline import Occluders, SolidShape, compute_outline_at
from evoros.robot.self_sight import find_self_sights
from evoros.sensor.multizone import Multizone
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.testing import RegionSuite


def bind(robot: Robot, regions: dict[str, Any], mirrored: bool = False) -> Any:
    return SensorDesign({"sonar": Sonar()}, regions, 3, mirrored).bind(robot)


SIDES = {side: OutlineRegion(side, [-45.0, 45.0]) for side in ("front", "left", "rear", "right")}
BOX = Region([-0.3, 0.3], [0.1, 0.4], [-90.0, 90.0], [0.1, 0.2], 0.0, overhang_m=0.2)


@settings(max_examples=20)
@given(st.data())
def test_no_genome_leads_to_a_place_that_the_robot_hides(data: st.DataObject) -> None:
    """The mule's wheels stand beside its body, where its outline carries sensors."""
    mirrored = data.draw(st.booleans())
    choices: list[dict[str, Any]] = [dict(SIDES), {"left": SIDES["left"], "box": BOX}]
    regions = data.draw(st.sampled_from(choices))
    robot = rover("mule")
    space = bind(robot, regions, mirrored)
    genome = np.array(
        data.draw(st.lists(st.floats(0, 1), min_size=space.size, max_size=space.size))
    )
    design = space.decode(genome)
    assert not list(find_self_sights(robot.with_sensors(design.mounts, {"sonar": Sonar()})))


def test_parts_that_are_smaller_than_a_cell_hide_no_place() -> None:
    """Just above the front edge of the mule's top, between corners that are free."""
    robot, sensors = rover("mule"), {"sonar": Sonar()}
    region = Region([0.2, 0.3], 0.1, -45.0, [0.1, 0.2], 0.0, overhang_m=0.2)
    edge, other = (
        bind(robot, {"edge": region}).regions["edge"],
        {"yaw_deg": -45.0, "pitch_deg": 0.0},
    )
    for x, z in itertools.product(np.linspace(0.2, 0.3, 25), np.linspace(0.1, 0.2, 25)):
        (px, py, pz), yaw, pitch = edge.place({"x_m": x, "y_m": 0.1, "z_m": z, **other})
        mount = Mount("sonar", robot.mount_link, px, py, pz, yaw, pitch)
        assert not list(find_self_sights(robot.with_sensors([mount], sensors)))


def test_what_is_left_out_is_what_is_hidden() -> None:
    """Without leaving out, a third of the same genomes lead to sonars that see a wheel."""
    robot = rover("mule")
    whole = replace(robot, occluders=Occluders())
    rng = np.random.default_rng(0)
    genomes = rng.random((200, bind(robot, dict(SIDES)).size))
    designs = [bind(whole, dict(SIDES)).decode(genome) for genome in genomes]
    sights = [
        len(list(find_self_sights(robot.with_sensors(design.mounts, {"sonar": Sonar()}))))
        for design in designs
    ]
    assert sum(sights) > 0.3 * 3 * len(genomes)


@settings(max_examples=20)
@given(st.data())
def test_free_places_keep_their_order_and_fill_the_ends(data: st.DataObject) -> None:
    """Along an axis with all else fixed, the place moves on with its gene, from end to end."""
    left = bind(rover("mule"), {"left": SIDES["left"]}).regions["left"]
    free, lowest = left.free, {name: low for name, (low, _) in left.ranges.items()}
    assert free is not None
    yaw = data.draw(st.floats(-45.0, 45.0))
    shares = sorted(data.draw(st.lists(st.floats(0, 1), min_size=2, max_size=8)))
    adapted = [free.adapt({**lowest, "arc": share, "yaw_deg": yaw})["arc"] for share in shares]
    assert adapted == sorted(adapted)
    cells = np.flatnonzero(free.free.any(axis=1))
    ends = [free.adapt({**lowest, "arc": share, "yaw_deg": yaw})["arc"] for share in (0.0, 1.0)]
    assert ends == pytest.approx([cells[0] / len(free.free), (cells[-1] + 1) / len(free.free)])


def test_a_robot_that_hides_nothing_leaves_all_places() -> None:
    for name in ("erle_rover", "two_wheeler", "courier"):
        assert all(
            region.free is None for region in bind(rover(name), dict(SIDES)).regions.values()
        )


unhurried = settings(max_examples=25)


@cache
def experiment() -> Experiment:
    return compose(["experiment=eyes_navigation"]).build()


@unhurried
@given(st.integers(0, 2**32))
def test_every_genome_gives_equal_eyes_on_the_rim_that_face_outwards(seed: int) -> None:
    one = experiment()
    genome = np.random.default_rng(seed).random(one.space.size)
    design = one.space.decode(genome)
    assert 1 <= len(design.mounts) <= 8
    robot = one.members[0].with_design(design).robot
    assert {mount.sensor for mount in design.mounts} == {"multizone"}
    eye = robot.sensors["multizone"]
    assert isinstance(eye, Multizone)
    assert 1 <= eye.zones <= 8
    assert 1.0 <= eye.fov_deg <= 100.0
    assert robot.channel_count == len(design.mounts) * eye.zones <= 64
    radius = np.abs(one.robot.outline).max()
    for mount in design.mounts:
        assert math.isclose(math.hypot(mount.x_m, mount.y_m), radius, rel_tol=0.02)
        bearing = math.degrees(math.atan2(mount.y_m, mount.x_m))
        assert abs((mount.yaw_deg - bearing + 180.0) % 360.0 - 180.0) < 6.0  # a polygon's side


def test_places_cover_the_whole_rim_evenly() -> None:
    one, rng = experiment(), np.random.default_rng(0)
    designs = [one.space.decode(rng.random(one.space.size)) for _ in range(200)]
    bearings = [math.atan2(m.y_m, m.x_m) for design in designs for m in design.mounts]
    counts = np.histogram(bearings, 6, (-math.pi, math.pi))[0]
    mean = len(bearings) / 6
    assert (np.abs(counts - mean) < 5 * math.sqrt(mean)).all()


POINT = st.tuples(st.floats(-1, 1), st.floats(-1, 1))
SHARE = st.floats(0, 1)


@st.composite
def outlines(draw: st.DrawFn) -> Array:
    """Draw a convex outline that is more than a line."""
    hull = convex_hull(np.array(draw(st.lists(POINT, min_size=3, max_size=12))))
    assume(len(hull) > 2)
    x, y = hull.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assume(area > 1e-3)
    return hull


def assert_on_surface(outline: Array, x: float, y: float, heading: float) -> None:
    """Require a point on the outline, which a step along the heading leaves."""
    point = np.array([[x, y]])
    assert distances(Footprint(outline), point)[0] < 1e-9
    step = 1e-3 * np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading))])
    # No corner lies farther along the heading: the point is on the border, facing outwards.
    assert ((outline - point) @ step).max() < 1e-12


@given(outlines(), st.sampled_from(list(OUTER_SIDES)), SHARE)
def test_every_point_of_a_side_is_on_the_outline_and_faces_outwards(
    outline: Array, side: str, share: float
) -> None:
    (x, y), heading = trace_side(outline, side).at(share)
    assert_on_surface(outline, x, y, heading)
    if side != "all_around":
        turn = math.radians(heading - OUTER_SIDES[side])
        assert math.cos(turn) > math.cos(math.radians(45.001))


@given(outlines())
def test_the_sides_cover_the_outline_once(outline: Array) -> None:
    lines = [trace_side(outline, side) for side in ("front", "left", "rear", "right")]
    around = float(np.sqrt(((np.roll(outline, -1, axis=0) - outline) ** 2).sum(axis=1)).sum())
    normals = [angle for line in lines if any(line.lengths) for angle in line.normals_deg]
    assume(all(abs(abs(angle) % 90 - 45) > 1e-3 for angle in normals))  # those are on two sides
    assert sum(sum(line.lengths) for line in lines) == pytest.approx(around)
    assert sum(trace_side(outline, "all_around").lengths) == pytest.approx(around)


@given(outlines(), st.sampled_from(list(OUTER_SIDES)), SHARE)
def test_twins_are_on_the_surface_too(outline: Array, side: str, share: float) -> None:
    symmetric = convex_hull(np.concatenate([outline, outline * (1.0, -1.0)]))
    robot = replace(ROBOT, outline=symmetric)
    region = OutlineRegion(side)
    design = SensorDesign({"sonar": Sonar()}, {"side": region}, 1, mirrored=True)
    space = design.bind(robot)
    for mount in space.decode(np.full(space.size, share)).mounts:
        assert_on_surface(symmetric, mount.x_m, mount.y_m, mount.yaw_deg)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_default_design_fits_every_robot(name: str) -> None:
    robot = rover(name)
    for side in OUTER_SIDES:
        region = OutlineRegion(side, yaw_deg=[-45, 45])
        space = SensorDesign({"sonar": Sonar()}, {side: region}, 1, mirrored=False).bind(robot)
        placed = robot.with_sensors(
            space.decode(np.full(space.size, 0.5)).mounts, {"sonar": Sonar()}
        )
        ((x, y, z, yaw, _),) = placed.sensor_poses
        outline = compute_outline_at(robot.solids, z)
        assert_on_surface(robot.outline if outline is None else outline, x, y, math.degrees(yaw))
        assert z == pytest.approx(robot.mount_z_m)


TOWER = replace(
    ROBOT,
    solids=(
        SolidShape("base", Shape("box", (0.4, 0.3, 0.1)), Pose((0, 0, 0.1))),
        SolidShape("mast", Shape("cylinder", (0.05, 0.2)), Pose((-0.1, 0, 0.25))),
    ),
    height_m=0.35,
)


def pose(region: OutlineRegion, robot: Robot = TOWER, **values: float) -> Any:
    bound = region.bind(robot, False, "design.regions.side")
    lows = {name: low for name, (low, _) in bound.ranges.items()}
    return bound.place(lows | {"arc": 0.5} | values)


def test_the_outline_is_that_of_the_shapes_at_the_height() -> None:
    assert pose(OutlineRegion("front", height_m=0.1)).position == pytest.approx((0.2, 0, 0.1))
    assert pose(OutlineRegion("front", height_m=0.3)).position[0] == pytest.approx(-0.05, abs=1e-3)
    # None reaches the height: then it is the outline of all of them.
    assert pose(OutlineRegion("front", height_m=0.02)).position == pytest.approx((0.2, 0, 0.02))
    both = OutlineRegion("front", height_m=[0.1, 0.3])
    assert pose(both, z_m=0.1).position[0] == pytest.approx(0.2)
    assert pose(both, z_m=0.3).position[0] == pytest.approx(-0.05, abs=1e-3)


def test_a_link_has_its_own_outline_and_frame() -> None:
    on_mast = pose(OutlineRegion("rear", height_m=0.3, link="mast"))
    assert on_mast.position == pytest.approx((-0.05, 0, 0), abs=1e-3)
    assert on_mast.yaw_deg % 360 == pytest.approx(180, abs=3)


def test_the_widest_sensor_levels_its_lowest_ray_without_a_pitch() -> None:
    robot = replace(TOWER, mount_pitch_deg=None)
    sensors = {"narrow": Sonar(fov_deg=10), "wide": Sonar(fov_deg=50)}
    space = SensorDesign(sensors, {"front": OutlineRegion("front")}, 1, False).bind(robot)
    (mount,) = space.decode(np.full(space.size, 0.5)).mounts
    assert mount.pitch_deg > 25
    carrier = robot.with_sensors([replace(mount, sensor="wide")], sensors)
    frame = carrier.sensor_frames[0]
    assert (sensors["wide"].rays() @ frame[:3, :3].T)[:, 2].min() == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize(
    ("region", "mirrored", "message"),
    [
        (OutlineRegion("front", height_m=2), False, "height_m must be above the ground .* 2 to 2"),
        (OutlineRegion("front", height_m=-0.1), False, "height_m must be above the ground"),
        (OutlineRegion("front", link="roof"), False, r"link: .* choose one of base, mast, door"),
        (
            OutlineRegion("front", link="door", height_m=0.1),
            False,
            "collision shape.* base or mast",
        ),
        (OutlineRegion("front", link="mast"), False, "height_m: must be set for the link mast"),
        (OutlineRegion("front", link="door", height_m=0.1), True, "x axis"),
    ],
)
def test_a_side_that_the_robot_lacks_is_refused(
    region: OutlineRegion, mirrored: bool, message: str
) -> None:
    design = SensorDesign({"sonar": Sonar()}, {"front": region}, 1, mirrored)
    with pytest.raises(InputError, match=r"^design\.regions\.front.*" + message):
        design.bind(TOWER)


def test_twins_need_a_symmetric_robot() -> None:
    lopsided = replace(ROBOT, outline=ROBOT.outline + np.array([0.0, 0.1]))
    region = OutlineRegion("left")
    with pytest.raises(InputError, match=r"symmetric to within 0.05 m .* differ by 0.2 m"):
        region.bind(lopsided, True, "design.regions.left")
    region.bind(lopsided, False, "design.regions.left")
    replace(region, overhang_m=0.21).bind(lopsided, True, "design.regions.left")


class TestOutlineRegion(RegionSuite):
    part = OutlineRegion("left", yaw_deg=[-30, 10])
    bad_values = ({"side": "top"}, {"side": ""}, {"side": 3})


def test_the_area_for_drawing_is_the_line() -> None:
    bound: BoundRegion = OutlineRegion("left", yaw_deg=[-30, 10]).bind(ROBOT, False, "x")
    area = bound.area()
    assert area.corners == ((0.25, 0.15), (-0.2, 0.15))
    assert area.facing_deg == ((60.0, 100.0),)
    assert area.yaw_deg == (60.0, 100.0)
    assert (area.z_m, area.pitch_deg) == ((0.166, 0.166), (12.5, 12.5))
