"""The SDF reader: world poses by composition, bodies by joints, and an error for all else."""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evoros.body import Body, Pose
from evoros.errors import InputError
from evoros.sdf import read_sdf

BOX = "<geometry><box><size>1 2 3</size></box></geometry>"
COLLISION = f"<collision name='c'>{BOX}</collision>"
LINK = f"<link name='l'>{COLLISION}</link>"
STATIC = "<static>true</static>"
ODE, EDO = "<friction><ode>", "</ode></friction>"
UNIT = "<ixx>1</ixx><iyy>1</iyy><izz>1</izz>"
MASS = "<inertial><mass>2</mass></inertial>"

unhurried = settings(deadline=None)


def read(content: str, version: str = "1.9") -> tuple[Body, ...]:
    return read_sdf(f'<sdf version="{version}">{content}</sdf>'.encode(), "w.sdf")


def world(content: str, version: str = "1.9") -> tuple[Body, ...]:
    return read(f"<world name='w'>{content}</world>", version)


def assert_pose(
    pose: Pose, position: NDArray[np.float64] | Sequence[float], rotation: Rotation
) -> None:
    np.testing.assert_allclose(np.array(pose.position), position, atol=1e-7)
    assert (Rotation.from_quat(pose.quaternion).inv() * rotation).magnitude() < 1e-7


# ---- World poses of nested things, against scipy's rotations.

triples = st.tuples(*[st.floats(-5, 5)] * 3)


@dataclass(frozen=True)
class Place:
    """A pose, and one of the ways in which SDF can write it."""

    position: tuple[float, float, float]
    rpy: tuple[float, float, float]
    form: str

    @property
    def rotation(self) -> Rotation:
        return Rotation.from_euler("xyz", self.rpy)

    def text(self, base: str = "") -> str:
        position = " ".join(map(repr, self.position))
        relative = f" relative_to='{base}'" if base else ""
        if self.form == "quat":
            rest = " ".join(repr(float(q)) for q in self.rotation.as_quat())
            return f"<pose{relative} rotation_format='quat_xyzw'>{position} {rest}</pose>"
        if self.form == "degrees":
            rest = " ".join(repr(math.degrees(a)) for a in self.rpy)
            return f"<pose{relative} degrees='true'>{position}\n {rest}</pose>"
        return f"<pose{relative}>{position} <!-- here --> {' '.join(map(repr, self.rpy))}</pose>"


@dataclass(frozen=True)
class Tree:
    """A model: frames one upon the other, a box on the last, and models in it."""

    place: Place
    frames: tuple[Place, ...]
    link: Place
    box: Place
    parts: tuple["Tree", ...] = field(default=())

    def text(self, name: str) -> str:
        frames = [
            f"<frame name='f{i}'>{place.text('' if i == 0 else f'f{i - 1}')}</frame>"
            for i, place in enumerate(self.frames)
        ]
        base = f"f{len(frames) - 1}" if frames else ""
        parts = [part.text(f"m{i}") for i, part in enumerate(self.parts)]
        # What is relative to something may stand before it.
        return (
            f"<model name='{name}'>{self.place.text()}<static>true</static>"
            f"<link name='l'>{self.link.text(base)}"
            f"<collision name='c'>{self.box.text()}{BOX}</collision></link>"
            f"{''.join(reversed(frames))}{''.join(parts)}</model>"
        )

    def boxes(self, place: tuple[np.ndarray, Rotation]) -> list[tuple[np.ndarray, Rotation]]:
        here = compose(place, self.place)
        last = here
        for step in (*self.frames, self.link, self.box):
            last = compose(last, step)
        return [last, *(box for part in self.parts for box in part.boxes(here))]


def compose(frame: tuple[np.ndarray, Rotation], place: Place) -> tuple[np.ndarray, Rotation]:
    position, rotation = frame
    return position + rotation.apply(place.position), rotation * place.rotation


places = st.builds(Place, triples, triples, st.sampled_from(["euler", "quat", "degrees"]))
leaves = st.builds(Tree, places, st.lists(places, max_size=3).map(tuple), places, places)
trees = st.recursive(
    leaves,
    lambda deeper: st.builds(
        lambda leaf, parts: Tree(leaf.place, leaf.frames, leaf.link, leaf.box, tuple(parts)),
        leaves,
        st.lists(deeper, min_size=1, max_size=3),
    ),
    max_leaves=5,
)


@unhurried
@given(trees)
def test_nested_poses_compose(tree: Tree) -> None:
    bodies = world(tree.text("top"))
    expected = tree.boxes((np.zeros(3), Rotation.identity()))
    assert len(bodies) == len(expected)
    for body, (position, rotation) in zip(bodies, expected, strict=True):
        (shape,) = body.shapes
        assert (body.mass, shape.kind, shape.size) == (None, "box", (1.0, 2.0, 3.0))
        assert_pose(body.pose @ shape.pose, position, rotation)


@unhurried
@given(places, places, places)
def test_models_can_be_relative_to_models_and_to_frames(a: Place, b: Place, c: Place) -> None:
    (body,) = world(
        f"<model name='m'>{STATIC}{c.text('inner::l')}{LINK}</model>"
        f"<frame name='f' attached_to='g'>{b.text()}</frame><frame name='g'>{a.text()}</frame>"
        f"<model name='inner'>{STATIC}<link name='l'>{a.text()}</link>{b.text('f')}</model>"
    )
    steps = (a, b, b, a, c)  # g, f on g, inner on f, its link, m on that
    frame = (np.zeros(3), Rotation.identity())
    for step in steps:
        frame = compose(frame, step)
    assert_pose(body.pose, *frame)


@unhurried
@given(places, places)
def test_a_pose_and_its_inverse_and_its_matrix_agree(a: Place, b: Place) -> None:
    pose_a, pose_b = (
        Pose.from_matrix(place.position, place.rotation.as_matrix()) for place in (a, b)
    )
    frame = compose((np.array(a.position), a.rotation), b)
    assert_pose(pose_a @ pose_b, *frame)
    assert_pose(pose_a.inverse() @ (pose_a @ pose_b), b.position, b.rotation)
    np.testing.assert_allclose(pose_a.rotation, a.rotation.as_matrix(), atol=1e-9)


@unhurried
@given(places, places, places, places)
def test_state_has_the_last_word_in_world_poses(a: Place, b: Place, c: Place, d: Place) -> None:
    two = f"<link name='k'>{b.text()}{COLLISION}</link>"
    moved, own = world(
        f"<model name='m'>{STATIC}{a.text()}{LINK}{two}</model>"
        f"<state world_name='w'><sim_time>1 2</sim_time><model name='m'>{c.text()}"
        f"<scale>1 1 1</scale><link name='k'>{d.text()}<velocity>0 0 0 0 0 0</velocity></link>"
        "</model></state>",
        "1.6",
    )
    assert_pose(moved.pose, c.position, c.rotation)
    assert_pose(own.pose, d.position, d.rotation)


# ---- Bodies: what is fixed, what moves, what moves as one.


def test_the_last_static_counts() -> None:
    (falls,) = world(f"<model name='m'><static>1</static><static>0</static>{LINK}</model>")
    (stands,) = world(f"<model name='m'><static>false</static><static>true</static>{LINK}</model>")
    assert falls.mass is not None
    assert stands.mass is None


def test_a_static_model_makes_all_in_it_static_and_keeps_each_friction() -> None:
    def collision(name: str, friction: str) -> str:
        surface = f"<surface><friction>{friction}</friction></surface>"
        return f"<collision name='{name}'>{BOX}{surface}</collision>"

    bodies = world(
        f"<model name='m'>{STATIC}<link name='l'>{MASS}"
        f"{collision('a', '<ode><mu>0.25</mu></ode>')}"
        f"{collision('b', '<bullet><friction>0.5</friction></bullet>')}"
        "</link><joint name='j' type='revolute'><parent>world</parent><child>l</child></joint>"
        f"<model name='n'><link name='l'>{collision('c', '<ode/>')}</link></model></model>"
    )
    assert [(b.name, b.mass, b.friction) for b in bodies] == [
        ("m::l::a", None, 0.25),
        ("m::l::b", None, 0.5),
        ("m::n::l::c", None, 1.0),
    ]


def test_links_without_joints_move_each_by_itself() -> None:
    bodies = world(f"<model name='m'>{LINK}<link name='k'>{COLLISION}{MASS}</link></model>")
    assert {b.name: b.mass for b in bodies} == {"m::l": 1.0, "m::k": 2.0}


@unhurried
@given(places, places, places, places, st.floats(0.1, 9), st.floats(0.1, 9))
def test_fixed_joints_make_one_body_with_the_inertia_of_the_whole(
    model: Place, link: Place, inner: Place, box: Place, one: float, two: float
) -> None:
    # Two point-like weights, turned any way: their moments are those of two points.
    small = 1e-9

    def weight(mass: float) -> str:
        moments = "".join(f"<{axis}>{small}</{axis}>" for axis in ("ixx", "iyy", "izz"))
        return f"<inertial><mass>{mass!r}</mass><inertia>{moments}</inertia></inertial>"

    (body,) = world(
        f"<model name='m'>{model.text()}<link name='l'>{link.text()}{weight(one)}{COLLISION}"
        f"</link><model name='n'>{inner.text()}<link name='l'>{weight(two)}"
        f"<collision name='c'>{box.text()}{BOX}</collision></link></model>"
        "<joint name='j' type='fixed'><parent>l</parent><child>n::l</child></joint></model>"
    )
    top = (np.array(model.position), model.rotation)
    first, second = compose(top, link), compose(top, inner)
    assert body.mass == pytest.approx(one + two)
    assert body.inertia is not None
    center = (one * first[0] + two * second[0]) / (one + two)
    np.testing.assert_allclose(body.pose.position, center, atol=1e-9)
    apart = float(np.linalg.norm(first[0] - second[0]))
    moment = one * two / (one + two) * apart**2
    expected = [2 * small, moment + 2 * small, moment + 2 * small]
    np.testing.assert_allclose(sorted(body.inertia), expected, rtol=1e-6, atol=1e-7)
    for shape, frame in zip(body.shapes, (first, compose(second, box)), strict=True):
        assert_pose(body.pose @ shape.pose, *frame)


@unhurried
@given(places, places, triples)
def test_the_frame_of_a_movable_body_is_its_principal_frame(
    link: Place, inertial: Place, sizes: tuple[float, float, float]
) -> None:
    # The inertia of a solid, written in a turned frame, is the diagonal one of the solid again.
    diagonal = np.array([1.0, 1.5, 2.0]) + 0.01 * np.abs(sizes)
    turn = Rotation.from_euler("xyz", sizes).as_matrix()
    t = turn @ np.diag(diagonal) @ turn.T
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = (t[0, 0], t[0, 1], t[0, 2], t[1, 1], t[1, 2], t[2, 2])
    moments = "".join(f"<{n}>{float(v)!r}</{n}>" for n, v in zip(names, values, strict=True))
    (body,) = world(
        f"<model name='m'><link name='l'>{link.text()}<inertial>{inertial.text()}"
        f"<mass>3</mass><inertia>{moments}</inertia></inertial>{COLLISION}</link></model>"
    )
    assert body.inertia is not None
    np.testing.assert_allclose(sorted(body.inertia), sorted(diagonal), atol=1e-9)
    position, rotation = compose((np.array(link.position), link.rotation), inertial)
    in_world = rotation.as_matrix() @ t @ rotation.as_matrix().T
    ours = body.pose.rotation @ np.diag(body.inertia) @ body.pose.rotation.T
    np.testing.assert_allclose(ours, in_world, atol=1e-7)
    np.testing.assert_allclose(body.pose.position, position, atol=1e-9)
    assert_pose(body.pose @ body.shapes[0].pose, link.position, link.rotation)


def test_a_fixed_joint_to_the_world_or_to_something_static_fixes() -> None:
    def joint(parent: str, child: str) -> str:
        name = f"{parent}_{child}".replace("::", "_")
        ends = f"<parent>{parent}</parent><child>{child}</child>"
        return f"<joint name='{name}' type='fixed'>{ends}</joint>"

    chain = f"{LINK}<link name='k'>{COLLISION}</link>{joint('l', 'k')}"
    base = f"<model name='n'>{STATIC}{LINK}</model>"
    assert [b.mass for b in world(f"<model name='m'>{chain}</model>")] == [2.0]
    fixed = world(f"<model name='m'>{chain}{joint('world', 'k')}</model>")
    assert [b.mass for b in fixed] == [None, None]
    fixed = world(f"<model name='m'>{joint('k', 'world')}{chain}</model>")
    assert [b.mass for b in fixed] == [None, None]
    fixed = world(f"<model name='m'>{chain}{base}{joint('l', 'n::l')}</model>")
    assert [b.mass for b in fixed] == [None] * 3


def test_all_primitives_are_read() -> None:
    solids = {
        "box": ("<size>1 2 3</size>", (1.0, 2.0, 3.0)),
        "cylinder": ("<radius>.5</radius><length>2e-1</length>", (0.5, 0.2)),
        "sphere": ("<radius>\n+4. </radius>", (4.0,)),
        "plane": ("<normal>0 0 2</normal><size>9 9</size>", (0.0, 0.0, 2.0)),
    }
    collisions = "".join(
        f"<collision name='{kind}'><geometry><{kind}>{text}</{kind}></geometry></collision>"
        for kind, (text, _) in solids.items()
    )
    bodies = read(f"<model name='m'>{STATIC}<link name='l'>{collisions}</link></model>", "1.4")
    found = {b.shapes[0].kind: b.shapes[0].size for b in bodies}
    assert found == {kind: size for kind, (_, size) in solids.items()}


def test_a_world_on_one_line_of_a_hundred_kilobytes_is_read() -> None:
    models = [
        f"<model name='m{i}'>{STATIC}<pose frame=''>{i} 0 0 0 -0 0</pose>{LINK}</model>"
        for i in range(700)
    ]
    text = "".join(models)
    assert len(text) > 100_000
    assert [b.pose.position[0] for b in world(text, "1.6")] == list(range(700))


# ---- What is left out.


def test_what_cannot_matter_is_left_out_quietly(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        (body,) = world(
            "<gui/><scene/><light name='sun' type='directional'/><gravity>0 0 -9.8</gravity>"
            "<physics type='ode'><max_step_size>1</max_step_size></physics>"
            f"<model name='m'>{STATIC}<self_collide>0</self_collide><link name='l'>"
            "<visual name='v'><geometry><mesh/></geometry></visual>"
            "<velocity_decay><linear>0</linear></velocity_decay>"
            f"<collision name='c'>{BOX}<max_contacts>10</max_contacts>"
            "<surface><contact><ode/></contact><bounce/><friction><ode/><torsional><ode/></torsional></friction></surface>"
            "</collision></link></model>"
        )
    assert body.friction == 1.0
    assert not caplog.records


@pytest.mark.parametrize(
    ("element", "where"),
    [
        ("<plugin name='p' filename='f'/>", "world"),
        ("<velocity_decay><linear>0.1</linear></velocity_decay>", "link"),
        ("<surface><bounce><threshold>1</threshold></bounce></surface>", "collision"),
        (f"<surface>{ODE}<mu>1</mu><mu2>0.5</mu2>{EDO}</surface>", "collision"),
        (f"<surface>{ODE}<slip1>0.5</slip1>{EDO}</surface>", "collision"),
        ("<state><model name='nobody'><pose>0 0 0 0 0 0</pose></model></state>", "world"),
        ("<gz:thing xmlns:gz='x'>1</gz:thing>", "link"),
    ],
)  # fmt: skip
def test_what_no_engine_has_is_reported_by_name_and_line(
    element: str, where: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "evoros.sdf"):
        (body,) = world(put(element, where))
    (record,) = caplog.records
    assert record.name == "evoros.sdf"
    assert record.getMessage().startswith("w.sdf:3: <")
    assert body.shapes[0].size == (1.0, 2.0, 3.0)


def test_a_link_that_has_no_mass_or_no_collision_is_reported(
    caplog: pytest.LogCaptureFixture,
) -> None:
    (body,) = world(f"<model name='m'>{LINK}\n<link name='ghost'>{MASS}</link></model>")
    assert (body.name, body.mass) == ("m::l", 1.0)
    no_mass, no_collision = caplog.messages
    assert no_mass.startswith("w.sdf:1: <link> of link 'l'")
    assert no_collision.startswith("w.sdf:2: <link> of link 'ghost'")


# ---- What cannot be used.


def put(element: str, where: str) -> str:
    """A world that is sound but for one element, on line 3."""
    parts = dict.fromkeys(("world", "model", "link", "collision", "geometry"), "")
    parts[where] = f"\n\n{element}\n"
    geometry = parts["geometry"] or "<box><size>1 2 3</size></box>"
    return (
        f"{parts['world']}<model name='m'>{STATIC}{parts['model']}<link name='l'>{parts['link']}"
        f"<collision name='c'>{parts['collision']}<geometry>{geometry}</geometry></collision>"
        "</link></model>"
    )


UNUSABLE = [
    # What would change what stands where, or how it moves.
    ("<include><uri>model://house</uri></include>", "world", "include"),
    ("<include><uri>model://house</uri></include>", "model", "include"),
    ("<actor name='a'/>", "world", "actor"),
    ("<road name='r'/>", "world", "road"),
    ("<population name='p'/>", "world", "population"),
    ("<gravity>0 0 -1.6</gravity>", "world", "gravity"),
    ("<physics><gravity>0 0 0</gravity></physics>", "world", "gravity"),
    ("<plugin name='p' filename='f'/>", "model", "plugin"),
    ("<xacro:wall xmlns:xacro='x'/>", "world", "xacro:wall"),
    ("<surprise/>", "link", "surprise"),
    ("<mesh><uri>house.dae</uri></mesh>", "geometry", "mesh"),
    ("<heightmap/>", "geometry", "heightmap"),
    ("<polyline/>", "geometry", "polyline"),
    ("<capsule><radius>1</radius><length>1</length></capsule>", "geometry", "capsule"),
    ("<ellipsoid><radii>1 1 1</radii></ellipsoid>", "geometry", "ellipsoid"),
    ("<cone><radius>1</radius><length>1</length></cone>", "geometry", "cone"),
    ("<box><size>1 1 1</size></box><sphere><radius>1</radius></sphere>", "geometry", "geometry"),
    ("<model name='m2' placement_frame='l'/>", "model", "placement_frame"),
    # Numbers.
    ("<box/>", "geometry", "size"),
    ("<box><size/></box>", "geometry", "3 numbers"),
    ("<box><size>1 1</size></box>", "geometry", "3 numbers, not 2"),
    ("<box><size>1 1 1 1</size></box>", "geometry", "3 numbers, not 4"),
    ("<box><size>1 -1 1</size></box>", "geometry", "greater than 0"),
    ("<box><size>1 0 1</size></box>", "geometry", "greater than 0"),
    ("<box><size>1 nan 1</size></box>", "geometry", "'nan'"),
    ("<box><size>1 inf 1</size></box>", "geometry", "'inf'"),
    ("<box><size>1 1e400 1</size></box>", "geometry", "'1e400'"),
    ("<box><size>1 1_0 1</size></box>", "geometry", "'1_0'"),
    ("<box><size>1, 1, 1</size></box>", "geometry", "'1,'"),
    ("<box><size>1 \u0661 1</size></box>", "geometry", "numbers"),
    ("<box><size>1 ${x} 1</size></box>", "geometry", "'${x}'"),
    ("<box><size>1 1 1</size><size>2 2 2</size></box>", "geometry", "given 2 times"),
    ("<sphere><radius>-1</radius></sphere>", "geometry", "greater than 0"),
    ("<cylinder><radius>1</radius></cylinder>", "geometry", "length"),
    ("<plane><normal>0 0 0</normal></plane>", "geometry", "0 0 1"),
    ("<pose>0 0 0 0 0</pose>", "link", "6 numbers, not 5"),
    ("<pose>0 0 0 0 0 0 1</pose>", "link", "6 numbers, not 7"),
    ("<pose>0 0 0 0 0 north</pose>", "link", "'north'"),
    ("<pose>0 0 0 0 0 <b/>0</pose>", "link", "<b>"),
    ("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>", "link", "quaternion"),
    ("<pose rotation_format='matrix'>0 0 0 0 0 0</pose>", "link", "'matrix'"),
    ("<pose degrees='maybe'>0 0 0 0 0 0</pose>", "link", "'maybe'"),
    ("<pose/><pose/>", "link", "given 2 times"),
    ("<inertial><mass>0</mass></inertial>", "link", "greater than 0"),
    ("<inertial><mass>-5</mass></inertial>", "link", "greater than 0"),
    ("<inertial auto='true'/>", "link", "auto"),
    ("<inertial><inertia><ixx>1</ixx><iyy>1</iyy></inertia></inertial>", "link", "izz"),
    (f"<inertial><inertia>{UNIT}<ixy>2</ixy></inertia></inertial>", "link", "definite"),
    ("<surface><friction><ode><mu>-1</mu></ode></friction></surface>", "collision", "at least 0"),
    ("<static>perhaps</static>", "model", "'perhaps'"),
    # Names.
    ("<pose relative_to='nowhere'>0 0 0 0 0 0</pose>", "model", "'nowhere'"),
    ("<pose relative_to='nowhere'>0 0 0 0 0 0</pose>", "collision", "'nowhere'"),
    ("<pose frame='nowhere'>0 0 0 0 0 0</pose>", "link", "'nowhere'"),
    ("<pose relative_to='l'>0 0 0 0 0 0</pose>", "link", "circular"),
    ("<model name='n'><pose relative_to='n::k'/><link name='k'/></model>", "model", "circular"),
    ("<frame name='a' attached_to='b'/><frame name='b' attached_to='a'/>"
     "<link name='k'><pose relative_to='a'/></link>", "model", "circular"),
    ("<link name='l'/>", "model", "taken"),
    ("<frame name='l'/>", "model", "taken"),
    ("<model name='m'/>", "world", "taken"),
    ("<collision name='c'><geometry><empty/></geometry></collision>", "link", "taken"),
    ("<link/>", "model", "must have a name"),
    ("<link name='world'/>", "model", "reserved"),
    ("<collision name='d'/>", "link", "geometry"),
    ("<state><model name='m'><scale>2 1 1</scale></model></state>", "world", "scale"),
    ("<state><insertions/></state>", "world", "insertions"),
]  # fmt: skip


@pytest.mark.parametrize(("element", "where", "says"), UNUSABLE)
def test_what_cannot_be_used_is_an_error_with_file_line_and_cure(
    element: str, where: str, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        world(put(element, where))
    message = str(caught.value)
    # Of two with one name the later one is named, which here stands on the line after.
    line = 4 if says == "taken" else 3
    assert message.startswith(f"w.sdf:{line}: <"), message
    assert says in message
    assert "; " in message
    assert "\n" not in message


MOVING = [
    ("<joint name='j' type='revolute'><parent>l</parent><child>k</child></joint>", "'revolute'"),
    ("<joint name='j' type='fixed'><parent>l</parent><child>nobody</child></joint>", "'nobody'"),
    ("<joint name='j' type='fixed'><parent>l</parent></joint>", "<child>"),
    ("<joint name='j' type='fixed'><parent>f</parent><child>k</child></joint>", "name a link"),
    ("<joint name='j'><parent>l</parent><child>k</child></joint>", "has type ''"),
    ("<link name='o'><gravity>false</gravity></link>", "gravity"),
    ("<link name='o'><kinematic>true</kinematic></link>", "kinematic"),
    (f"<link name='o'>{COLLISION.replace(BOX, '<geometry><plane/></geometry>')}</link>", "plane"),
    (f"<link name='o'>{COLLISION}<collision name='d'>{BOX}<surface>{ODE}<mu>2</mu>{EDO}"
     "</surface></collision></link>", "friction 1 and 2"),
]  # fmt: skip


@pytest.mark.parametrize(("element", "says"), MOVING)
def test_what_moves_must_be_simple(element: str, says: str) -> None:
    two = f"{LINK}<link name='k'>{COLLISION}</link><frame name='f'/>"
    with pytest.raises(InputError, match=r"^w\.sdf:2: <") as caught:
        world(f"<model name='m'>{two}\n{element}</model>")
    assert says in str(caught.value)
    if "joint" not in element or "revolute" in element:
        # The same in a static model moves nothing, so it may stand there.
        world(f"<model name='m'>{STATIC}{two}\n{element}</model>")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not well-formed"),
        ("<sdf version='1.9'>", "not well-formed"),
        ("<sdf version='1.9'><world name='w'></model></sdf>", "not well-formed"),
        ("<sdf version='1.9'><world name='w'><gz:x/></world></sdf>", "not well-formed"),
        ("<sdf version='1.9'>&nbsp;</sdf>", "not well-formed"),
        ("<robot name='r'/>", "must be <sdf>"),
        ("<gazebo version='1.0'/>", "must be <sdf>"),
        ("<sdf/>", "1.4 to 1.11"),
        ("<sdf version='1.3'/>", "1.4 to 1.11"),
        ("<sdf version='1.40'/>", "1.4 to 1.11"),
        ("<sdf version='2.0'/>", "1.4 to 1.11"),
        ("<sdf version='1.9'><world name='a'/><world name='b'/></sdf>", "alone"),
        ("<sdf version='1.9'><world name='a'/><model name='b'/></sdf>", "alone"),
        ("<!DOCTYPE sdf><sdf version='1.9'/>", "DOCTYPE"),
        ("<!DOCTYPE sdf SYSTEM 'http://127.0.0.1:9/x'><sdf version='1.9'/>", "DOCTYPE"),
        ("<!DOCTYPE sdf [<!ENTITY e SYSTEM 'file:///etc/hostname'>]><sdf>&e;</sdf>", "DOCTYPE"),
    ],
)
def test_only_one_plain_sdf_document_is_accepted(text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        read_sdf(text.encode(), "a b%20ü.sdf")
    assert says in str(caught.value)
    assert str(caught.value).startswith("a b%20ü.sdf:1: ")
    assert "\n" not in str(caught.value)


def test_entities_do_not_grow() -> None:
    levels = "".join(f"<!ENTITY e{i} '{f'&e{i - 1};' * 10}'>" for i in range(1, 12))
    bomb = f"<!DOCTYPE sdf [<!ENTITY e0 'ha'>{levels}]><sdf version='1.9' a='&e11;'>&e11;</sdf>"
    for encoding in ("utf-8", "utf-16"):
        with pytest.raises(InputError):
            read_sdf(bomb.encode(encoding), "w.sdf")


def test_a_long_value_makes_no_long_message() -> None:
    with pytest.raises(InputError) as caught:
        world(put(f"<pose>0 0 0 0 0 {'x' * 100_000}</pose>", "link"))
    assert len(str(caught.value)) < 300


@unhurried
@given(st.binary(max_size=40), st.integers(0, 10_000), st.integers(0, 60))
def test_a_damaged_file_is_read_or_refused_in_one_line(junk: bytes, at: int, cut: int) -> None:
    body = put("<inertial><mass>1</mass></inertial>", "link")
    sound = f"<sdf version='1.9'><world name='w'>{body}</world></sdf>".encode()
    at %= len(sound)
    message = ""
    try:
        read_sdf(sound[:at] + junk + sound[at + cut :], "w.sdf")
    except InputError as error:
        message = str(error)
    assert message == "" or message.startswith("w.sdf:")
    assert len(message.splitlines()) <= 1
