"""The SDF reader: which bodies are fixed, move or move as one, and the poses of nested elements."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from sdf_cases import (
    BOX,
    COLLISION,
    LINK,
    MASS,
    STATIC,
    Place,
    assert_pose,
    compose,
    places,
    read,
    triples,
    unhurried,
    world,
)

from evoros.geometry.shapes import Pose


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
    sizes = {b.shapes[0].kind: b.shapes[0].size for b in bodies}
    assert sizes == {kind: size for kind, (_, size) in solids.items()}


def test_a_world_on_one_line_of_a_hundred_kilobytes_is_read() -> None:
    models = [
        f"<model name='m{i}'>{STATIC}<pose frame=''>{i} 0 0 0 -0 0</pose>{LINK}</model>"
        for i in range(700)
    ]
    text = "".join(models)
    assert len(text) > 100_000
    assert [b.pose.position[0] for b in world(text, "1.6")] == list(range(700))


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
    moved, unmoved = world(
        f"<model name='m'>{STATIC}{a.text()}{LINK}{two}</model>"
        f"<state world_name='w'><sim_time>1 2</sim_time><model name='m'>{c.text()}"
        f"<scale>1 1 1</scale><link name='k'>{d.text()}<velocity>0 0 0 0 0 0</velocity></link>"
        "</model></state>",
        "1.6",
    )
    assert_pose(moved.pose, c.position, c.rotation)
    assert_pose(unmoved.pose, d.position, d.rotation)
