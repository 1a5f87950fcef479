"""Fuzzed inputs: each file that a user hands in is read, or refused in one line that names it.

evoros writes bags and reads none, so a fuzzed trajectory becomes a bag, which another library has
to read with all its messages.
"""

import io
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr
from pathlib import Path
from random import Random
from typing import NamedTuple
from unittest import mock

import numpy as np
from cases import READ, REFUSED, Fault, Trial, call, check_refusal, check_words, prepare_quietly
from helpers import TINY, USER_PARTS, copied, everything, reseal, tiny
from hydra.utils import instantiate
from mesh_cases import DAE, TWO_BOXES
from mutations import NUMBERS, mutate
from robot_cases import configuration
from rosbags.highlevel import AnyReader

from evoros.analysis.command import evoros_analyze
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.files.resources import bundled_folder
from evoros.formats.mesh import read_mesh
from evoros.formats.urdf.packages import index_packages
from evoros.formats.urdf.xacro_expansion import ReadOptions, expand
from evoros.geometry.shapes import MeshFile
from evoros.robot.loading import load_robot
from evoros.session.design_tables import DesignDraft, add_genes, fit_designs, read_drafts
from evoros.terminal.console import DONE
from evoros.terminal.log import withhold_messages
from evoros.world.loading import load_world

LIMIT_S = 20.0
CLEAR = 2000
"""The characters of a line that is still clear."""
TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


class Format(NamedTuple):
    """Files of a format, a reader of them, and how often they are tried."""

    samples: Mapping[str, bytes]
    read: Callable[[Path], object]
    weight: float


@contextmanager
def prepare(base: Path) -> Iterator[Callable[[int, Path], Trial]]:
    """Collect sound files of each format."""
    prepare_quietly(lambda: tiny(base / "run", "optimizer.generations=1"))
    experiment = compose([*TINY[2:], "executor=serial"], config_dir=USER_PARTS).build()
    formats = list_formats(base, experiment)
    names = [*formats, "bag"]
    weights = [*(kind.weight for kind in formats.values()), 0.04]

    def plan(seed: int, folder: Path) -> Trial:
        rng = Random(f"fuzz {seed}")
        (name,) = rng.choices(names, weights)
        if name == "bag":
            return Trial("bag: of a trajectory", lambda: judge_bag(base / "run", folder, rng))
        sample = rng.choice(sorted(formats[name].samples))
        path = folder / f"fuzzed{Path(sample).suffix}"
        path.write_bytes(mutate(formats[name].samples[sample], rng))
        return Trial(f"{name}: {sample}", lambda: judge(formats[name].read, path))

    with ExitStack() as stack:  # meshes are kept in a cache
        stack.enter_context(mock.patch.dict(os.environ, {"XDG_CACHE_HOME": str(base / "cache")}))
        stack.enter_context(np.errstate(all="ignore"))
        yield plan


def list_formats(base: Path, experiment: Experiment) -> dict[str, Format]:
    """List all formats that users hand in."""
    drive = instantiate(configuration("two_wheeler")["drive"], _convert_="all")
    course = experiment.world["near"].course
    designs = (base / "run" / "champion" / "design.csv").read_bytes()
    genes = b"design,key,value\n1,failure.earliest_s,2.5\n1,failure.latest_s,7\n"
    worlds = {path.name: path.read_bytes() for path in bundled_folder("worlds").glob("*.sdf")}
    return {
        "CSV of designs": Format({"designs.csv": designs}, designs_reader(experiment), 0.2),
        "CSV of genes": Format({"genes.csv": genes}, read_genes, 0.05),
        "URDF": Format(list_robots(), lambda path: load_robot(str(path), drive), 0.2),
        "SDF": Format(worlds, lambda path: load_world(str(path), course), 0.2),
        "mesh": Format(list_meshes(), lambda path: read_mesh(MeshFile(path)), 0.23),
        "YAML": Format(list_configurations(), read_configuration, 0.08),
    }


def designs_reader(experiment: Experiment) -> Callable[[Path], object]:
    """Return the reader of a table of designs."""
    return lambda path: fit_designs(read_drafts(path, "fuzzed", experiment.members), experiment)


def read_genes(path: Path) -> None:
    """Read a table of genes of one design."""
    add_genes({("fuzzed", "1"): {"": DesignDraft("")}}, path, "fuzzed")


def list_robots() -> dict[str, bytes]:
    """Return bundled robots as URDF."""
    folder = bundled_folder("robots")
    paths = [folder / name / f"{name}.xacro" for name in ("two_wheeler", "erle_rover")]
    return {
        f"{path.stem}.urdf": expand(path, ReadOptions(), index_packages(path, ()))[0].encode()
        for path in paths
    }


def list_meshes() -> dict[str, bytes]:
    """Return a tetrahedron in each format."""
    corners = [[TETRAHEDRON[index] for index in face] for face in FACES]
    binary = bytes(80) + struct.pack("<I", len(FACES))
    text = "solid s\n"
    for face in corners:
        numbers = [number for corner in ((0, 0, 0), *face) for number in corner]
        binary += struct.pack("<12fH", *numbers, 0)
        lines = "".join(f"      vertex {x} {y} {z}\n" for x, y, z in face)
        text += f"  facet normal 0 0 0\n    outer loop\n{lines}    endloop\n  endfacet\n"
    points = "".join(f"v {x} {y} {z}\n" for x, y, z in TETRAHEDRON)
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)
    return {
        "binary.stl": binary,
        "text.stl": f"{text}endsolid s\n".encode(),
        "boxes.obj": TWO_BOXES.encode(),
        "mesh.obj": f"mtllib none.mtl\no part\n{points}{faces}".encode(),
        "wedges.dae": DAE.format(up="Z_UP").encode(),
    }


def list_configurations() -> dict[str, bytes]:
    """Return the experiments and parts of the tests."""
    return {path.name: path.read_bytes() for path in USER_PARTS.glob("experiment/*.yaml")}


def read_configuration(path: Path) -> object:
    """Compose and build an experiment of a folder that has one fuzzed file."""
    own = path.parent / "own"
    own.mkdir()
    for part in USER_PARTS.iterdir():
        if part.name not in ("experiment", "__pycache__"):
            (own / part.name).symlink_to(part)
    (own / "experiment").mkdir()
    path.rename(own / "experiment" / "fuzzed.yaml")
    return compose(["experiment=fuzzed", "executor=serial"], config_dir=own).build()


def judge(read: Callable[[Path], object], path: Path) -> str:
    """Read a file; a refusal is one line that names it, but for configurations the key."""
    words = io.StringIO()  # of libraries; messages of evoros are withheld
    try:
        with withhold_messages(), redirect_stderr(words):
            read(path)
    except InputError as error:
        line = str(error)
        if "\n" in line or len(line) > CLEAR:
            raise Fault(f"a refusal of {len(line)} characters: {line[:200]!r}") from error
        if path.suffix != ".yaml" and path.name not in line:
            raise Fault(f"the file is not named: {line[:200]!r}") from error
        return REFUSED
    finally:
        check_words(words.getvalue())
    return READ


def judge_bag(run: Path, folder: Path, rng: Random) -> str:
    """Write a bag of a trajectory with odd numbers, and let another library read it."""
    copy = copied(run, folder / "run")
    table = copy / "champion" / "trajectory_near.csv"
    lines = [line.split(",") for line in table.read_text().splitlines()]
    for _ in range(rng.choice((0, 1, 1, 5, 50))):
        row = rng.choice(lines[1:])
        row[rng.randrange(len(row))] = rng.choice((*NUMBERS, "1e9", "5", "0.5"))
    table.write_text("".join(",".join(line) + "\n" for line in lines))
    reseal(copy)
    form = rng.choice(("ros1", "mcap"))
    words = ("bag", str(copy), "--world", "near", "--format", form, "--output", str(folder / "out"))
    answer = call(lambda: evoros_analyze(words))
    if answer.status != DONE:
        check_refusal(answer, copy, everything(copy))
        return REFUSED
    bag = folder / "out" / ("bag_near.bag" if form == "ros1" else "bag_near")
    with AnyReader([bag]) as reader:
        read = sum(
            bool(reader.deserialize(data, one.msgtype)) for one, _, data in reader.messages()
        )
    if read < len(lines) - 1:
        raise Fault(f"{read} messages of {len(lines) - 1} rows")
    return READ
