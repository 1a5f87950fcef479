"""Small meshes: as text, and of the cells of a grid."""

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array

SIDES = [(axis, step) for axis in range(3) for step in (-1, 1)]


def grid_mesh(filled: NDArray[np.bool_], lines: list[list[float]]) -> Array:
    """The surface of the filled cells between the lines of a grid, facing outwards."""
    triangles = []
    for cell in np.argwhere(filled):
        for axis, step in SIDES:
            other = cell.copy()
            other[axis] += step
            if 0 <= other[axis] < filled.shape[axis] and filled[tuple(other)]:
                continue
            u, v = (axis + 1) % 3, (axis + 2) % 3
            square = []
            for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                index = cell.copy()
                index[axis] += step > 0
                index[u] += du
                index[v] += dv
                square.append([lines[k][index[k]] for k in range(3)])
            a, b, c, d = square[::step]
            triangles += [[a, b, c], [a, c, d]]
    return np.array(triangles, dtype=np.float64).reshape(-1, 3, 3)


DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimeter" meter="0.01"/><up_axis>{up}</up_axis></asset>
  <library_geometries>
    <geometry id="wedge-mesh" name="wedge">
      <mesh>
        <source id="positions">
          <float_array id="values" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array>
          <technique_common><accessor source="#values" count="4" stride="3"/></technique_common>
        </source>
        <vertices id="points"><input semantic="POSITION" source="#positions"/></vertices>
        <triangles count="4" material="painted">
          <input semantic="VERTEX" source="#points" offset="0"/>
          <input semantic="NORMAL" source="#absent" offset="1"/>
          <p>0 0 2 0 1 0  0 0 1 0 3 0  0 0 3 0 2 0  1 0 2 0 3 0</p>
        </triangles>
      </mesh>
    </geometry>
  </library_geometries>
  <library_visual_scenes>
    <visual_scene id="scene">
      <node id="a" name="left">
        <translate>500 0 0</translate>
        <instance_geometry url="#wedge-mesh"/>
      </node>
      <node id="b" name="right">
        <rotate>0 0 1 90</rotate><scale>2 2 2</scale>
        <instance_geometry url="#wedge-mesh"/>
      </node>
    </visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
TWO_BOXES = """mtllib absent.mtl
o left
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
o right
usemtl paint
v 3 0 0
v 5 0 0
v 3 1 0
v 3 0 1
f 9 11 10
f 9 10 12
f 9 12 11
f 10 11 12
"""
