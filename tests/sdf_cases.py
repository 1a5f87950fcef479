"""Parts of SDF files and poses for the tests of the reader."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evoros.formats.sdf.reader import SdfWorld, read_sdf
from evoros.formats.sdf.reading import SdfOptions
from evoros.geometry.shapes import Body, Pose

BOX = "<geometry><box><size>1 2 3</size></box></geometry>"


COLLISION = f"<collision name='c'>{BOX}</collision>"


LINK = f"<link name='l'>{COLLISION}</link>"


STATIC = "<static>true</static>"


MASS = "<inertial><mass>2</mass></inertial>"


unhurried = settings(deadline=None)


def read(content: str, version: str = "1.9") -> tuple[Body, ...]:
    return read_sdf(f'<sdf version="{version}">{content}</sdf>'.encode(), "w.sdf").bodies


def world(content: str, version: str = "1.9") -> tuple[Body, ...]:
    return read(f"<world name='w'>{content}</world>", version)


def write(path: Path, text: str) -> Path:
    """Write a text to a file in a folder that need not exist."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def load(folder: Path, content: str, version: str = "1.9", **options: object) -> SdfWorld:
    """Read a world whose file lies in the folder ``worlds``; its content begins on line 3."""
    text = f"<sdf version='{version}'>\n<world name='w'>\n{content}\n</world></sdf>"
    file = write(folder / "worlds" / "w.sdf", text)
    return read_sdf(file.read_bytes(), "w.sdf", SdfOptions(**options), file)  # type: ignore[arg-type]


def assert_pose(
    pose: Pose, position: NDArray[np.float64] | Sequence[float], rotation: Rotation
) -> None:
    np.testing.assert_allclose(np.array(pose.position), position, atol=1e-7)
    assert (Rotation.from_quat(pose.quaternion).inv() * rotation).magnitude() < 1e-7


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


def compose(frame: tuple[np.ndarray, Rotation], place: Place) -> tuple[np.ndarray, Rotation]:
    position, rotation = frame
    return position + rotation.apply(place.position), rotation * place.rotation


places = st.builds(Place, triples, triples, st.sampled_from(["euler", "quat", "degrees"]))
