"""A robot with visual meshes: a body as OBJ with two materials, wheels as STL, a mast as DAE."""

from pathlib import Path

import numpy as np
import trimesh
from mesh_cases import DAE

RED, GLASS, BLACK, PAINT = (0.8, 0.1, 0.1), (0.1, 0.2, 0.3), (0.1, 0.1, 0.1), (0.9, 0.6, 0.1)
WHEEL_M, TYRE_M, SCALE = 0.06, 0.03, 0.001  # radius, width; the STL is in millimetres
LINK = """<link name="{name}">{visuals}
<collision><origin rpy="{rpy}"/><geometry>{shape}</geometry></collision>
<inertial><mass value="{mass}"/><inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/>
</inertial></link>"""
MESH = """<visual><origin xyz="{xyz}" rpy="{rpy}"/><geometry><mesh filename="{file}"
scale="{scale}"/></geometry>{material}</visual>"""
TREAD = """<joint name="{name}_joint" type="continuous"><parent link="base_link"/>
<child link="{name}"/><origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>"""
MATERIALS = "".join(
    f"newmtl {name}\nKd {' '.join(map(str, colour))}\n"
    for name, colour in (("red", RED), ("glass", GLASS))
)


def write_meshed_robot(folder: Path, fine: int = 24) -> Path:
    """Write the files and return that of the robot; round meshes have ``fine`` sides."""
    folder.mkdir(parents=True, exist_ok=True)
    profile = [[30, 12], [52, 12], [60, 6], [60, -6], [52, -12], [30, -12], [30, -4]]
    rim = [*profile, [8, -4], [8, 4], [30, 4], profile[0]]
    wheel = trimesh.creation.revolve(np.array(rim, dtype=float), sections=fine)
    wheel.export(folder / "wheel.stl")
    (folder / "body.mtl").write_text(MATERIALS)
    (folder / "body.obj").write_text(_body())
    (folder / "mast.dae").write_text(DAE.format(up="Z_UP"))
    box = '<box size="0.3 0.2 0.09"/>'
    body = _show("body.obj", "0 0 0.01", "0 0 0", "1 1 1", "")
    paint = '<material name="paint"><color rgba="{} {} {} 1"/></material>'.format(*PAINT)
    body += _show("mast.dae", "-0.145 0 0.09", "0 0 0", "0.006 0.006 0.03", paint)
    links = [LINK.format(name="base_link", visuals=body, rpy="0 0 0", shape=box, mass=4, i=0.04)]
    black = '<material name="black"><color rgba="{} {} {} 1"/></material>'.format(*BLACK)
    scale = " ".join([str(SCALE)] * 3)
    cylinder = f'<cylinder radius="{WHEEL_M}" length="{TYRE_M}"/>'
    for name, x, y in (("left", -0.08, 0.12), ("right", -0.08, -0.12)):
        shown = _show("wheel.stl", "0 0 0", "1.5707963 0 0", scale, black)
        tyre = {"rpy": "1.5707963 0 0", "shape": cylinder, "mass": 0.3, "i": 0.0004}
        links += [LINK.format(name=name, visuals=shown, **tyre), TREAD.format(name=name, x=x, y=y)]
    ball = {"rpy": "0 0 0", "shape": '<sphere radius="0.03"/>', "mass": 0.1, "i": 0.00004}
    links.append(LINK.format(name="caster_wheel", visuals="", **ball))
    links.append(
        '<joint name="caster" type="fixed"><parent link="base_link"/>'
        '<child link="caster_wheel"/><origin xyz="0.11 0 -0.03"/></joint>'
    )
    file = folder / "meshed.urdf"
    file.write_text(f'<robot name="meshed">{"".join(links)}</robot>')
    return file


def _show(file: str, xyz: str, rpy: str, scale: str, material: str) -> str:
    return MESH.format(file=file, xyz=xyz, rpy=rpy, scale=scale, material=material)


def _body() -> str:
    """Return a hull with a sloped nose in red, and a cabin in glass."""
    hull = [(x, y, -0.04) for x in (-0.15, 0.13) for y in (-0.095, 0.095)]
    hull += [(x, y, 0.02) for x in (-0.15, 0.16) for y in (-0.1, 0.1)]
    hull += [(x, y, 0.045) for x in (-0.15, 0.09) for y in (-0.09, 0.09)]
    cabin = [(x, y, 0.045) for x in (-0.12, 0.06) for y in (-0.075, 0.075)]
    cabin += [(x, y, 0.085) for x in (-0.1, 0.0) for y in (-0.06, 0.06)]
    lines, first = ["mtllib body.mtl"], 1
    for name, corners in (("red", hull), ("glass", cabin)):
        solid = trimesh.convex.convex_hull(np.array(corners))
        lines += [f"o {name}_part", f"usemtl {name}"]
        lines += [f"v {x} {y} {z}" for x, y, z in solid.vertices]
        lines += ["f {} {} {}".format(*(face + first)) for face in solid.faces]
        first += len(solid.vertices)
    return "\n".join(lines) + "\n"
