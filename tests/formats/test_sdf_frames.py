"""World poses of nested elements, against scipy's rotations."""

from dataclasses import dataclass, field

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from sdf_cases import (
    BOX,
    COLLISION,
    LINK,
    STATIC,
    Place,
    assert_pose,
    compose,
    places,
    unhurried,
    world,
)

from evoros.geometry.shapes import Pose


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
