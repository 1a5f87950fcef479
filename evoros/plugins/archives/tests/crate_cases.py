"""A project with its own failure model and a robot with a mesh, and two of its runs."""

import shutil
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import trimesh
from helpers import USER_PARTS

from evoros.cli.main import evoros
from evoros.files.zipped import add_member, seal_zip
from evoros.terminal.console import DONE

FAILURE = '''"""The first sensor falls silent."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from evoros.parts import A_FILTER, Channels, Failure, Fault, Filter, Generator, Silence, checked


@dataclass(frozen=True)
@checked
class FirstSilent(Failure):
    latest_s: float = 4.0
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        onset = np.full(channels.size, np.inf)
        onset[:1] = rng.uniform(0.0, self.latest_s)
        return (Fault(self.effect, onset),)
'''
_WHEEL = """<link name="{0}_wheel"><inertial><mass value="0.2"/><inertia ixx="0.0003" iyy="0.0003"
 izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin rpy="1.5707963 0 0"/><geometry>
<cylinder radius="0.05" length="0.03"/></geometry></collision></link>
<joint name="{0}_wheel_joint" type="continuous"><parent link="base_link"/>
<child link="{0}_wheel"/><origin xyz="0.1 {1} 0.05"/><axis xyz="0 1 0"/>
<limit effort="5" velocity="20"/></joint>"""
ROBOT = f"""<robot name="cart"><link name="base_link"><inertial><mass value="2"/><inertia ixx="0.02"
 iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.1"/>
<geometry><mesh filename="meshes/body.stl"/></geometry></collision></link>
{_WHEEL.format("left", 0.12)}{_WHEEL.format("right", -0.12)}
<link name="caster_link"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
<joint name="caster_joint" type="fixed"><parent link="base_link"/><child link="caster_link"/>
<origin xyz="-0.12 0 0.02"/></joint></robot>
"""
PARTS = {
    "failure/first.yaml": "_target_: silent_failures.FirstSilent\nlatest_s: 3.0\n",
    "silent_failures.py": FAILURE,
}


def write_project(folder: Path) -> Path:
    """Write a project: ``mine/`` with own parts, ``robots/`` with a robot and its mesh."""
    for name, text in PARTS.items():
        (folder / "mine" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "mine" / name).write_text(text)
    (folder / "mine" / "world").mkdir()
    shutil.copy(USER_PARTS / "world" / "plains.yaml", folder / "mine" / "world")
    (folder / "robots" / "meshes").mkdir(parents=True)
    (folder / "robots" / "cart.urdf").write_text(ROBOT)
    box = trimesh.creation.box(extents=(0.3, 0.2, 0.1))
    box.export(folder / "robots" / "meshes" / "body.stl")
    return folder


def run_arguments(project: Path, output: Path, *more: str) -> list[str]:
    """Arguments of a short run of the project, whose robot is named by its full path."""
    return [
        *("--config-dir", str(project / "mine"), "executor=serial", "simulator=planar"),
        *("world=plains", "failure=first", "robot=own", "design=around", f"hydra.run.dir={output}"),
        f"robot.description={project / 'robots' / 'cart.urdf'}",
        *("optimizer.population_size=2", "optimizer.generations=1", "figures=[]"),
        *("optimizer.validation_trials=1", *more),
    ]


def run_project(project: Path, output: Path, *more: str) -> Path:
    """Make the run in this process."""
    assert evoros(run_arguments(project, output, *more)) == DONE
    return output


def rewrite(archive: Path, to: Path, change: Callable[[dict[str, bytes]], None]) -> Path:
    """Write an archive with other files, with the right digest of the whole."""
    with ZipFile(archive) as given:
        names = [name for name in given.namelist() if not name.endswith("/")]
        files = {name: given.read(name) for name in names}
    change(files)
    with to.open("w+b") as file:
        with ZipFile(file, "w") as new:
            for name, content in files.items():
                add_member(new, name, content)
        seal_zip(file)
    return to
